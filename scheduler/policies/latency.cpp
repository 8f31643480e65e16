// Algorithm 1, latency-optimal scheduling: weighted round robin, blind to load.
//
//   for each waiting task:
//     if      N < Wg         : to GPU; N++
//     else if N < Wg+Wd      : to DSP; N++
//     else if N < Wg+Wd+Wc   : to CPU; N++
//     else                   : to CPU; reset N
//
// Readings. The printed "!" is "<". N counts dispatches and never falls; it is reset in the `else`,
// after that dispatch to the CPU, so that a cycle has Wg+Wd+Wc+1 tasks and (5,1,2) gives GGGGGDCCC.
// N is kept per workload. A slow unit blocks the cycle, since load is ignored: that is the paper's
// algorithm. Units that may not serve a task are passed over as if their weight were 0.
#include "scheduler/policies/policies.h"
#include "scheduler/policies/unit_order.h"

namespace pirt {
namespace {

class LatencyPolicy final : public Policy {
 public:
  explicit LatencyPolicy(const PolicySetup& setup)
      : roles_(setup.roles),
        weights_(setup.weights),
        order_(units_by_role(roles_, kLatencyOrder)),
        dispatched_(weights_.size(), 0) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    const UnitMask mask = task.eligible & units.up;
    int& n = dispatched_[task.workload];
    int threshold = 0;
    for (const UnitId unit : order_) {
      if (!contains(mask, unit)) continue;
      threshold += weights_[task.workload][unit];
      if (n < threshold) {
        ++n;
        return Placement::on(unit);
      }
    }
    const auto otherwise = else_target(order_, roles_, Role::kCpu, mask);
    if (!otherwise) return Placement::hold_for(0);
    n = 0;
    return Placement::on(*otherwise);
  }

  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    const UnitMask mask = task.eligible & up;
    UnitMask result = 0;
    for (const UnitId unit : order_) {
      if (contains(mask, unit) && weights_[task.workload][unit] > 0) result |= unit_bit(unit);
    }
    if (const auto otherwise = else_target(order_, roles_, Role::kCpu, mask))
      result |= unit_bit(*otherwise);
    return result;
  }

  const std::vector<UnitId>& order() const override { return order_; }

 private:
  std::vector<Role> roles_;
  WeightTable weights_;
  std::vector<UnitId> order_;
  std::vector<int> dispatched_;  ///< N, by workload.
};

}  // namespace

constinit const PolicyInfo policy::latency = {
    .name = "latency",
    .description = "Algorithm 1: deals tasks out to GPU, DSP and CPU in turn, by weight",
    .make = make_policy<LatencyPolicy>,
    .rule = WeightRule::kShare,
};

}  // namespace pirt
