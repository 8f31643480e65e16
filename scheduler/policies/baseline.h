// What the baselines have in common: they use any local unit that may serve a task, and know
// servers and costs; weights play no part.
#pragma once

#include <functional>
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

/// Each task to the unit where a call is least by a figure, whatever its load; ties: the first.
/// @tparam kFigure  Of a CallCost.
template <auto kFigure>
class LeastOf final : public Baseline {
 public:
  using Baseline::Baseline;

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const auto& costs = costs_[task.workload];
    return on_or_hold(first_best(takers(task, units.up), [&](UnitId a, UnitId b) {
      return std::invoke(kFigure, *costs[a]) < std::invoke(kFigure, *costs[b]);
    }));
  }
};

}  // namespace pirt
