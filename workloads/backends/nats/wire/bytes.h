// How numbers, texts and lists lie in what is sent: little endian, one after the other. A reader
// trusts nothing.
#pragma once

#include <fmt/core.h>

#include <array>
#include <cstring>
#include <string_view>
#include <type_traits>
#include <utility>

#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

inline constexpr std::size_t kMostText = 1024;
inline constexpr std::size_t kMostList = 4096;

class Writer {
 public:
  template <typename T>
  requires std::is_integral_v<T> Writer& number(T value) {
    using Unsigned = std::make_unsigned_t<T>;
    const auto bits = static_cast<Unsigned>(value);
    std::array<std::byte, sizeof bits> little;
    for (std::size_t i = 0; i < sizeof bits; ++i) {
      little[i] = static_cast<std::byte>(static_cast<std::uint64_t>(bits) >> (8 * i));
    }
    return raw(little);
  }
  Writer& raw(ByteView bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  Writer& text(std::string_view text) {
    text = text.substr(0, kMostText);
    number(static_cast<std::uint32_t>(text.size()));
    return raw(std::as_bytes(std::span(text)));
  }
  Writer& digest(const Digest& digest) { return raw(std::as_bytes(std::span(digest.bytes))); }
  Writer& id(const TaskId& id) { return number(id.run).number(id.number); }
  Writer& blob(const Blob& blob) {
    return digest(blob.digest).number(blob.size_bytes).number(blob.chunk_bytes);
  }
  Writer& payload(const Payload& payload) {
    number(static_cast<std::uint8_t>(payload.index()));
    if (const auto* const blob = std::get_if<Blob>(&payload)) return this->blob(*blob);
    const Bytes& bytes = std::get<Bytes>(payload);
    number(std::uint64_t{bytes.size()});
    return raw(bytes);
  }
  void reserve(std::size_t size) { bytes_.reserve(size); }
  [[nodiscard]] Bytes take() { return std::move(bytes_); }

 private:
  Bytes bytes_;
};

/// Once something is wrong, all that follows is 0 and empty, and the first problem stays.
class Reader {
 public:
  explicit Reader(ByteView bytes) : left_(bytes) {}

  template <typename T>
  T number() {
    std::uint64_t bits = 0;
    const ByteView bytes = raw(sizeof(T), "a number");
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bits |= std::to_integer<std::uint64_t>(bytes[i]) << (8 * i);
    }
    return static_cast<T>(bits);
  }
  ByteView raw(std::uint64_t size, std::string_view what) {
    if (!ok()) return {};
    if (size > left_.size()) {
      fail(fmt::format("{} of {} bytes, and {} are left", what, size, left_.size()));
      return {};
    }
    const ByteView bytes = left_.first(static_cast<std::size_t>(size));
    left_ = left_.subspan(bytes.size());
    return bytes;
  }
  std::string text() {
    const auto size = number<std::uint32_t>();
    if (size > kMostText) fail(fmt::format("a text of {} bytes", size));
    const ByteView bytes = raw(size, "a text");
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  Digest digest() {
    Digest digest;
    const ByteView bytes = raw(digest.bytes.size(), "a digest");
    std::memcpy(digest.bytes.data(), bytes.data(), bytes.size());
    return digest;
  }
  TaskId id() {
    TaskId id;
    id.run = number<std::uint64_t>();
    id.number = number<std::uint64_t>();
    return id;
  }
  Blob blob() {
    Blob blob;
    blob.digest = digest();
    blob.size_bytes = number<std::uint64_t>();
    blob.chunk_bytes = number<std::uint32_t>();
    if (ok() && (blob.size_bytes == 0 || blob.size_bytes > kMostBlobBytes ||
                 blob.chunk_bytes < kLeastChunkBytes)) {
      fail(fmt::format("a blob of {} bytes in chunks of {}", blob.size_bytes, blob.chunk_bytes));
    }
    return blob;
  }
  Payload payload() {
    switch (number<std::uint8_t>()) {
      case 0: {
        const ByteView bytes = raw(number<std::uint64_t>(), "a payload");
        return Bytes(bytes.begin(), bytes.end());
      }
      case 1:
        return blob();
      default:
        fail("an unknown kind of payload");
        return Bytes{};
    }
  }
  /// Number of entries that follow.
  std::size_t count() {
    const auto count = number<std::uint32_t>();
    if (count > kMostList) fail(fmt::format("a list of {}", count));
    return ok() ? count : 0;
  }
  std::optional<Nanos> optional_nanos() {
    const bool given = flag();
    const Nanos value(number<std::int64_t>());
    return given ? std::optional(value) : std::nullopt;
  }
  bool flag() {
    const auto value = number<std::uint8_t>();
    if (value > 1) fail("a flag that is neither 0 nor 1");
    return value == 1;
  }
  Nanos duration() {
    const Nanos value(number<std::int64_t>());
    if (value < Nanos::zero()) fail("a negative duration");
    return value;
  }

  void fail(std::string problem) {
    if (ok()) problem_ = std::move(problem);
  }
  [[nodiscard]] bool ok() const { return problem_.empty(); }
  [[nodiscard]] ByteView rest() { return ok() ? left_ : ByteView{}; }
  /// The problem, or that something is left over.
  [[nodiscard]] std::string finish() {
    if (!left_.empty()) fail(fmt::format("{} bytes too many", left_.size()));
    return problem_;
  }

 private:
  ByteView left_;
  std::string problem_;
};

}  // namespace pirt::cloud
