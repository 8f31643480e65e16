// What is larger than a message: chunks on a stream, a window of them under way at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "workloads/backends/nats/link/connection.h"

namespace pirt::cloud {

struct Put {
  std::string problem = {};  ///< In one line; empty = it is there.
  std::uint32_t stored = 0;  ///< All chunks before it are.
};
/// Puts a blob's chunks on the stream under "PREFIX.N", some at a time, and goes on where it was
/// after a lost link.
/// @param first  Those before it are there already.
[[nodiscard]] Put put_blob(Connection& connection, const std::string& prefix, ByteView bytes,
                           std::uint32_t chunk_bytes, const std::function<bool()>& stop,
                           std::uint32_t first = 0);

struct Fetched {
  enum class How : std::uint8_t { kWhole, kMissing, kDamaged, kNoAnswer };
  How how = How::kNoAnswer;
  Bytes bytes = {};
};
/// Reads it from there. Nothing is allocated beyond what has come.
[[nodiscard]] Fetched fetch_blob(Connection& connection, const std::string& prefix,
                                 const Blob& blob, const std::function<bool()>& stop);
/// Removes all chunks under the prefix; nobody waits for it.
void remove_blob(Connection& connection, const std::string& prefix);

}  // namespace pirt::cloud
