#include "characterize/campaign/campaign.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <map>
#include <memory>
#include <set>

#include "characterize/campaign/campaign_estimate.h"
#include "characterize/campaign/campaign_meters.h"
#include "characterize/campaign/campaign_resume.h"
#include "characterize/campaign/cell.h"
#include "characterize/campaign/precision_plan.h"
#include "characterize/campaign/run_facts.h"
#include "characterize/platform/unit_request.h"
#include "characterize/profile/own_rows.h"
#include "characterize/profile/profile.h"
#include "characterize/profile/roofline.h"
#include "characterize/profile/store/database_format.h"
#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/writer.h"
#include "characterize/worker/job_runner.h"
#include "characterize/worker/measure.h"
#include "characterize/worker/peaks.h"
#include "characterize/worker/scratch.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/device_choice.h"
#include "workloads/model/own_operation.h"

namespace pirt {
namespace {

Environment run_environment(const CampaignOptions& options, const CampaignPlan& plan) {
  const auto images = options.images ? images_from(*options.images, options.images_topic)
                                     : generated_images(options.seed);
  Environment facts = run_facts(options.platform, *images);
  facts.insert(plan.facts.begin(), plan.facts.end());
  if (!options.resumed) facts.merge(idle_facts(plan));  // which takes long, and the run has
  facts["mode"] = options.quick ? "quick" : "full";
  facts["precision"] = fmt::format("{}", options.precision);
  for (const PlannedCell& cell : plan.cells) facts.merge(own_facts(*cell.workload));
  if (!options.filter.empty()) facts["filter"] = options.filter;
  if (!options.command.empty()) facts["command"] = options.command;
  return facts;
}

/// One part in so many of the time is kept for times of units at most.
constexpr int kMostReserved = 8;
/// Of a set-up that a cell did not come to.
constexpr std::string_view kMissing = "no_samples";

/// One cell of a running campaign.
struct Cell {
  const PlannedCell* planned = nullptr;
  CellRequest request;
  std::unique_ptr<CellMeasurement> measurement;
  Nanos last_visit{0};  ///< What it took.
  bool stored = false;
};

/// Fisher and Yates.
template <typename T>
void shuffle(std::vector<T>& items, std::uint64_t seed) {
  Random random(seed);
  for (std::size_t i = items.size(); i > 1; --i) std::swap(items[i - 1], items[random.below(i)]);
}

std::vector<PeakRecord> peaks_of(const std::string& unit, const std::vector<PeakRow>& rows) {
  std::vector<PeakRecord> records;
  for (const PeakRow& row : rows) {
    if (row.unit != unit) continue;
    records.push_back(
        {row.unit, row.kind, row.per_second, row.variant, row.provenance, row.reasons, row.doubts});
  }
  return records;
}

class Campaign {
 public:
  Campaign(const CampaignOptions& options, const CampaignPlan& plan, const ProgressSink& sink)
      : options_(options),
        plan_(plan),
        sink_(sink),
        writer_(options.database, waiting(options, sink)),
        runner_(options.program, options.job_limit, options.stop,
                [this] { return !is_first_visit_ && elapsed() >= end_of_part(); }) {}

  CampaignSummary run() {
    begin();
    visit_all_once();
    measure_peaks_of_units();
    measure_in_rounds();
    store_begun();
    measure_unit_times();
    judge_peaks();
    end();
    return summary_;
  }

 private:
  static FileWait waiting(const CampaignOptions& options, const ProgressSink& sink) {
    FileWait waiting;
    waiting.longest.reset();
    waiting.stop = options.stop;
    waiting.notice = sink.waiting;
    return waiting;
  }

  [[nodiscard]] Nanos elapsed() const { return clock_.now() - start_; }
  [[nodiscard]] bool stopped() const { return options_.stop != nullptr && options_.stop->load(); }
  /// Of what is being measured.
  [[nodiscard]] Nanos end_of_part() const {
    return measures_cells_ ? end_of_cells() : plan_.max_time;
  }
  /// Whether the time for it is over, or somebody stopped the run.
  [[nodiscard]] bool over() {
    summary_.interrupted = summary_.interrupted || stopped();
    return summary_.interrupted || elapsed() >= end_of_part();
  }

