// The records of a bag of ROS 1, version 2.0: what reader and writer of it share.
//
// @source  ROS wiki, Bags/Format/2.0. A file is its version line, then records: the size of a head,
// fields NAME=VALUE each with its size in front, the size of the data, the data.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "workloads/base/time.h"

namespace pirt::bag {

inline constexpr std::string_view kVersion = "#ROSBAG V2.0\n";
/// The first record with its padding, so that it can be written last.
inline constexpr std::size_t kHeadBytes = 4096;

enum class Op : std::uint8_t {
  kMessage = 2,
  kBagHeader = 3,
  kIndex = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7
};

/// A number as its bytes, little-endian.
template <typename T>
[[nodiscard]] std::string raw(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

/// Seconds and nanoseconds, 32 bits each.
[[nodiscard]] inline std::string raw_time(Nanos time) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  return raw(static_cast<std::uint32_t>(time.count() / kSecond)) +
         raw(static_cast<std::uint32_t>(time.count() % kSecond));
}

[[nodiscard]] inline std::string field(std::string_view name, const std::string& value) {
  std::string text = std::string(name) + "=" + value;
  return raw(static_cast<std::uint32_t>(text.size())) + text;
}

[[nodiscard]] inline std::string op_field(Op op) {
  return field("op", std::string(1, static_cast<char>(op)));
}

/// @param head  Fields.
[[nodiscard]] inline std::string record(const std::string& head, std::string_view data) {
  return raw(static_cast<std::uint32_t>(head.size())) + head +
         raw(static_cast<std::uint32_t>(data.size())) + std::string(data);
}

}  // namespace pirt::bag
