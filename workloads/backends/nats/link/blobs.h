// What is larger than a message: chunks on the robot's stream, some of them under way at a time.
#pragma once

#include <functional>
#include <string>

#include "workloads/backends/nats/link/connection.h"

namespace pirt::cloud {

/// After so long without a step it is given up, with a link or without; or as @p no_step says.
inline constexpr Nanos kNoStep = std::chrono::seconds(30);

/// Puts a blob's chunks on the stream under "PREFIX.N", and goes on where it was after a lost link.
/// @return  The problem in one line, with the remedy; empty = it is there.
[[nodiscard]] std::string put_blob(Connection& connection, const std::string& prefix,
                                   ByteView bytes, std::uint32_t chunk_bytes,
                                   const std::function<bool()>& stop, Nanos no_step = kNoStep);

struct Fetched {
  enum class How : std::uint8_t { kWhole, kMissing, kNoAnswer };  ///< kMissing: or damaged.
  How how = How::kNoAnswer;
  Bytes bytes = {};
};
/// @param blob  Of a size that the caller has judged: so much is allocated.
[[nodiscard]] Fetched fetch_blob(Connection& connection, const std::string& robot,
                                 const std::string& prefix, const Blob& blob,
                                 const std::function<bool()>& stop, Nanos no_step = kNoStep);
/// Removes all chunks under the prefix from the robot's stream; nobody waits for it.
void remove_blob(Connection& connection, const std::string& robot, const std::string& prefix);

}  // namespace pirt::cloud
