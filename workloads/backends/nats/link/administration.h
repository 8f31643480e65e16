// What an administrator does once: streams and consumers, which robots may neither make nor change.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/link/connection.h"

namespace pirt::cloud {

struct Setup {
  std::vector<std::string> robots = {"robot"};
  std::uint64_t task_bytes = std::uint64_t{256} << 20;   ///< Of the stream of tasks,
  std::uint64_t reply_bytes = std::uint64_t{256} << 20;  ///< of replies,
  std::uint64_t blob_bytes = std::uint64_t{2} << 30;     ///< and of what is larger.
  Nanos redelivered = std::chrono::seconds(30);  ///< After a worker was last heard of a task.
  bool in_memory = false;                        ///< For tests and benchmarks.
};

/// Makes the streams and consumers that are missing, and changes those that are otherwise.
/// @return  One line for each that it made or changed.
/// @throws Error{kBadInput} for names that robots cannot have; Error{kEnvironment} if there is no
/// server, or it refuses.
std::vector<std::string> set_up(Connection& connection, const Setup& setup);

/// Removes the robot's consumer: what is for it stays until its time is over.
void remove_robot(Connection& connection, const std::string& robot);

/// What is missing for a worker or a robot (empty = a worker), in one line; empty = nothing.
[[nodiscard]] std::string what_is_missing(Connection& connection, const std::string& robot);

/// The `authorization` part of a server's configuration: an administrator, workers, and each robot
/// bound to its own subjects. Names users whose passwords are environment variables of the server
/// ($PIRT_ADMIN, $PIRT_WORKER, $PIRT_ROBOT_<NAME>).
[[nodiscard]] std::string permissions(std::span<const std::string> robots);

}  // namespace pirt::cloud