  void begin() {
    if (options_.resumed) writer_.resume_run(*options_.resumed);
    const Environment facts = run_environment(options_, plan_);
    if (options_.resumed) {
      check_identity(options_.resumed->run, facts);
      summary_.run_id = options_.resumed->run.run_id;
      for (const UnitRecord& unit : plan_.units) {
        peaks_[unit.unit] = peaks_of(unit.unit, options_.resumed->peaks);
      }
    } else {
      summary_.run_id = writer_.begin_run({utc_now(), options_.platform.name, options_.seed, facts,
                                           plan_.units, stored_plan(options_, plan_)});
    }
    if (sink_.begun) sink_.begun(summary_.run_id);
    make_cells();
    if (options_.resumed) replay(options_.resumed->visits);
  }

  void end() {
    summary_.elapsed = elapsed();
    Environment at_end = {{std::string(kSpent), fmt::format("{:.6f}", to_s(summary_.elapsed))}};
    at_end.merge(awake_facts(plan_, awake_w_));
    if (!summary_.interrupted) {
      at_end.merge(end_environment(counters_, read_host_counters({})));
    }
    if (summary_.complete()) {
      writer_.finish_run(summary_.run_id, utc_now(), at_end);
    } else {
      writer_.write_facts(summary_.run_id, at_end);
    }
  }

  [[nodiscard]] std::size_t index_of(const std::string& unit) const {
    const auto found = std::ranges::find(plan_.units, unit, &UnitRecord::unit);
    return static_cast<std::size_t>(found - plan_.units.begin());
  }

  /// Figures of another device are none of this run's.
  void check_device(const std::string& unit, const JobResult& result) const {
    if (!result.device) return;
    const std::string other = other_device(plan_.devices.at(index_of(unit)), *result.device);
    if (other.empty()) return;
    throw_environment(fmt::format(
        "unit {} has {} since run {} began; what was measured before is kept: put it back and go "
        "on with --resume, or start a new run",
        unit, other, summary_.run_id));
  }

  /// The limits of each unit.
  void measure_peaks_of_units() {
    for (const UnitRecord& unit : plan_.units) {
      if (summary_.interrupted) return;
      measure_peaks_of(unit.unit);
      if (!summary_.interrupted && peaks_[unit.unit].empty()) {
        summary_.peaks_left_out.push_back(unit.unit);
      }
    }
  }

  /// Stores the faster of what is known and what is measured now. A worker that fails leaves rows
  /// that say so.
  void measure_peaks_of(const std::string& name) {
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
      summary_.interrupted = stopped();
      return;
    }
    check_device(name, *result);
    auto& known = peaks_[name];
    known =
        faster_peaks(known, peak_records(name, result->peaks, result->error, result->provenance));
    writer_.write_peaks(summary_.run_id, known);
  }

  /// A cell above its roof shows that a peak was measured too low, in a busy spell perhaps: it is
  /// measured once more, and if it is still exceeded, it is stored as not valid.
  void judge_peaks() {
    const bool any = summary_.cells + summary_.cells_begun > 0 ||
                     (options_.resumed && !options_.resumed->done.empty());
    if (summary_.interrupted || !any) return;
    const auto exceeded = [&] {
      const RunRange own{summary_.run_id, summary_.run_id};
      return exceeded_peaks(rooflines(load_profile(options_.database, options_.platform.name, own)),
                            summary_.run_id);
    };
    std::set<std::string> units;
    for (const PeakRow& peak : exceeded()) units.insert(peak.unit);
    if (units.empty()) return;
    for (const std::string& unit : units) {
      if (!summary_.interrupted) measure_peaks_of(unit);
    }
    for (const PeakRow& peak : exceeded()) {
      writer_.write_peaks(summary_.run_id, peaks_of(peak.unit, {peak}));
      if (!sink_.warning) continue;
      sink_.warning(fmt::format("{}: the {} peak is not valid: {}", peak.unit, to_string(peak.kind),
                                join(peak.reasons, ", ")));
    }
  }

