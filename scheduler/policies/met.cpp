// MET, minimum execution time: the unit that was fastest for the workload in its history, which
// here is the profile or the platform's model. Load plays no part, so that a popular unit's queue
// grows while others idle. Ties: the first unit.
//
// Source: Jimenez, Vilanova, Gelado, Gil, Fursin, Navarro: Predictive Runtime Code Scheduling for
// Heterogeneous Architectures, HiPEAC 2009 (performance history); Braun et al.: A Comparison of
// Eleven Static Heuristics, JPDC 61(6), 2001 (the name).
#include "scheduler/policies/baseline.h"
#include "scheduler/policies/policies.h"

namespace pirt {

constinit const PolicyInfo policy::met = {
    .name = "met",
    .description =
        "Baseline, minimum execution time: the fastest unit for the workload, whatever its load",
    .make = make_policy<LeastOf<&CallCost::total>>,
};

}  // namespace pirt
