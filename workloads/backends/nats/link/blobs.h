// What is larger than a message: chunks on the robot's stream, some of them under way at a time.
#pragma once

#include <functional>
#include <string>

#include "workloads/backends/nats/link/connection.h"

namespace pirt::cloud {

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