  /// Those that the mix needs before the others, also where meters are read.
  void make_cells() {
    cells_.reserve(plan_.cells.size());
    for (const bool first : {true, false}) {
      for (const PlannedCell& planned : plan_.cells) {
        if (planned.first != first) continue;
        Cell cell{&planned, request_for(planned), nullptr, {}, false};
        cell.measurement = std::make_unique<CellMeasurement>(cell.request, runner_);
        cells_.push_back(std::move(cell));
      }
    }
  }

  /// What an interrupted campaign found, as if it had just been found.
  void replay(const std::vector<std::pair<CellName, VisitRecord>>& visits) {
    for (const auto& [name, visit] : visits) {
      const auto cell = std::ranges::find_if(cells_, [&of = name](const Cell& c) {
        return c.planned->workload->name == of.workload && c.planned->unit == of.unit;
      });
      if (cell != cells_.end()) cell->measurement->add(visit.setup, last_record(visit.record));
    }
  }

  /// What is measured at the end is measured within the time, too: not more than a part of it,
  /// where there is little.
  [[nodiscard]] Nanos end_of_cells() const {
    Nanos reserved{0};
    for (const PlannedUnitTime& each : plan_.unit_times) reserved += each.part.expected;
    return plan_.max_time - std::min(reserved, plan_.max_time / kMostReserved);
  }

  /// Those that the mix needs first: with one process each a robot can be scheduled.
  void visit_all_once() {
    std::vector<Cell*> first, others;
    for (Cell& cell : cells_) {
      if (cell.measurement->processes() == 0) {
        (cell.planned->first ? first : others).push_back(&cell);
      }
    }
    const std::uint64_t seed = derive_seed(options_.seed, "round 0");
    shuffle(first, seed);
    shuffle(others, first.empty() ? seed : derive_seed(seed, "others"));
    first.insert(first.end(), others.begin(), others.end());
    visit_each(first);
  }

  /// @return False if the time is over, or somebody stopped it.
  bool visit_each(const std::vector<Cell*>& cells) {
    return std::ranges::all_of(cells, [this](Cell* cell) { return visit(*cell); });
  }

  void measure_in_rounds() {
    for (int round = 1; !over(); ++round) {
      const std::vector<Cell*> due = cells_of_round(round);
      if (due.empty() || !visit_each(due)) return;
    }
  }

  /// Every cell that needs a process, in an order of the round's own; after them those that get one
  /// for their precision. What is complete is stored.
  std::vector<Cell*> cells_of_round(int round) {
    std::vector<Cell*> needing, wanting;
    for (Cell& cell : cells_) {
      if (cell.stored) continue;
      const auto next = cell.measurement->next();
      if (next && (next->needed || !precision_is_over())) {
        (next->needed ? needing : wanting).push_back(&cell);
      } else if (!complete(cell)) {
        return {};
      }
    }
    const std::uint64_t seed = derive_seed(options_.seed, fmt::format("round {}", round));
    auto chosen = nearest_to_precision(wanting);
    shuffle(needing, seed);
    shuffle(chosen, derive_seed(seed, "for precision"));
    needing.insert(needing.end(), chosen.begin(), chosen.end());
    return needing;
  }

  [[nodiscard]] std::vector<Cell*> nearest_to_precision(const std::vector<Cell*>& wanting) const {
    std::vector<std::optional<Nanos>> needed;
    for (const Cell* cell : wanting) {
      const auto visits = cell->measurement->visits_to_precision();
      needed.push_back(visits ? std::optional(*visits * cell->last_visit) : std::nullopt);
    }
    std::vector<Cell*> chosen;
    for (const std::size_t i : within_reach(needed, end_of_precision() - elapsed())) {
      chosen.push_back(wanting[i]);
    }
    return chosen;
  }

  /// The meters are read after it, within the time.
  [[nodiscard]] Nanos end_of_precision() const {
    Nanos metering{0};
    for (const Cell& cell : cells_) {
      if (!cell.stored) metering += metering_time(plan_, cell.planned->unit);
    }
    return std::min(plan_.precision_time, end_of_cells() - metering);
  }
  [[nodiscard]] bool precision_is_over() const { return elapsed() >= end_of_precision(); }

