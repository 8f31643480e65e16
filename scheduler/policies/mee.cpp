// MEE, minimum energy execution: the unit that takes the fewest joules for the workload, whatever
// its load. Ties: the first unit. A unit whose joules nobody knows comes after all whose are known.
#include <limits>

#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

class MeePolicy final : public Baseline {
 public:
  using Baseline::Baseline;

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const auto joules = [&](UnitId unit) {
      return costs_[task.workload][unit]->energy_j.value_or(
          std::numeric_limits<double>::infinity());
    };
    return on_or_hold(first_best(takers(task, units.up),
                                 [&](UnitId a, UnitId b) { return joules(a) < joules(b); }));
  }
};

}  // namespace

constinit const PolicyInfo policy::mee = {
    .name = "mee",
    .description = "Baseline, minimum energy execution: the unit that takes the fewest joules",
    .make = make_policy<MeePolicy>,
    .without_joules = "takes such a unit where no other can serve",
};

}  // namespace pirt
