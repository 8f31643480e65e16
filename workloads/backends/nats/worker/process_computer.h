// Computes in a process of its own: a kernel that crashes takes a try, and not the worker.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/worker/worker_link.h"

namespace pirt::cloud {

/// Where the process finds its end of the line.
inline constexpr int kSlotDescriptor = 3;

/// Starts @p program when it is first needed, and again once it has died, which is an error of that
/// call. Whatever it holds ends with it.
[[nodiscard]] std::unique_ptr<Computer> make_process_computer(std::string program,
                                                              std::vector<std::string> arguments);

/// The body of that process: computes what comes until the line ends.
/// @param kept_bytes  Of parameters.
/// @return  Whether it ended where a call ends.
bool serve_computer(Computer& computer, std::span<const Workload* const> workloads,
                    std::uint64_t kept_bytes, int line = kSlotDescriptor);

}  // namespace pirt::cloud
