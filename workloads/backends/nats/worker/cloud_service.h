// The cloud's other side, as commands start it; in a build without the backend each says so.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/link/administration.h"
#include "workloads/backends/nats/worker/worker_link.h"
#include "workloads/model/backend.h"

namespace pirt::cloud {

/// What a worker tells of itself while it runs.
struct ServiceEvents {
  std::function<bool()> stop;                   ///< Looked at several times a second.
  std::function<void(const std::string&)> say;  ///< One line.
};

/// Runs a worker until it is told to stop. Makes streams and consumers that are missing, where it
/// may.
/// @throws Error{kEnvironment} in a build without the backend; as WorkerLink and set_up.
void serve(const WorkerOptions& options, std::span<const Workload* const> workloads,
           const ServiceEvents& events);

/// As make_device_computer. @throws Error{kEnvironment} in a build without the backend.
[[nodiscard]] std::unique_ptr<Computer> computer_on(const Backend& backend,
                                                    const UnitRequest& request,
                                                    std::uint64_t kept_bytes);

/// As make_process_computer and serve_computer. @throws Error{kEnvironment} in a build without the
/// backend.
[[nodiscard]] std::unique_ptr<Computer> computer_in(std::string program,
                                                    std::vector<std::string> arguments);
bool serve_slot(Computer& computer, std::span<const Workload* const> workloads,
                std::uint64_t kept_bytes);

/// As set_up, over a connection of its own.
[[nodiscard]] std::vector<std::string> administer(const ConnectionOptions& options,
                                                  const Setup& setup);
/// As permissions. @throws Error{kEnvironment} in a build without the backend.
[[nodiscard]] std::string permissions_of(std::span<const std::string> robots);

}  // namespace pirt::cloud
