// Computes a worker's tasks on a device of this machine.
#pragma once

#include <cstdint>
#include <memory>

#include "workloads/backends/nats/worker/worker_link.h"
#include "workloads/model/backend.h"

namespace pirt::cloud {

/// Opens the device, whose kernels are kept as long as their parameters are within @p kept_bytes;
/// those that were used longest ago go first. Of the thread that made it.
/// @param backend  Outlives it.
/// @throws As Backend::open.
[[nodiscard]] std::unique_ptr<Computer> make_device_computer(const Backend& backend,
                                                             const UnitRequest& request,
                                                             std::uint64_t kept_bytes);

}  // namespace pirt::cloud
