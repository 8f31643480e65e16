#include "workloads/base/text/printable.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>

namespace pirt {
namespace {

std::uint32_t byte_at(std::string_view text, std::size_t at) {
  return static_cast<unsigned char>(text[at]);
}

struct Character {
  std::size_t bytes = 0;    ///< 0 = not UTF-8.
  std::uint32_t point = 0;  ///< Code point.
};

/// As Unicode, table 3-7, has it: neither longer than need be, nor a surrogate, nor above 10FFFF.
Character character_at(std::string_view text, std::size_t at) {
  const std::uint32_t lead = byte_at(text, at);
  if (lead < 0x80) return {1, lead};
  const std::size_t bytes = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() - at < bytes) return {};
  std::uint32_t point = lead & (0x7fU >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    const std::uint32_t next = byte_at(text, at + i);
    if ((next & 0xc0U) != 0x80U) return {};
    point = point << 6 | (next & 0x3fU);
  }
  const bool overlong = (bytes == 3 && point < 0x800) || (bytes == 4 && point < 0x10000);
  const bool surrogate = point >= 0xd800 && point < 0xe000;
  if (overlong || surrogate || point > 0x10ffff) return {};
  return {bytes, point};
}

bool is_control(std::uint32_t point) {
  const auto within = [point](std::uint32_t first, std::uint32_t last) {
    return point >= first && point <= last;
  };
  return within(0, 0x1f) || within(0x7f, 0x9f) ||
         within(0x2028, 0x202e) ||  // line and paragraph separators, direction overrides
         within(0x2066, 0x2069);    // direction isolates
}

bool is_good(const Character& character, std::string_view text, std::size_t at,
             std::string_view allowed) {
  if (character.bytes == 0) return false;
  return !is_control(character.point) || allowed.find(text[at]) != std::string_view::npos;
}

std::string escaped(std::string_view bytes) {
  std::string out;
  for (const char c : bytes) {
    switch (c) {
      case '\n':
        out += "\\n";
        break;
      case '\r':
        out += "\\r";
        break;
      case '\t':
        out += "\\t";
        break;
      default:
        out += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    }
  }
  return out;
}

}  // namespace

std::optional<Unprintable> find_unprintable(std::string_view text, std::string_view allowed) {
  for (std::size_t at = 0; at < text.size();) {
    const Character character = character_at(text, at);
    if (!is_good(character, text, at, allowed)) {
      const std::string shown = escaped(text.substr(at, std::max<std::size_t>(1, character.bytes)));
      return Unprintable{at, character.bytes == 0 ? "the byte " + shown + ", which is not UTF-8"
                                                  : "the control character " + shown};
    }
    at += character.bytes;
  }
  return std::nullopt;
}

std::string printable(std::string_view text, std::string_view allowed) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const Character character = character_at(text, at);
    const std::size_t bytes = std::max<std::size_t>(1, character.bytes);
    const auto part = text.substr(at, bytes);
    out += is_good(character, text, at, allowed) ? std::string(part) : escaped(part);
    at += bytes;
  }
  return out;
}

}  // namespace pirt
