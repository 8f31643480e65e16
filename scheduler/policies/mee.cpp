// MEE, minimum energy execution: the unit that takes the fewest joules for the workload, whatever
// its load. Ties: the first unit. A unit whose joules nobody knows comes after all whose are known.
#include <limits>

#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

double joules(const CallCost& cost) {
  return cost.energy_j.value_or(std::numeric_limits<double>::infinity());
}

}  // namespace

constinit const PolicyInfo policy::mee = {
    .name = "mee",
    .description = "Baseline, minimum energy execution: the unit that takes the fewest joules",
    .make = make_policy<LeastOf<joules>>,
    .without_joules = "takes such a unit where no other can serve",
};

}  // namespace pirt
