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
#include "scheduler/policies/weighted.h"

namespace pirt {
namespace {

class LatencyPolicy final : public Weighted {
 public:
  explicit LatencyPolicy(const PolicySetup& setup)
      : Weighted(setup, kLatencyOrder, Role::kCpu), dispatched_(setup.weights.size(), 0) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    int& n = dispatched_[task.workload];
    int threshold = 0;
    for (const UnitId unit : order_) {
      threshold += weight(task, unit, units.up);
      if (n < threshold) {
        ++n;
        return Placement::on(unit);
      }
    }
    const auto otherwise = else_unit(task, units.up);
    if (!otherwise) return Placement::hold_for(0);
    n = 0;
    return Placement::on(*otherwise);
  }

 private:
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
