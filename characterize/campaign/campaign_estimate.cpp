#include "characterize/campaign/campaign_estimate.h"

#include <fmt/core.h>

#include <algorithm>
#include <set>

#include "characterize/campaign/campaign_meters.h"
#include "characterize/campaign/validity.h"
#include "characterize/profile/profile.h"
#include "characterize/profile/store/reader.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

// Observed on a 2-core virtual machine over the 36 cells of platform host: starting a process,
// making its data and verifying twice take 0.25 s on average beside what the profile has. Without a
// profile: a process of platform host takes 0.55 s on average in quick mode, 0.65 s in full, and in
// full 9 further processes a cell reach 2 % in most cells.
constexpr Nanos kOverhead = std::chrono::milliseconds(250);
constexpr Nanos kQuickProcess = std::chrono::milliseconds(550);
constexpr Nanos kFullProcess = std::chrono::milliseconds(650);
constexpr int kFurtherProcesses = 9;
// Of one unit's peaks, and of the reference of a workload, there.
constexpr Nanos kPeaks = std::chrono::milliseconds(2'500);
constexpr Nanos kReference = std::chrono::milliseconds(400);

std::optional<Profile> former_profile(const CampaignOptions& options) {
  std::error_code failed;
  if (options.database.empty() || !std::filesystem::exists(options.database, failed)) {
    return std::nullopt;
  }
  try {
    return load_profile(options.database, options.platform.name);
  } catch (const Error&) {
    return std::nullopt;
  }
}

Nanos median_of(const Profile& profile, const PlannedCell& cell, Phase phase, State state) {
  const PhaseRow* row = profile.find(cell.workload->name, cell.unit, phase, state);
  return row != nullptr ? row->median.value_or(Nanos(0)) : Nanos(0);
}

struct CellTime {
  Nanos needed{0};
  Nanos further{0};
};

CellTime constants(const CampaignOptions& options) {
  const Nanos process = options.quick ? kQuickProcess : kFullProcess;
  return {needed_processes(options) * process, kFurtherProcesses * process};
}

CellTime from_profile(const CampaignOptions& options, const Profile& profile,
                      const PlannedCell& cell, const PhaseRow& call) {
  const SamplingOptions sampling = sampling_options(options);
  const auto set_up = [&](State state) {
    return median_of(profile, cell, Phase::kDeviceInit, state) +
           median_of(profile, cell, Phase::kPrepare, state);
  };
  const Nanos calls = std::max(sampling.warm_up, 2 * *call.median) +
                      std::max(sampling.slice, sampling.min_samples * *call.median);
  const Nanos warm = kOverhead + set_up(State::kWarm) + calls;
  const Nanos cold = kOverhead + set_up(State::kCold) + calls;
  const int needed = needed_processes(options);
  const auto further = std::max<std::int64_t>(0, call.processes - needed);
  return {needed / 2 * (cold + warm), further * warm};
}

/// Of cells, and how many processes each has.
std::map<std::pair<std::string, std::string>, int> done_before(const CampaignOptions& options) {
  std::map<std::pair<std::string, std::string>, int> done;
  if (!options.resumed) return done;
  for (const auto& [cell, visit] : options.resumed->visits) ++done[{cell.workload, cell.unit}];
  return done;
}

Nanos references_time(const CampaignPlan& plan) {
  std::set<const Workload*> workloads;
  for (const PlannedCell& cell : plan.cells) workloads.insert(cell.workload);
  return static_cast<std::int64_t>(workloads.size()) * kReference;
}

}  // namespace

Nanos time_beside_cells(const CampaignPlan& plan) {
  Nanos time = static_cast<std::int64_t>(plan.units.size()) * kPeaks + metering_time(plan);
  for (const PlannedUnitTime& each : plan.unit_times) time += each.part.expected;
  return time;
}

int needed_processes(const CampaignOptions& options) { return options.quick ? 4 : 10; }

SamplingOptions sampling_options(const CampaignOptions& options) {
  SamplingOptions sampling;
  sampling.condition_samples = kFewestSamples / needed_processes(options);
  sampling.cold_memory = options.interference || !options.quick;
  if (!options.quick) {
    sampling.condition_samples *= 5;
    sampling.warm_up = std::chrono::milliseconds(80);
    sampling.slice = std::chrono::milliseconds(250);
  }
  sampling.limit = options.job_limit / 2;  // the rest is for setting up and verifying
  return sampling;
}

Estimate estimate(const CampaignOptions& options, const CampaignPlan& plan) {
  const auto profile = former_profile(options);
  const auto done = done_before(options);
  const int all = needed_processes(options);
  Estimate result;
  result.needed = time_beside_cells(plan) + references_time(plan);
  Nanos further{0};
  int known = 0;
  for (const PlannedCell& cell : plan.cells) {
    const PhaseRow* call =
        profile ? profile->find(cell.workload->name, cell.unit, Phase::kCall) : nullptr;
    const bool usable = call != nullptr && call->median;
    const CellTime time =
        usable ? from_profile(options, *profile, cell, *call) : constants(options);
    known += usable ? 1 : 0;
    const auto before = done.find({cell.workload->name, cell.unit});
    const int left = before == done.end() ? all : std::max(0, all - before->second);
    result.needed += time.needed * left / all;
    further += time.further;
  }
  const Nanos most = plan.max_time - plan.spent;
  const Nanos with_precision = std::min(result.needed + further, plan.precision_time - plan.spent);
  result.total = std::min(std::max(result.needed, with_precision), most);
  result.source = known == 0 ? "figures of a 2-core virtual machine"
                             : fmt::format("the figures that {} has of {} of the cells",
                                           options.database.string(), known);
  return result;
}

}  // namespace pirt
