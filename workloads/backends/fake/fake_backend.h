// The scripted backend: a device that computes nothing itself, takes the time that its script says
// on a clock of its own, and fails where the script says so. It lets tests drive the real program
// deterministically; its figures are `modelled` and never measured.
#pragma once

#include <memory>

#include "workloads/model/backend.h"

namespace pirt {

/// Supports every workload that its script (UnitRequest::script, see fake_script.h) does not
/// exclude. Outputs are the workload's reference, unless scripted wrong; states and lists are as
/// those of other backends. Time is simulated: nothing sleeps, except where a script asks for a
/// hang. With `clock: wall` the device has no time of its own and the calling thread sleeps as long
/// as the script says; what is computed besides is not part of it, as long as it takes less.
///
/// Its "kernel cache" is one empty file a workload in the folder that the environment variable
/// PIRT_FAKE_KERNEL_CACHE names (kernel_cache_environment sets it); without the variable every
/// prepare is cold.
[[nodiscard]] std::unique_ptr<const Backend> make_fake_backend();

}  // namespace pirt
