// A 64-bit content hash (FNV-1a): finds damage and tells inputs apart; it is no protection against
// intent.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace pirt {

/// @source Fowler, Noll, Vo; parameters as in draft-eastlake-fnv.
class Hash64 {
 public:
  constexpr Hash64& add(std::uint64_t value) {
    for (int shift = 0; shift < 64; shift += 8) mix(static_cast<unsigned char>(value >> shift));
    return *this;
  }
  /// Length and characters, so that ("ab", "c") and ("a", "bc") differ.
  constexpr Hash64& add(std::string_view text) {
    add(static_cast<std::uint64_t>(text.size()));
    for (const char c : text) mix(static_cast<unsigned char>(c));
    return *this;
  }
  Hash64& add(std::span<const std::byte> bytes) {
    for (const std::byte b : bytes) mix(std::to_integer<unsigned char>(b));
    return *this;
  }
  [[nodiscard]] constexpr std::uint64_t value() const { return state_; }

 private:
  constexpr void mix(unsigned char byte) { state_ = (state_ ^ byte) * 0x100000001b3ULL; }
  std::uint64_t state_ = 0xcbf29ce484222325ULL;
};

}  // namespace pirt
