// What a mode would come to: a short run of the mix in virtual time.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "scheduler/planner/budget_plan.h"
#include "scheduler/policies/setup.h"
#include "scheduler/services/scenario.h"

namespace pirt {

/// What is chosen beforehand.
struct BudgetChoice {
  BudgetPlan plan;
  std::vector<int> in_flight;  ///< By pipeline; 0 for open loops.
  friend bool operator==(const BudgetChoice&, const BudgetChoice&) = default;
};

struct TrialResult {
  std::int64_t late = 0;    ///< Firings of real-time pipelines, dropped ones too.
  std::int64_t misses = 0;  ///< Of all deadlines; firings that were dropped, too.
  double rate_per_ms = 0;   ///< Completed tasks.
  double energy_mj = 0;     ///< A completed task; 0 where nobody knows some unit's.
  double latency_ms = 0;    ///< Mean of a task, dispatch to completion.
};

/// Runs so much of the mix that about so many tasks complete, with a seed of its own and the mix's
/// jitter.
class Trial {
 public:
  /// @param setup   Of mode budget; must outlive it.
  /// @param slices  Calls are suspended where their workloads say so, if the setup has that.
  Trial(const ModeSetup& setup, double tasks, bool slices = true);

  [[nodiscard]] TrialResult run(const BudgetChoice& choice);
  /// @param in_flight  By pipeline; 0 for open loops.
  [[nodiscard]] TrialResult run(std::unique_ptr<Policy> policy, std::vector<int> in_flight);
  /// Tasks that all runs so far have submitted: what they have taken.
  [[nodiscard]] std::int64_t tasks_run() const { return tasks_run_; }

 private:
  const ModeSetup& setup_;
  Mix mix_;
  std::optional<Scenario> scenario_;
  bool joules_known_;
  std::int64_t tasks_run_ = 0;
};

}  // namespace pirt
