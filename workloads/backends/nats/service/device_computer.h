// Computes a worker's calls on a device of this machine, and keeps what was prepared for them: the
// one cache of a worker, of parameters and kernels together.
#pragma once

#include <cstdint>
#include <memory>

#include "workloads/backends/nats/service/computer.h"
#include "workloads/model/backend.h"

namespace pirt::cloud {

struct Kept {
  /// Of parameters and kernels, by what the process holds of memory for them. The robot that has
  /// the most loses what it used longest ago.
  std::uint64_t bytes = std::uint64_t{512} << 20;
  std::size_t kernels = 64;  ///< Of a robot.
};

/// Opens the device. Of the thread that made it.
/// @param backend  Outlives it.
/// @throws As Backend::open.
[[nodiscard]] std::unique_ptr<Computer> make_device_computer(const Backend& backend,
                                                             const UnitRequest& request,
                                                             const Kept& kept);

}  // namespace pirt::cloud
