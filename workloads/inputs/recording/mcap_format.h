// The records of an MCAP file: what reader and writer of it share.
//
// @source  https://mcap.dev/spec. A file is a magic number, records, and the magic number again; a
// record is what it is, its size, and fields one after the other, little-endian. Readers leave out
// records that they do not know, and what is behind the fields that they know.
#pragma once

#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "workloads/inputs/recording/bag_format.h"

namespace pirt::mcap {

inline constexpr std::string_view kMagic = "\x89MCAP0\r\n";

enum class Op : std::uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kAttachment = 9,
  kStatistics = 11,
  kMetadata = 12,
  kDataEnd = 15
};

inline constexpr std::size_t kRecordHead = 9;
inline constexpr std::size_t kFooterBytes = kRecordHead + 8 + 8 + 4;

using bag::raw;

/// A text, or a list of bytes, with its size in front.
[[nodiscard]] inline std::string sized(std::string_view text) {
  return raw(static_cast<std::uint32_t>(text.size())) + std::string(text);
}

[[nodiscard]] inline std::string record(Op op, std::string_view fields) {
  return raw(static_cast<std::uint8_t>(op)) + raw(std::uint64_t{fields.size()}) +
         std::string(fields);
}

/// @param before  Of what came before it.
[[nodiscard]] inline std::uint32_t crc_of(std::string_view bytes, std::uint32_t before = 0) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace pirt::mcap
