// MEE, minimum energy execution: the unit that takes the fewest joules for the workload, whatever
// its load. Ties: the first unit.
#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

class MeePolicy final : public Baseline {
 public:
  explicit MeePolicy(const PolicySetup& setup) : Baseline(setup), costs_(setup.costs) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const auto& costs = costs_[task.workload];
    return on_or_hold(first_best(takers(task, units.up), [&](UnitId a, UnitId b) {
      return costs[a]->energy_j < costs[b]->energy_j;
    }));
  }

 private:
  CostTable costs_;
};

}  // namespace

constinit const PolicyInfo policy::mee = {
    .name = "mee",
    .description = "Baseline, minimum energy execution: the unit that takes the fewest joules",
    .make = make_policy<MeePolicy>,
};

}  // namespace pirt
