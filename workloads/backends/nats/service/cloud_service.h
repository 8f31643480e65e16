// The cloud's other side, as commands start it. In a build without the backend, these functions,
// those of computer.h and permissions() each say so.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/link/administration.h"
#include "workloads/backends/nats/service/computer.h"
#include "workloads/backends/nats/service/worker_link.h"
#include "workloads/model/backend.h"

namespace pirt::cloud {

/// What a worker tells of itself while it runs.
struct ServiceEvents {
  std::function<bool()> stop;                   ///< Looked at several times a second.
  std::function<void(const std::string&)> say;  ///< One line.
};

/// Runs a worker until it is told to stop. Makes the stream of robot "robot", where it may.
/// @throws Error{kEnvironment} in a build without the backend, and where the server can never
/// serve; as WorkerLink.
void serve(const WorkerOptions& options, std::span<const Workload* const> workloads,
           const ServiceEvents& events);

/// As set_up, over a connection of its own.
[[nodiscard]] std::vector<std::string> administer(const ConnectionOptions& options,
                                                  const Setup& setup);
}  // namespace pirt::cloud
