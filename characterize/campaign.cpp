#include "characterize/campaign.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <map>
#include <memory>
#include <set>

#include "characterize/cell.h"
#include "characterize/job_runner.h"
#include "characterize/measure.h"
#include "characterize/peaks.h"
#include "characterize/profile.h"
#include "characterize/roofline.h"
#include "characterize/unit_request.h"
#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/registry.h"

namespace pirt {
namespace {

/// Where references and kernel caches live for one run; gone with it.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "pirt-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      throw_environment(
          fmt::format("cannot make a scratch folder '{}': {}; set TMPDIR to a folder "
                      "with space",
                      name, std::strerror(errno)));
    }
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string utc_now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

SamplingOptions sampling_options(const CampaignOptions& options) {
  SamplingOptions sampling;
  if (!options.quick) {
    sampling.warm_up = std::chrono::milliseconds(300);
    sampling.minimum = std::chrono::seconds(1);
    sampling.budget = std::chrono::seconds(5);
  }
  sampling.precision = options.precision;
  sampling.limit = options.job_limit / 2;  // the rest is for setting up and verifying
  return sampling;
}

Environment run_environment(const CampaignOptions& options, const CampaignPlan& plan) {
  Environment facts = host_environment();
  facts.merge(build_environment());
  facts.insert(plan.facts.begin(), plan.facts.end());
  facts["cores_usable"] = fmt::format("{}", fmt::join(usable_cores(), ","));
  const ClockQuality clock = measure_clock(MachineClock());
  facts["clock_cost_ns"] = fmt::format("{:.1f}", clock.cost_ns);
  facts["clock_resolution_ns"] = std::to_string(clock.resolution.count());
  const auto images =
      options.images ? images_from(*options.images) : generated_images(options.seed);
  facts["images"] = images->describe();
  facts["images_hash"] = fmt::format("{:016x}", images->content_hash());
  facts["mode"] = options.quick ? "quick" : "full";
  facts["precision"] = fmt::format("{}", options.precision);
  if (!options.filter.empty()) facts["filter"] = options.filter;
  if (!options.platform.assumptions.empty()) facts["assumptions"] = options.platform.assumptions;
  return facts;
}

class Campaign {
 public:
  Campaign(const CampaignOptions& options, const CampaignPlan& plan, const ProgressSink& sink)
      : options_(options),
        plan_(plan),
        sink_(sink),
        runner_(options.program, options.job_limit, options.stop) {}

  CampaignSummary run() {
    ProfileWriter writer(options_.database);
    summary_.run_id = writer.begin_run({utc_now(), options_.platform.name, options_.seed,
                                        run_environment(options_, plan_), plan_.units});
    measure_peaks_of_units(writer);
    if (!summary_.interrupted) measure_all(writer);
    if (summary_.cells > 0 && !summary_.interrupted) judge_peaks(writer);
    if (!summary_.interrupted) {
      writer.finish_run(summary_.run_id, utc_now(),
                        end_environment(counters_, read_host_counters({})));
    }
    summary_.elapsed = elapsed();
    return summary_;
  }

 private:
  [[nodiscard]] Nanos elapsed() const { return clock_.now() - start_; }

  /// The limits of each unit, before its cells.
  void measure_peaks_of_units(ProfileWriter& writer) {
    for (const UnitRecord& unit : plan_.units) {
      if (!summary_.interrupted) measure_peaks_of(unit.unit, writer);
    }
  }

  /// Stores the faster of what is known and what is measured now. A worker that fails leaves rows
  /// that say so.
  void measure_peaks_of(const std::string& name, ProfileWriter& writer) {
    const UnitModel& unit = options_.platform.unit(name);
    Job job;
    job.kind = JobKind::kPeaks;
    job.backend = unit.backend;
    job.unit = make_unit_request(options_.platform, unit);
    // A kernel cache of its own: what is compiled here must not warm up a cell's cold set-up.
    const auto cache = scratch_.path() / "peaks";
    std::filesystem::create_directories(cache);
    const auto result =
        runner_.run(job, find_backend(unit.backend).kernel_cache_environment(cache.string()));
    if (!result) {
      summary_.interrupted = true;
      return;
    }
    auto& known = peaks_[name];
    known =
        faster_peaks(known, peak_records(name, result->peaks, result->error, result->provenance));
    writer.write_peaks(summary_.run_id, known);
  }

  /// A cell above its roof shows that a peak was measured too low, in a busy spell perhaps: it is
  /// measured once more, and if it is still exceeded, it is stored as not valid.
  void judge_peaks(ProfileWriter& writer) {
    const auto exceeded = [&] {
      return exceeded_peaks(rooflines(load_profile(options_.database, options_.platform.name)),
                            summary_.run_id);
    };
    std::set<std::string> units;
    for (const PeakRow& peak : exceeded()) units.insert(peak.unit);
    if (units.empty()) return;
    for (const std::string& unit : units) {
      if (!summary_.interrupted) measure_peaks_of(unit, writer);
    }
    for (const PeakRow& peak : exceeded()) {
      const PeakRecord record{peak.unit,    peak.kind,       peak.per_second,
                              peak.variant, peak.provenance, peak.reasons};
      writer.write_peaks(summary_.run_id, {&record, 1});
      if (!sink_.warning) continue;
      sink_.warning(fmt::format("{}: the {} peak is not valid: {}", peak.unit, to_string(peak.kind),
                                join(peak.reasons, ", ")));
    }
  }

