// A robot's stream: what is larger than a message lies there, in chunks, some of them under way at
// a time. An administrator makes it, once: robots may neither make nor change one. And what each of
// them may say.
#pragma once

#include <cstdint>
#include <functional>
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
/// @return  What each of them is, in one line.
/// @throws Error{kBadInput} for names that robots cannot have; Error{kEnvironment} if there is no
/// server, or it refuses, with the remedy.
std::vector<std::string> set_up(Connection& connection, const Setup& setup);
/// The same over a connection of its own.
std::vector<std::string> administer(const ConnectionOptions& options, const Setup& setup);

/// The `authorization` part of a server's configuration: an administrator, workers, and each robot
/// bound to its own subjects. Names users whose passwords are environment variables of the server
/// ($PIRT_ADMIN, $PIRT_WORKER, $PIRT_ROBOT_<NAME>).
[[nodiscard]] std::string permissions(std::span<const std::string> robots);

/// What JetStream said.
struct StreamAnswer {
  Json json = Json::object();
  int error = 0;         ///< Its code; 0 = none.
  std::string why = {};  ///< Of an error, in one line with the remedy.
};
[[nodiscard]] StreamAnswer read_answer(const Connection::Answer& answer);
/// Of an error: there is no such stream.
inline constexpr int kNoStream = 10059;

/// After so long without a step it is given up, with a link or without; or as @p no_step says.
inline constexpr Nanos kNoStep = std::chrono::seconds(30);

/// Puts a blob's chunks on its robot's stream under "PREFIX.N", and goes on where it was after a
/// lost link.
/// @return  The problem in one line, with the remedy; empty = it is there.
[[nodiscard]] std::string put_blob(Connection& connection, const std::string& prefix,
                                   const Blob& blob, ByteView bytes,
                                   const std::function<bool()>& stop, Nanos no_step = kNoStep);
/// @param blob  Of a size that the caller has judged: so much is allocated.
/// @return      Its bytes, or a status: it is not there, or damaged.
[[nodiscard]] Connection::Answer fetch_blob(Connection& connection, const std::string& prefix,
                                            const Blob& blob, const std::function<bool()>& stop,
                                            Nanos no_step = kNoStep);
/// Removes all chunks under the prefix from the stream; nobody waits for it.
void remove_blob(Connection& connection, const std::string& prefix);

}  // namespace pirt::cloud
