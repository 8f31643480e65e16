#include "scheduler/frontier.h"

#include <fmt/format.h>

#include <algorithm>

#include "workloads/base/error.h"

namespace pirt {
namespace {

constexpr int kRates = 6;     ///< Between the slowest and the fastest.
constexpr int kInFlight = 8;  ///< Frames, at most.

class Frontier {
 public:
  Frontier(const Platform& platform, const Profile* profile, const Mix& mix, ModeRuns& runs)
      : platform_(platform), profile_(profile), mix_(mix), runs_(runs) {}

  void add(ScheduleOptions options, Objective objective) {
    options.mode = "budget";
    options.objective = objective;
    RunRecord run = run_virtual(platform_, profile_, mix_, options);
    if (std::ranges::find(runs_.runs, run) == runs_.runs.end())
      runs_.runs.push_back(std::move(run));
  }

 private:
  const Platform& platform_;
  const Profile* profile_;
  const Mix& mix_;
  ModeRuns& runs_;
};

}  // namespace

ModeRuns run_frontier(const Platform& platform, const Profile* profile, const Mix& mix,
                      const std::vector<std::string>& modes, const ScheduleOptions& options) {
  ScheduleOptions plain = options;
  plain.objective.reset();
  plain.min_rate_per_ms.reset();
  ModeRuns runs = run_modes(platform, profile, mix, modes, plain.without_budget());
  Frontier frontier(platform, profile, mix, runs);
  for (const auto objective : {Objective::kRate, Objective::kLatency, Objective::kEnergy}) {
    frontier.add(plain, objective);
  }
  if (mix.open_loop()) return runs;
  const auto rate = [](const RunRecord& run) { return run.throughput_per_ms.value_or(0); };
  const double slowest = rate(*std::ranges::min_element(runs.runs, {}, rate));
  const double fastest = rate(*std::ranges::max_element(runs.runs, {}, rate));
  for (int i = 1; i <= kRates; ++i) {
    ScheduleOptions least = plain;
    least.min_rate_per_ms = slowest + (fastest - slowest) * i / (kRates + 1);
    frontier.add(least, Objective::kEnergy);
  }
  for (int frames = 1; frames <= kInFlight && !options.in_flight; ++frames) {
    ScheduleOptions few = plain;
    few.in_flight = frames;
    frontier.add(few, Objective::kRate);
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