  /// Unstable cells are sampled again when all others are done, since a busy spell of the machine
  /// lasts for seconds; those that an interruption leaves over are stored as they are.
  void measure_all(ProfileWriter& writer) {
    std::vector<std::unique_ptr<CellMeasurement>> unstable;
    for (const PlannedCell& planned : plan_.cells) {
      const CellRequest request = request_for(planned);
      const auto failure = reference(request);
      auto cell = std::make_unique<CellMeasurement>(request, runner_);
      if (!failure || (failure->empty() && !cell->measure())) {
        summary_.interrupted = true;
        break;
      }
      if (cell->unstable()) {
        unstable.push_back(std::move(cell));
      } else {
        store(writer, failure->empty() ? cell->record() : failed_cell(request, *failure));
      }
    }
    for (const auto& cell : unstable) {
      if (!summary_.interrupted) summary_.interrupted = !cell->sample_again();
      store(writer, cell->record());
    }
  }

  void store(ProfileWriter& writer, const CellRecord& record) {
    writer.write_cell(summary_.run_id, record);
    count(record);
  }

  CellRequest request_for(const PlannedCell& planned) {
    const UnitModel& unit = options_.platform.unit(planned.unit);
    const auto at =
        std::ranges::find(plan_.units, planned.unit, &UnitRecord::unit) - plan_.units.begin();
    return {options_.platform,
            unit,
            find_backend(unit.backend),
            *planned.workload,
            job_for(planned, unit),
            plan_.provenances.at(static_cast<std::size_t>(at)),
            options_.quick ? 2 : 5,
            scratch_.path(),
            [this, &planned](std::string_view step) { report(planned, step); }};
  }

  Job job_for(const PlannedCell& planned, const UnitModel& unit) const {
    Job job;
    job.backend = unit.backend;
    job.unit = make_unit_request(options_.platform, unit, scratch_.path().string());
    job.workload = planned.workload->name;
    job.seed = options_.seed;
    if (options_.images) job.images = std::filesystem::absolute(*options_.images).string();
    job.reference = (scratch_.path() / (job.workload + ".reference")).string();
    job.sampling = sampling_options(options_);
    return job;
  }

  /// Computes the workload's reference unless that was done (or failed) for another unit. Returns
  /// what went wrong, "" if nothing did, or nothing if stopped.
  std::optional<std::string> reference(const CellRequest& request) {
    const auto known = references_.find(request.workload.name);
    if (known != references_.end()) return known->second;
    request.on_step("reference");
    Job job = request.job;
    job.kind = JobKind::kReference;
    const auto result = runner_.run(job);
    if (!result) return std::nullopt;
    return references_[request.workload.name] = result->error;
  }

  void report(const PlannedCell& cell, std::string_view step) const {
    if (!sink_.progress) return;
    const auto total = static_cast<int>(plan_.cells.size());
    const Nanos spent = elapsed();
    const Nanos per_cell =
        summary_.cells > 0 ? cells_took_ / summary_.cells : plan_.estimate / total;
    const Nanos in_this_cell = spent - cells_took_;
    const Nanos left = per_cell * (total - summary_.cells) - in_this_cell;
    sink_.progress({cell.workload->name, cell.unit, std::string(step), summary_.cells + 1, total,
                    spent, std::max(left, Nanos(0))});
  }

  void count(const CellRecord& record) {
    ++summary_.cells;
    cells_took_ = elapsed();
    std::map<std::string, std::vector<std::string>>
        invalid;  // reasons -> the phases that have them
    for (const PhaseRecord& row : record.phases) {
      ++(row.reasons.empty() ? summary_.rows_valid : summary_.rows_invalid);
      if (row.reasons.empty()) continue;
      auto& phases = invalid[join(row.reasons, ", ")];
      const std::string phase(to_string(row.phase));
      if (std::ranges::find(phases, phase) == phases.end()) phases.push_back(phase);
    }
    if (!sink_.warning) return;
    for (const auto& [reasons, phases] : invalid) {
      const bool wrong = reasons.find("wrong_output") != std::string::npos;
      sink_.warning(fmt::format("{} on {}: not valid ({}): {}{}", record.workload, record.unit,
                                join(phases, ", "), reasons,
                                wrong ? "; " + record.verification : ""));
    }
  }

  const CampaignOptions& options_;
  const CampaignPlan& plan_;
  const ProgressSink& sink_;
  JobRunner runner_;
  ScratchFolder scratch_;
  MachineClock clock_;
  Nanos start_ = clock_.now();
  HostCounters counters_ = read_host_counters({});
  Nanos cells_took_{0};  ///< When the last cell was done.
  std::map<std::string, std::string> references_;
  std::map<std::string, std::vector<PeakRecord>> peaks_;  ///< By unit.
  CampaignSummary summary_;
};

}  // namespace

CampaignSummary run_campaign(const CampaignOptions& options, const CampaignPlan& plan,
                             const ProgressSink& sink) {
  return Campaign(options, plan, sink).run();
}

}  // namespace pirt
