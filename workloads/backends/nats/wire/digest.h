// SHA-256: names what is sent by its content, and finds damage. Whoever shares a cache with others
// needs one that nobody can aim at.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace pirt::cloud {

struct Digest {
  std::array<std::uint8_t, 32> bytes{};

  /// 64 hexadecimal digits.
  [[nodiscard]] std::string hex() const;
  friend auto operator<=>(const Digest&, const Digest&) = default;
};

class Digester {
 public:
  Digester();
  ~Digester();
  Digester(const Digester&) = delete;
  Digester& operator=(const Digester&) = delete;
  Digester& add(std::span<const std::byte> bytes);
  Digester& add(std::uint64_t value);
  /// Length and characters, so that ("ab", "c") and ("a", "bc") differ.
  Digester& add(std::string_view text);
  /// Once, at the end.
  [[nodiscard]] Digest value();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

[[nodiscard]] Digest digest_of(std::span<const std::byte> bytes);

}  // namespace pirt::cloud
