// ECT, earliest completion time: each task, when it becomes ready, to the unit that is expected to
// end it first, with what waits there already. Transfers between units are not looked at.
//
// Source: minimum completion time of Maheswaran, Ali, Siegel, Hensgen, Freund: Dynamic Mapping of a
// Class of Independent Tasks onto Heterogeneous Computing Systems, JPDC 59(2), 1999.
#include "scheduler/policies/completion_estimate.h"
#include "scheduler/policies/policies.h"

namespace pirt {

constinit const PolicyInfo policy::ect = {
    .name = "ect",
    .description =
        "Baseline, earliest completion time: the unit that is expected to end the task first",
    .make = make_policy<CompletionEstimate>,
};

}  // namespace pirt
