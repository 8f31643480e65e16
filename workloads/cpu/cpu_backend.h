// The host's own cores through OpenCV (vision) and oneDNN (AlexNet).
#pragma once

#include <memory>

#include "workloads/backend.h"

namespace pirt {

/// Backend "cpu". Its devices are opened, used and destroyed by one thread: the affinity, and with
/// it that of the worker pools, is the opening thread's. OpenCV has one pool a process: of two open
/// devices the later one sets its size.
[[nodiscard]] std::unique_ptr<const Backend> make_cpu_backend();

}  // namespace pirt
