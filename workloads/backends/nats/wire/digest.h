// SHA-256: names what is sent by its content, and finds damage. Whoever shares a cache with others
// needs one that nobody can aim at.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace pirt::cloud {

struct Digest {
  std::array<std::uint8_t, 32> bytes{};

  /// 64 hexadecimal digits.
  [[nodiscard]] std::string hex() const;
  friend auto operator<=>(const Digest&, const Digest&) = default;
};

[[nodiscard]] Digest digest_of(std::span<const std::byte> bytes);

}  // namespace pirt::cloud
