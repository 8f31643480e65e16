#include "characterize/tune/tune.h"

#include <fmt/core.h>

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "characterize/machine/build_info.h"
#include "characterize/platform/selection.h"
#include "characterize/platform/unit_request.h"
#include "characterize/statistics/statistics.h"
#include "characterize/worker/job_runner.h"
#include "characterize/worker/scratch.h"
#include "workloads/backends/opencl/tuning/tuning_file.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

using opencl::ParameterInfo;
using opencl::TunedDevice;
using opencl::Tuning;
using opencl::TuningFile;

constexpr const char* kBackend = "opencl";
constexpr const char* kVariable = "PIRT_TUNING";

std::vector<const UnitModel*> opencl_units(const TuneOptions& options) {
  std::vector<const UnitModel*> units;
  for (const UnitModel* unit : choose_units(options.platform, options.units)) {
    if (unit->backend == kBackend) {
      units.push_back(unit);
    } else if (!options.units.empty()) {
      throw_bad_input(
          fmt::format("unit '{}' has backend {}, which has no parameters to tune; only opencl has",
                      unit->name, unit->backend));
    }
  }
  if (units.empty()) {
    throw_bad_input(fmt::format(
        "platform '{}' has no unit with backend opencl to tune; try --platform host-opencl",
        options.platform.name));
  }
  return units;
}

bool is_sequence(const Workload& workload) { return workload.kernel == "sequence"; }

/// A local size is of all kernels: one workload of each kernel, the one with the least data, judges
/// it.
std::vector<std::string> one_of_each_kernel(const std::vector<const Workload*>& workloads) {
  std::map<std::string, const Workload*> smallest;
  for (const Workload* workload : workloads) {
    if (is_sequence(*workload)) continue;
    const auto [it, added] = smallest.emplace(workload->kernel, workload);
    if (!added && workload->bytes() < it->second->bytes()) it->second = workload;
  }
  std::vector<std::string> names;
  for (const auto& [kernel, workload] : smallest) names.push_back(workload->name);
  return names;
}

std::set<std::string> kernels_of(std::span<const Workload* const> workloads) {
  std::set<std::string> kernels;
  for (const Workload* workload : workloads) {
    if (!is_sequence(*workload)) kernels.insert(workload->kernel);
  }
  return kernels;
}

/// Plain ones: what a variant changes is not the kernels' doing. Those that the backend has.
std::vector<const Workload*> tunable_workloads(const std::string& filter) {
  auto workloads = choose_workloads(filter);
  std::erase_if(workloads, [](const Workload* workload) {
    return !workload->variant.empty() || !find_backend(kBackend).supports(*workload).ok;
  });
  return workloads;
}

void add_steps(const std::vector<const Workload*>& workloads, TuneUnit& unit) {
  for (const ParameterInfo& info : opencl::parameter_table()) {
    if (info.range(unit.device.is_cpu).candidates.size() < 2) continue;
    TuneStep step{.parameter = &info, .workloads = {}};
    if (info.kernels.empty()) {
      if (kernels_of(workloads) != kernels_of(tunable_workloads(""))) {
        unit.remarks.push_back(
            fmt::format("{} is the same for all kernels, and --filter leaves some of them out: it "
                        "stays as it is",
                        info.name));
        continue;
      }
      step.workloads = one_of_each_kernel(workloads);
    } else {
      for (const Workload* workload : workloads) {
        if (info.concerns(workload->kernel)) step.workloads.push_back(workload->name);
      }
    }
    if (!step.workloads.empty()) unit.steps.push_back(std::move(step));
  }
}

