// Algorithm 2, throughput-optimal scheduling: keep the GPU's queue full.
//
//   for each waiting task:
//     if      Qg < Wg : to GPU; Qg++
//     else if Qc < Wc : to CPU; Qc++
//     else if Qd < Wd : to DSP; Qd++
//     else            : to CPU; Qc++      (only with the literal overflow; see weighted.h)
#include "scheduler/policies/policies.h"
#include "scheduler/policies/weighted.h"

namespace pirt {

constinit const PolicyInfo policy::throughput = {
    .name = "throughput",
    .description = "Algorithm 2: keeps the GPU's queue full, then the CPU's, then the DSP's",
    .make = make_policy<QueueFillingPolicy<kThroughputOrder, Role::kCpu>>,
    .rule = WeightRule::kFastQueue,
    .overflows = true,
};

}  // namespace pirt
