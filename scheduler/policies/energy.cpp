// Algorithm 3, energy-optimal scheduling: the DSP before all others.
//
//   for each waiting task:
//     if      Qd < Wd : to DSP; Qd++
//     else if Qg < Wg : to GPU; Qg++
//     else if Qc < Wc : to CPU; Qc++
//     else            : to DSP; Qd++      (only with the literal overflow; see queue_filling.cpp)
#include "scheduler/policies/policies.h"
#include "scheduler/policies/queue_filling.h"
#include "scheduler/policies/unit_order.h"

namespace pirt {

std::unique_ptr<Policy> make_energy_policy(const PolicySetup& setup) {
  return make_queue_filling_policy(setup, kEnergyOrder, "dsp");
}

}  // namespace pirt
