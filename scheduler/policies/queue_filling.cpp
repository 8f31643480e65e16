// Readings that Algorithms 2 and 3 have in common. The printed "!" is "<". Q is what is queued and
// running on the unit, of all workloads; its completion callback lowers it. When every queue is at
// its weight the printed algorithms append to one queue without limit, from which the paper's Table
// V cannot come (a backlog of 1000 frames would put 996 on the CPU); so the task is held until a
// queue has room, unless the literal overflow is asked for.
#include "scheduler/policies/queue_filling.h"

#include "scheduler/policies/unit_order.h"

namespace pirt {
namespace {

class QueueFillingPolicy final : public Policy {
 public:
  QueueFillingPolicy(const PolicySetup& setup, std::span<const Role> order, Role otherwise)
      : roles_(setup.roles),
        weights_(setup.weights),
        literal_overflow_(setup.literal_overflow),
        otherwise_(otherwise),
        order_(units_by_role(roles_, order)) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const UnitMask mask = task.eligible & units.up;
    UnitMask full = 0;
    for (const UnitId unit : order_) {
      const int weight = contains(mask, unit) ? weights_[task.workload][unit] : 0;
      if (units.load[unit] < weight) return Placement::on(unit);
      if (weight > 0) full |= unit_bit(unit);
    }
    const auto overflow = overflow_target(mask);
    return overflow ? Placement::on(*overflow) : Placement::hold_for(full);
  }

  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    const UnitMask mask = task.eligible & up;
    UnitMask result = 0;
    for (const UnitId unit : order_) {
      if (contains(mask, unit) && weights_[task.workload][unit] > 0) result |= unit_bit(unit);
    }
    if (const auto overflow = overflow_target(mask)) result |= unit_bit(*overflow);
    return result;
  }

  const std::vector<UnitId>& order() const override { return order_; }

 private:
  std::optional<UnitId> overflow_target(UnitMask mask) const {
    return literal_overflow_ ? else_target(order_, roles_, otherwise_, mask) : std::nullopt;
  }

  std::vector<Role> roles_;
  WeightTable weights_;
  bool literal_overflow_;
  Role otherwise_;
  std::vector<UnitId> order_;
};

}  // namespace

std::unique_ptr<Policy> make_queue_filling_policy(const PolicySetup& setup,
                                                  std::span<const Role> order, Role otherwise) {
  return std::make_unique<QueueFillingPolicy>(setup, order, otherwise);
}

}  // namespace pirt