/// Measures candidates of one unit in worker processes.
class UnitMeasurement {
 public:
  UnitMeasurement(const TuneOptions& options, const TuneUnit& unit)
      : runner_(options.program, options.job_limit, options.stop), device_(unit.device) {
    const auto cache = scratch_.path() / "kernels";
    std::filesystem::create_directory(cache);
    environment_ = find_backend(kBackend).kernel_cache_environment(cache.string());
    environment_.emplace_back(kVariable, candidate_file().string());
    job_.backend = kBackend;
    job_.unit = make_unit_request(options.platform, *unit.unit);
    job_.seed = options.seed;
    job_.sampling.warm_up = std::chrono::milliseconds(10);
    job_.sampling.slice = std::chrono::milliseconds(60);
    job_.sampling.min_samples = 5;
  }

  std::optional<TuneSample> measure(const Tuning& tuning, const std::string& workload) {
    job_.workload = workload;
    job_.reference = (scratch_.path() / (workload + ".reference")).string();
    if (!std::filesystem::exists(job_.reference)) {
      const auto made = run(JobKind::kReference);
      if (!made) return std::nullopt;
      if (!made->error.empty()) return failed(made->error);
    }
    write_file(candidate_file(), opencl::tuning_text({.devices = {entry(tuning)}}));
    const auto result = run(JobKind::kSample);
    if (!result) return std::nullopt;
    return judge(*result, tuning);
  }

 private:
  [[nodiscard]] std::filesystem::path candidate_file() const {
    return scratch_.path() / "candidate.json";
  }

  [[nodiscard]] TunedDevice entry(const Tuning& tuning) const {
    return {.device = device_.name,
            .platform = device_.platform,
            .version = device_.version,
            .pirt_version = std::string(build_info().version),
            .date = "",
            .tuning = tuning};
  }

  [[nodiscard]] std::optional<JobResult> run(JobKind kind) {
    job_.kind = kind;
    return runner_.run(job_, environment_);
  }

  static TuneSample failed(std::string reason) {
    return {.status = TuneSample::Status::kFailed, .reason = std::move(reason)};
  }

  static TuneSample judge(const JobResult& result, const Tuning& tuning) {
    if (!result.error.empty()) return failed(result.error);
    if (result.wrong_output) {
      return {.status = TuneSample::Status::kWrong, .reason = result.verification};
    }
    if (!result.device || result.device->tuning != tuning.describe()) {
      return failed(fmt::format("the device was opened with {}",
                                result.device ? result.device->tuning : "nothing"));
    }
    const auto time = time_of(result);
    if (!time) return failed("it has no times");
    return {.time = *time};
  }

  ScratchFolder scratch_;
  JobRunner runner_;
  DeviceInfo device_;
  std::vector<std::pair<std::string, std::string>> environment_;
  Job job_;
};

}  // namespace

std::optional<Nanos> time_of(const JobResult& result) {
  const auto samples_of = [&result](Phase phase) {
    const auto found = std::ranges::find(result.phases, phase, &PhaseSamples::phase);
    return found == result.phases.end() ? std::vector<Nanos>() : found->samples;
  };
  auto times = samples_of(Phase::kExecute);
  const auto launches = samples_of(Phase::kLaunch);
  if (launches.size() == times.size()) {
    std::ranges::transform(times, launches, times.begin(), std::plus<>());
  }
  if (times.empty() || median(times) <= Nanos{0}) return std::nullopt;
  return median(times);
}