  /// @return False if the time is over, or somebody stopped it.
  bool visit(Cell& cell) {
    if (over()) return false;
    const auto next = cell.measurement->next();
    if (!next->needed && precision_is_over()) return true;
    is_first_visit_ = summary_.processes == 0;
    const auto failure = reference(cell.request);
    if (!failure) return false;
    if (!failure->empty()) {
      is_first_visit_ = false;
      // What was measured before an interruption is not lost by what fails after it.
      finish(cell, cell.measurement->processes() > 0 ? cell.measurement->record()
                                                     : failed_cell(cell.request, *failure));
      return true;
    }
    const Nanos begin = clock_.now();
    auto result = cell.measurement->visit();
    is_first_visit_ = false;
    if (!result) return false;
    check_device(cell.planned->unit, *result);
    cell.last_visit = clock_.now() - begin;
    writer_.write_visit(
        summary_.run_id, name_of(cell),
        {cell.measurement->visits(), next->setup, to_record(*result) + "\n", elapsed()});
    cell.measurement->add(next->setup, std::move(*result));
    ++summary_.processes;
    return cell.measurement->next() || complete(cell);
  }

  [[nodiscard]] static CellName name_of(const Cell& cell) {
    return {cell.planned->workload->name, cell.planned->unit};
  }

  /// Reads the energy meters first. @return False if the time is over, or somebody stopped it; then
  /// nothing was stored.
  bool complete(Cell& cell) {
    if (cell.measurement->metering_due()) {
      if (!cell.measurement->meter()) return false;
      check_device(cell.planned->unit, cell.measurement->metered().value());
    }
    if (const auto idle_w = cell.measurement->idle_w()) {
      awake_w_[cell.planned->unit].push_back(*idle_w);
    }
    store(cell);
    return true;
  }

  void store(Cell& cell) { finish(cell, cell.measurement->record()); }

  void finish(Cell& cell, const CellRecord& record) {
    writer_.write_cell(summary_.run_id, record);
    if (sink_.stored) sink_.stored(name_of(cell));
    ++summary_.cells;
    count(record);
    const auto reached = cell.measurement->reached();
    summary_.within_precision += reached && *reached <= options_.precision ? 1 : 0;
    cell.stored = true;
    cell.measurement.reset();  // and with it the kernel cache
  }

  /// Cells whose valid rows need no more are done, and without a signal those that were only to be
  /// sampled again; of others what there is can be seen, and gone on with.
  void store_begun() {
    summary_.interrupted = summary_.interrupted || stopped();
    for (Cell& cell : cells_) {
      if (cell.stored) continue;
      const bool once = cell.measurement->believe_first_failure();
      const bool any = cell.measurement->processes() > 0;
      const bool done = !once && (cell.measurement->needed_visits() == 0 ||
                                  (!summary_.interrupted && cell.measurement->has_set_ups()));
      if (any && done && !cell.measurement->metering_due()) {
        store(cell);
      } else if (any) {
        const CellRecord record = cell.measurement->record();
        writer_.write_interrupted_cell(summary_.run_id, record);
        ++summary_.cells_begun;
        count(record, kMissing);
      } else if (!summary_.interrupted) {
        summary_.unmeasured.push_back(name_of(cell));
      }
    }
  }

  void measure_unit_times() {
    measures_cells_ = false;
    UnitTimeSampler sampler(options_.precision, options_.stop);
    for (const PlannedUnitTime& each : plan_.unit_times) {
      if (over()) {
        summary_.unit_times_left_out += summary_.interrupted ? 0 : 1;
        continue;
      }
      if (sink_.progress) {
        sink_.progress({std::string(to_string(each.part.phase)), each.unit, "beside its calls",
                        summary_.cells, static_cast<int>(plan_.cells.size()), elapsed(),
                        std::max(Nanos(0), plan_.max_time - elapsed())});
      }
      const auto record = sampler.measure(each);
      if (record) writer_.write_unit_times(summary_.run_id, {&*record, 1});
      summary_.interrupted = summary_.interrupted || stopped();
    }
  }

