// What a budget would come to: a short run of the mix in virtual time.
#pragma once

#include <cstdint>
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
};

struct TrialResult {
  std::int64_t misses = 0;  ///< Of deadlines; firings that were dropped, too.
  double rate_per_ms = 0;   ///< Completed tasks.
  double energy_mj = 0;     ///< A completed task; 0 where nobody knows some unit's.
  double latency_ms = 0;    ///< Mean of a task, dispatch to completion.
};

/// Runs so much of the mix that about a thousand tasks complete, with a seed of its own.
class Trial {
 public:
  /// @param setup  Of mode budget; must outlive it.
  explicit Trial(const ModeSetup& setup);

  [[nodiscard]] TrialResult run(const BudgetChoice& choice);
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