TunePlan plan_tuning(const TuneOptions& options) {
  if (options.max_time.count() <= 0) throw_bad_input("--max-time is not above 0; try 15min");
  const auto workloads = tunable_workloads(options.filter);
  const auto units = opencl_units(options);
  const TuningFile stored = opencl::load_tuning(options.output);
  const JobRunner runner(options.program, options.job_limit, options.stop);
  TunePlan plan;
  for (const UnitModel* model : units) {
    // With its defaults: how the device is called does not depend on its parameters.
    const JobResult probed = probe_unit(runner, options.platform, *model, {{kVariable, "none"}});
    if (!probed.error.empty()) {
      if (!options.units.empty()) {
        throw_environment(fmt::format("unit '{}' is not available: {}", model->name, probed.error));
      }
      plan.skipped.push_back({model->name, "", probed.error});
      continue;
    }
    TuneUnit unit{.unit = model, .device = probed.device.value(), .steps = {}, .remarks = {}};
    const TunedDevice* entry = stored.find(unit.device);
    unit.start = entry != nullptr ? entry->tuning : Tuning(unit.device.is_cpu);
    add_steps(workloads, unit);
    const auto same = std::ranges::find_if(plan.units, [&](const TuneUnit& other) {
      return std::pair(other.device.name, other.device.version) ==
             std::pair(unit.device.name, unit.device.version);
    });
    if (same != plan.units.end()) {
      plan.skipped.push_back({model->name, "",
                              fmt::format("its device is that of unit {}, \"{}\"", same->unit->name,
                                          unit.device.name)});
    } else {
      plan.units.push_back(std::move(unit));
    }
  }
  if (plan.units.empty()) {
    std::vector<std::string> reasons;
    for (const Skip& skip : plan.skipped) reasons.push_back(skip.unit + ": " + skip.reason);
    throw_environment("nothing can be tuned: " + join(reasons, "; "));
  }
  if (std::ranges::all_of(plan.units, [](const TuneUnit& unit) { return unit.steps.empty(); })) {
    throw_bad_input(fmt::format(
        "--filter '{}' leaves no workload that a parameter could be judged by; see: pirt tune "
        "--dry-run",
        options.filter));
  }
  return plan;
}

std::int64_t expected_processes(const TuneUnit& unit, const TuneRules& rules) {
  std::size_t processes = unit.steps.size() < 2 ? 0 : 3 * unit.steps.size();  // the first look
  for (const TuneStep& step : unit.steps) {
    processes += step.parameter->range(unit.device.is_cpu).candidates.size() *
                 step.workloads.size() * static_cast<std::size_t>(rules.rounds);
  }
  return static_cast<std::int64_t>(processes);
}

TunedUnit tune_unit(const TuneOptions& options, const TuneUnit& unit,
                    const std::function<void(const std::string&)>& progress,
                    const std::function<bool()>& time_up) {
  UnitMeasurement measurement(options, unit);
  const TuneSearch search{
      .start = unit.start,
      .steps = unit.steps,
      .measure = [&](const Tuning& tuning,
                     const std::string& workload) { return measurement.measure(tuning, workload); },
      .seed = options.seed,
      .time_up = time_up,
      .progress = [&](const TuneStep&, const std::string& what) { progress(what); }};
  return {.unit = unit.unit->name,
          .device = unit.device,
          .outcome = search_tuning(search),
          .remarks = unit.remarks};
}

void store_tuning(const TuneOptions& options, const TunedUnit& tuned, const std::string& date) {
  TuningFile file = opencl::load_tuning(options.output);
  // Another search may have ended meanwhile.
  const TunedDevice* const stored = file.find(tuned.device);
  Tuning tuning = stored != nullptr ? stored->tuning : Tuning(tuned.device.is_cpu);
  for (const TuneFinding& finding : tuned.outcome.findings) {
    const auto parameter = finding.parameter->parameter;
    tuning.set(parameter, tuned.outcome.tuning[parameter]);
  }
  file.put({.device = tuned.device.name,
            .platform = tuned.device.platform,
            .version = tuned.device.version,
            .pirt_version = std::string(build_info().version),
            .date = date,
            .tuning = tuning});
  write_file(options.output, opencl::tuning_text(file));
}

void check_output(const std::filesystem::path& output) {
  const auto refuse = [](const std::string& why) {
    throw_bad_input(why + "; choose another place with --output");
  };
  std::error_code failed;
  if (output.has_parent_path()) std::filesystem::create_directories(output.parent_path(), failed);
  if (failed) refuse(fmt::format("cannot write '{}': {}", output.string(), failed.message()));
  try {
    check_writable(output);
  } catch (const Error& error) {
    refuse(error.what());
  }
}

}  // namespace pirt
