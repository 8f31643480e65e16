// Algorithm 3, energy-optimal scheduling: the DSP before all others.
//
//   for each waiting task:
//     if      Qd < Wd : to DSP; Qd++
//     else if Qg < Wg : to GPU; Qg++
//     else if Qc < Wc : to CPU; Qc++
//     else            : to DSP; Qd++      (only with the literal overflow; see weighted.h)
#include "scheduler/policies/policies.h"
#include "scheduler/policies/weighted.h"

namespace pirt {

constinit const PolicyInfo policy::energy = {
    .name = "energy",
    .description = "Algorithm 3: fills the DSP's queue first, then the GPU's, then the CPU's",
    .make = make_policy<QueueFillingPolicy<kEnergyOrder, Role::kDsp>>,
    .rule = WeightRule::kQueue,
    .overflows = true,
    .without_joules = "goes by the units' roles alone, as Algorithm 3 does",
};

}  // namespace pirt
