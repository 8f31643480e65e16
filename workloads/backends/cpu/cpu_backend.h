// The host's own cores through OpenCV (vision) and oneDNN (AlexNet).
#pragma once

#include <memory>

#include "workloads/model/backend.h"

namespace pirt {

/// Backend "cpu". A device is opened, used and destroyed by one thread: the affinity, and with it
/// that of its threads, is the opening thread's. Several devices may be open in a process and, by
/// threads of their own, compute at once; each has as many threads as its unit has cores. (One
/// thread that opens two has the affinity of the second.)
[[nodiscard]] std::unique_ptr<const Backend> make_cpu_backend();

}  // namespace pirt