  CellRequest request_for(const PlannedCell& planned) {
    const UnitModel& unit = options_.platform.unit(planned.unit);
    return {options_.platform,
            unit,
            find_backend(unit.backend),
            *planned.workload,
            job_for(planned, unit),
            plan_.provenances.at(index_of(planned.unit)),
            needed_processes(options_) / 2,
            options_.precision,
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
    job.images_topic = options_.images_topic;
    job.reference = (scratch_.path() / (job.workload + ".reference")).string();
    job.inputs = (scratch_.path() / (job.workload + ".inputs")).string();
    job.sampling = sampling_options(options_);
    if (const OwnOperation* const own = own_operation(*planned.workload)) {
      job.sampling.limit = std::min(job.sampling.limit, own->limit / 2);
    }
    const auto meters = plan_.meters.find(unit.name);
    if (meters != plan_.meters.end()) job.metering = meters->second;
    if (options_.interference || !options_.quick) {
      for (const UnitModel* other : options_.platform.neighbours(unit)) {
        // On one core they would take turns.
        const bool apart = !unit.shares_cores && !other->shares_cores;
        if (apart && !other->cores.empty()) job.neighbours.push_back(other->cores);
      }
    }
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
    auto result = runner_.run(job);
    if (result && !result->error.empty()) result = runner_.run(job);  // as a process of a cell
    if (!result) return std::nullopt;
    // Of somebody else's it may be what this unit computes: another one may do better.
    if (!result->error.empty() && own_operation(request.workload) != nullptr) return result->error;
    return references_[request.workload.name] = result->error;
  }

  void report(const PlannedCell& cell, std::string_view step) const {
    if (!sink_.progress) return;
    sink_.progress({cell.workload->name, cell.unit, std::string(step), summary_.cells,
                    static_cast<int>(plan_.cells.size()), elapsed(), estimated_left()});
  }

  /// Visits to come at what those that were done took on average, or, before the first round is
  /// over, at what the plan supposes.
  [[nodiscard]] Nanos estimated_left() const {
    std::int64_t needed = 0;
    std::int64_t expected = 0;
    for (const Cell& cell : cells_) {
      if (cell.stored) continue;
      needed += cell.measurement->needed_visits();
      expected += cell.measurement->expected_visits();
    }
    const auto all = static_cast<std::int64_t>(cells_.size());
    if (summary_.processes < all) {
      return std::max(Nanos(0), plan_.estimate.total - (elapsed() - plan_.spent));
    }
    const Nanos each = (elapsed() - plan_.spent) / summary_.processes;
    return std::min(
        std::max(needed * each, std::min(expected * each, plan_.precision_time - elapsed())),
        std::max(Nanos(0), plan_.max_time - elapsed()));
  }

  /// @param expected  A reason that is no news.
  void count(const CellRecord& record, std::string_view expected = {}) {
    std::map<std::string, std::vector<std::string>>
        invalid;  // reasons -> the phases that have them
    for (const PhaseRecord& row : record.phases) {
      const bool unknown = !row.reasons.empty() && row.reasons.front().starts_with(kUnknownPhase);
      if (unknown) continue;
      ++(is_valid(row)  ? summary_.rows_valid
         : is_used(row) ? summary_.rows_doubted
                        : summary_.rows_invalid);
      if (is_used(row) || row.reasons == std::vector{std::string(expected)}) continue;
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
  ScratchFolder scratch_;  // before the writer: without it no database is made
  ProfileWriter writer_;
  MachineClock clock_;
  Nanos start_ = clock_.now() - plan_.spent;
  bool measures_cells_ = true;  ///< Otherwise what comes behind them.
  /// Its process begins also where its reference took the time that was left: without one there is
  /// no answer.
  bool is_first_visit_ = false;
  HostCounters counters_ = read_host_counters({});
  JobRunner runner_;  // asks those before it whether the time is over
  std::vector<Cell> cells_;
  std::map<std::string, std::string> references_;
  std::map<std::string, std::vector<PeakRecord>> peaks_;  ///< By unit.
  std::map<std::string, std::vector<double>> awake_w_;    ///< By unit: idle_w() of its cells.
  CampaignSummary summary_;
};

}  // namespace

CampaignSummary run_campaign(const CampaignOptions& options, const CampaignPlan& plan,
                             const ProgressSink& sink) {
  return Campaign(options, plan, sink).run();
}

}  // namespace pirt
