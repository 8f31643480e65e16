// What the baselines have in common: they use any local unit that may serve a task, and know
// servers and costs; weights play no part.
#pragma once

#include <optional>
#include <vector>

#include "scheduler/policies/policy.h"
#include "scheduler/policies/unit_order.h"

namespace pirt {

class Baseline : public Policy {
 public:
  explicit Baseline(const PolicySetup& setup) : Baseline(setup, local_units(setup.roles)) {}

  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    return task.eligible & up & usable_;
  }
  static Placement on_or_hold(std::optional<UnitId> unit) {
    return unit ? Placement::on(*unit) : Placement::hold_for(0);
  }

 protected:
  /// @param usable  The units that it may ever use.
  Baseline(const PolicySetup& setup, UnitMask usable)
      : servers_(setup.servers), costs_(setup.costs), usable_(usable) {}

  const std::vector<int> servers_;  ///< By unit.
  const CostTable costs_;

 private:
  UnitMask usable_;
};

}  // namespace pirt
