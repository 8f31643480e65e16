// What the baselines have in common: they use any local unit that may serve a task, weights play no
// part, and idle units are asked in the platform's order.
#pragma once

#include <vector>

#include "scheduler/policies/policy.h"
#include "scheduler/policies/unit_order.h"

namespace pirt {

class Baseline : public Policy {
 public:
  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    return task.eligible & up & usable_;
  }
  const std::vector<UnitId>& order() const override { return order_; }
  static Placement on_or_hold(std::optional<UnitId> unit) {
    return unit ? Placement::on(*unit) : Placement::hold_for(0);
  }

 protected:
  explicit Baseline(const PolicySetup& setup) : Baseline(setup, local_units(setup.roles)) {}
  /// @param usable  The units that it may ever use.
  Baseline(const PolicySetup& setup, UnitMask usable) : usable_(usable) {
    for (UnitId unit = 0; unit < setup.roles.size(); ++unit) order_.push_back(unit);
  }

 private:
  UnitMask usable_;
  std::vector<UnitId> order_;
};

}  // namespace pirt
