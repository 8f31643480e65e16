// What Algorithms 2 and 3 share: the first queue, in a fixed order, that is shorter than its
// weight.
//
// Readings that they have in common: the printed "!" is "<". Q is what is queued and running on the
// unit, of all workloads; its completion callback lowers it. When every queue is at its weight the
// printed algorithms append to one queue without limit, from which the paper's Table V cannot come
// (a backlog of 1000 frames would put 996 on the CPU); so the task is held until a queue has room,
// unless the literal overflow is asked for.
#pragma once

#include <optional>
#include <span>

#include "scheduler/policies/weighted.h"

namespace pirt {

class QueueFillingPolicy final : public Weighted {
 public:
  /// @param order      Roles in the order in which queues are filled.
  /// @param otherwise  Role that the printed `else` names.
  QueueFillingPolicy(const PolicySetup& setup, std::span<const Role> order, Role otherwise)
      : Weighted(setup, order, setup.literal_overflow ? std::optional(otherwise) : std::nullopt) {}

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
