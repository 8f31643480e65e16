// OLB, opportunistic load balancing: the next idle unit, in the platform's order, whatever it takes
// there. A unit is idle while it has fewer tasks than servers; without one the task is held.
//
// Source: Armstrong, Hensgen, Kidd: The Relative Performance of Various Mapping Algorithms is
// Independent of Sizable Variances in Run-time Predictions, HCW 1998.
#include <bit>

#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {
namespace {

class OlbPolicy final : public Baseline {
 public:
  using Baseline::Baseline;

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const UnitMask usable = takers(task, units.up);
    for (UnitMask mask = usable; mask != 0; mask &= mask - 1) {
      const auto unit = static_cast<UnitId>(std::countr_zero(mask));
      if (units.load[unit] < servers_[unit]) return Placement::on(unit);
    }
    return Placement::hold_for(usable);
  }
};

}  // namespace

constinit const PolicyInfo policy::olb = {
    .name = "olb",
    .description = "Baseline, opportunistic load balancing: the next idle unit, whatever its speed",
    .make = make_policy<OlbPolicy>,
};

}  // namespace pirt
