#include "scheduler/frontier.h"

#include <fmt/format.h>

#include <algorithm>

#include "workloads/base/error.h"

namespace pirt {
namespace {

constexpr int kRates = 6;     ///< Between the slowest and the fastest.
constexpr int kInFlight = 8;  ///< Frames, at most.

}  // namespace

ModeRuns run_frontier(const Platform& platform, const Profile* profile, const Mix& mix,
                      const std::vector<std::string>& modes, const ScheduleOptions& options) {
  ScheduleOptions plain = options;
  plain.min_rate_per_ms.reset();
  ModeRuns runs = run_modes(platform, profile, mix, modes, plain.without_budget());
  const auto add = [&](ScheduleOptions with, Objective objective) {
    with.mode = "budget";
    with.objective = objective;
    RunRecord run = run_virtual(platform, profile, mix, with);
    // Rates that nobody gave.
    std::erase_if(run.warnings, [](const auto& each) { return each.starts_with("--min-rate"); });
    if (std::ranges::find(runs.runs, run) == runs.runs.end()) runs.runs.push_back(std::move(run));
  };
  for (const auto objective : {Objective::kRate, Objective::kLatency, Objective::kEnergy}) {
    add(plain, objective);
  }
  if (mix.open_loop() || mix.fires_once()) return runs;
  const auto rate = [](const RunRecord& run) { return run.throughput_per_ms.value_or(0); };
  const double slowest = rate(*std::ranges::min_element(runs.runs, {}, rate));
  const double fastest = rate(*std::ranges::max_element(runs.runs, {}, rate));
  for (int i = 1; i <= kRates; ++i) {
    ScheduleOptions least = plain;
    least.min_rate_per_ms = slowest + (fastest - slowest) * i / (kRates + 1);
    add(least, Objective::kEnergy);
  }
  for (int frames = 1; frames <= kInFlight && !options.in_flight; ++frames) {
    ScheduleOptions few = plain;
    few.in_flight = frames;
    add(few, Objective::kRate);
  }
  return runs;
}

std::string goal_of(const RunRecord& run) {
  if (!run.objective) return run.mode;
  std::string goal = run.mode + ", " + *run.objective;
  if (run.min_rate_per_ms) goal += fmt::format(", at least {:.3g} tasks/ms", *run.min_rate_per_ms);
  if (run.in_flight) goal += fmt::format(", {} in flight", *run.in_flight);
  return goal;
}

}  // namespace pirt
