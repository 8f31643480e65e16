// The cloud's other side, as commands start it; in a build without the backend each says so.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/link/administration.h"
#include "workloads/backends/nats/service/device_computer.h"
#include "workloads/backends/nats/service/process_computer.h"
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

/// As make_device_computer, make_process_computer and serve_computer.
/// @throws Error{kEnvironment} in a build without the backend.
[[nodiscard]] std::unique_ptr<Computer> computer_on(const Backend& backend,
                                                    const UnitRequest& request, const Kept& kept);
[[nodiscard]] std::unique_ptr<Computer> computer_in(SlotProgram program);
bool serve_slot(Computer& computer, std::span<const Workload* const> workloads,
                std::uint64_t call_bytes);

/// As set_up, over a connection of its own.
[[nodiscard]] std::vector<std::string> administer(const ConnectionOptions& options,
                                                  const Setup& setup);
/// As permissions. @throws Error{kEnvironment} in a build without the backend.
[[nodiscard]] std::string permissions_of(std::span<const std::string> robots);

}  // namespace pirt::cloud
