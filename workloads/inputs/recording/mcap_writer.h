// Writing MCAP, with everything that lets a viewer seek.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"

namespace pirt::mcap {

/// What a topic's messages are.
struct MessageSchema {
  std::string_view name;                    ///< "sensor_msgs/msg/Image", "foxglove.PoseInFrame"
  std::string_view language;                ///< "ros2msg", "jsonschema"
  std::string_view encoding;                ///< Of the messages: "cdr", "json".
  std::function<std::string()> definition;  ///< Asked for once a topic.
};

class McapWriter {
 public:
  using Put = std::function<void(std::string_view)>;
  /// @param put          Takes the bytes of the file, one after the other.
  /// @param profile      "ros2"; empty = none.
  /// @param compression  Of chunks: "none", "lz4" or "zstd".
  /// @throws Error{kEnvironment} if pirt was built without that.
  McapWriter(Put put, std::string_view profile, std::string_view compression);

  /// @param time  0 or later.
  void write(const std::string& topic, const MessageSchema& schema, Nanos time,
             std::string_view message);
  /// The end; nothing is written after it.
  void finish();

 private:
  struct Channel {
    std::uint16_t id = 0;
    std::uint32_t messages = 0;
  };
  void put(std::string_view bytes);
  void end_chunk();

  Put put_;
  std::string compression_;
  std::uint64_t written_ = 0;
  std::uint32_t crc_ = 0;
  std::map<std::string, Channel> channels_;
  std::vector<std::string> described_;          ///< Records of schemas and channels.
  std::string chunk_, chunk_indices_;           ///< The records of one, and records of all.
  std::map<std::uint16_t, std::string> index_;  ///< Of the chunk, by channel.
  Nanos first_{}, last_{};                      ///< Of the chunk.
  Nanos begin_{}, end_{};
  std::uint64_t messages_ = 0;
  std::uint32_t chunk_count_ = 0;
};

}  // namespace pirt::mcap
