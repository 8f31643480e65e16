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
    std::optional<UnitId> best;
    const auto& costs = costs_[task.workload];
    for (const UnitId unit : order()) {
      if (!contains(takers(task, units.up), unit)) continue;
      if (!best || costs[unit]->energy_j < costs[*best]->energy_j) best = unit;
    }
    return best ? Placement::on(*best) : Placement::hold();
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
