// What the baselines have in common: they use any local unit that may serve a task, and weights
// play no part.
#pragma once

#include <optional>

#include "scheduler/policies/policy.h"
#include "scheduler/policies/unit_order.h"

namespace pirt {

class Baseline : public Policy {
 public:
  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    return task.eligible & up & usable_;
  }
  static Placement on_or_hold(std::optional<UnitId> unit) {
    return unit ? Placement::on(*unit) : Placement::hold_for(0);
  }

 protected:
  explicit Baseline(const PolicySetup& setup) : Baseline(local_units(setup.roles)) {}
  /// @param usable  The units that it may ever use.
  explicit Baseline(UnitMask usable) : usable_(usable) {}

 private:
  UnitMask usable_;
};

}  // namespace pirt
