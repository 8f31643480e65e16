// What an administrator does once: a stream for each robot, which robots may neither make nor
// change, and what each may say.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "workloads/backends/nats/link/connection.h"
#include "workloads/base/text/json.h"

namespace pirt::cloud {

struct Setup {
  std::vector<std::string> robots = {"robot"};
  /// What each robot may have on the server: calls and parameters that are larger than a message.
  std::uint64_t robot_bytes = std::uint64_t{512} << 20;
};

/// Makes the streams that are missing, and changes those that are otherwise.
/// @return  One line for each that it made or changed.
/// @throws Error{kBadInput} for names that robots cannot have; Error{kEnvironment} if there is no
/// server, or it refuses, with the remedy.
std::vector<std::string> set_up(Connection& connection, const Setup& setup);
/// The same over a connection of its own.
std::vector<std::string> administer(const ConnectionOptions& options, const Setup& setup);

/// What JetStream said.
struct StreamAnswer {
  Json json = Json::object();
  int error = 0;         ///< Its code; 0 = none.
  std::string why = {};  ///< Of an error, in one line with the remedy.
};
[[nodiscard]] StreamAnswer read_answer(const Connection::Answer& answer);
/// Of an error of STREAM.INFO: there is no such stream.
inline constexpr int kNoStream = 10059;

/// The `authorization` part of a server's configuration: an administrator, workers, and each robot
/// bound to its own subjects. Names users whose passwords are environment variables of the server
/// ($PIRT_ADMIN, $PIRT_WORKER, $PIRT_ROBOT_<NAME>).
[[nodiscard]] std::string permissions(std::span<const std::string> robots);

}  // namespace pirt::cloud
