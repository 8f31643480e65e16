// EDF, earliest deadline first: of the ready tasks the one whose deadline is next, on the unit that
// is expected to end it first. While that unit has enough to be busy the task is held, so that a
// more urgent one can still go before it. A running task is not interrupted. All tasks of a firing
// have the firing's deadline; those without one come last, in the order in which they became ready.
//
// Source: Liu, Layland: Scheduling Algorithms for Multiprogramming in a Hard-Real-Time Environment,
// JACM 20(1), 1973; the choice of the unit is this project's.
#include "scheduler/policies/completion_estimate.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

class EdfPolicy final : public CompletionEstimate {
 public:
  using CompletionEstimate::CompletionEstimate;

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const auto best = best_unit(task, units);
    if (!best) return Placement::hold_for(0);
    if (!has_room(task, *best, units)) return Placement::hold();
    return Placement::on(*best);
  }

  Nanos rank(const Task& task) override { return task.deadline.value_or(Nanos::max()); }
};

}  // namespace

constinit const PolicyInfo policy::edf = {
    .name = "edf",
    .description =
        "Earliest deadline first, each task on the unit that is expected to end it first",
    .make = make_policy<EdfPolicy>,
};

}  // namespace pirt
