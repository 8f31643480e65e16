// What Algorithms 1 to 3 have in common: weights, the order in which units are asked, and the unit
// that the printed `else` names.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "scheduler/policies/policy.h"
#include "scheduler/policies/unit_order.h"

namespace pirt {

class Weighted : public Policy {
 public:
  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    UnitMask result = 0;
    for (const UnitId unit : order_) {
      if (weight(task, unit, up) > 0) result |= unit_bit(unit);
    }
    if (const auto unit = else_unit(task, up)) result |= unit_bit(*unit);
    return result;
  }
  std::vector<UnitId> order() const override { return order_; }

 protected:
  /// @param order      Roles in the order in which the algorithm asks.
  /// @param otherwise  Role that its `else` names; absent: that is not taken.
  Weighted(const PolicySetup& setup, std::span<const Role> order, std::optional<Role> otherwise)
      : order_(units_by_role(setup.roles, order)),
        roles_(setup.roles),
        weights_(setup.weights),
        otherwise_(otherwise) {}

  /// 0 where the unit may not serve the task.
  [[nodiscard]] int weight(const TaskClass& task, UnitId unit, UnitMask up) const {
    return contains(task.eligible & up, unit) ? weights_[task.workload][unit] : 0;
  }
  [[nodiscard]] std::optional<UnitId> else_unit(const TaskClass& task, UnitMask up) const {
    if (!otherwise_) return std::nullopt;
    return else_target(order_, roles_, *otherwise_, task.eligible & up);
  }

  const std::vector<UnitId> order_;

 private:
  std::vector<Role> roles_;
  WeightTable weights_;
  std::optional<Role> otherwise_;
};

/// What Algorithms 2 and 3 share: the first queue, in a fixed order, that is shorter than its
/// weight.
///
/// Readings that they have in common: the printed "!" is "<". Q is what is queued and running on
/// the unit, of all workloads; its completion callback lowers it. When every queue is at its weight
/// the printed algorithms append to one queue without limit, from which the paper's Table V cannot
/// come (a backlog of 1000 frames would put 996 on the CPU); so the task is held until a queue has
/// room, unless the literal overflow is asked for.
///
/// @tparam kOrder      Roles in the order in which queues are filled.
/// @tparam kOtherwise  Role that the printed `else` names.
template <const auto& kOrder, Role kOtherwise>
class QueueFillingPolicy final : public Weighted {
 public:
  explicit QueueFillingPolicy(const PolicySetup& setup)
      : Weighted(setup, kOrder, setup.literal_overflow ? std::optional(kOtherwise) : std::nullopt) {
  }

  Placement place(const TaskClass& task, const UnitsView& units) override {
    UnitMask full = 0;
    for (const UnitId unit : order_) {
      const int its = weight(task, unit, units.up);
      if (units.load[unit] < its) return Placement::on(unit);
      if (its > 0) full |= unit_bit(unit);
    }
    const auto overflow = else_unit(task, units.up);
    return overflow ? Placement::on(*overflow) : Placement::hold_for(full);
  }
};

}  // namespace pirt
