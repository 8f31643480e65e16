// How numbers, texts and lists lie in what is sent: little endian, one after the other. A message
// names its fields once, in fields(), for writing and for reading. A reader trusts nothing.
#pragma once

#include <fmt/core.h>

#include <algorithm>
#include <concepts>
#include <string_view>
#include <type_traits>
#include <utility>

#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

inline constexpr std::size_t kMostText = 1024;
inline constexpr std::size_t kMostList = 4096;
/// No task takes or waits longer: what follows from sums of a few is in range.
inline constexpr Nanos kLongest = std::chrono::hours(24 * 366);

/// What travels as it lies in memory; tensors.cpp asserts the order.
template <typename T>
concept Plain =
    std::is_integral_v<T> || std::is_enum_v<T> || std::same_as<T, Nanos> || std::same_as<T, Digest>;
/// What has fields().
template <typename T>
concept Message = std::is_class_v<T> && !Plain<T>;

class Writer {
 public:
  template <typename... Fields>
  Writer& operator()(const Fields&... fields) {
    (value(fields), ...);
    return *this;
  }
  Writer& raw(ByteView bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  void reserve(std::size_t size) { bytes_.reserve(size); }
  [[nodiscard]] Bytes take() { return std::move(bytes_); }

 private:
  template <Plain T>
  void value(const T& plain) {
    raw(std::as_bytes(std::span(&plain, 1)));
  }
  void value(const std::string& text) {
    const std::size_t size = std::min(text.size(), kMostText);
    value(static_cast<std::uint32_t>(size));
    raw(std::as_bytes(std::span(text)).first(size));
  }
  void value(const Blob& blob) { (*this)(blob.digest, blob.size_bytes, blob.chunk_bytes); }
  void value(const Bytes& bytes) {
    value(std::uint64_t{bytes.size()});
    raw(bytes);
  }
  template <typename T>
  void value(const std::optional<T>& field) {
    value(static_cast<std::uint8_t>(field.has_value()));
    if (field) value(*field);
  }
  template <typename T>
  void value(const std::vector<T>& list) {
    value(static_cast<std::uint32_t>(list.size()));
    for (const T& each : list) value(each);
  }
  template <Message T>
  void value(const T& message) {
    fields(*this, message);
  }

  Bytes bytes_;
};

/// Once something is wrong, all that follows is 0 and empty, and the first problem stays.
class Reader {
 public:
  explicit Reader(ByteView bytes) : left_(bytes) {}

  template <typename... Fields>
  Reader& operator()(Fields&... fields) {
    (value(fields), ...);
    return *this;
  }
  template <typename T>
  [[nodiscard]] T number() {
    T read{};
    value(read);
    return read;
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
  void fail(std::string problem) {
    if (ok()) problem_ = std::move(problem);
  }
  [[nodiscard]] bool ok() const { return problem_.empty(); }
  /// The problem, or that something is left over.
  [[nodiscard]] std::string finish() {
    if (!left_.empty()) fail(fmt::format("{} bytes too many", left_.size()));
    return problem_;
  }

 private:
  template <Plain T>
  void value(T& plain) {
    const ByteView bytes = raw(sizeof(T), std::same_as<T, Digest> ? "a digest" : "a number");
    std::ranges::copy(bytes, std::as_writable_bytes(std::span(&plain, 1)).begin());
    if constexpr (std::is_enum_v<T>) {
      if (plain > T::kLast) {
        fail(fmt::format("unknown kind {}", static_cast<std::underlying_type_t<T>>(plain)));
      }
    } else if constexpr (std::same_as<T, Nanos>) {
      if (plain >= Nanos::zero() && plain <= kLongest) return;
      fail("a duration that is negative, or of years");
      plain = Nanos::zero();
    }
  }
  /// It may be shown on a terminal, and written into a document.
  void value(std::string& text) {
    const auto size = number<std::uint32_t>();
    if (size > kMostText) fail(fmt::format("a text of {} bytes", size));
    for (const std::byte byte : raw(size, "a text")) {
      const char c = static_cast<char>(byte);
      text += c >= ' ' && c <= '~' ? c : ' ';
    }
  }
  void value(Bytes& bytes) {
    const ByteView read = raw(number<std::uint64_t>(), "a payload");
    bytes.assign(read.begin(), read.end());
  }
  template <typename T>
  void value(std::optional<T>& field) {
    const auto given = number<std::uint8_t>();
    if (given > 1) fail("a flag that is neither 0 nor 1");
    if (ok() && given == 1) value(field.emplace());
  }
  template <typename T>
  void value(std::vector<T>& list) {
    const auto count = number<std::uint32_t>();
    if (count > kMostList) fail(fmt::format("a list of {}", count));
    for (std::uint32_t i = 0; i < count && ok(); ++i) value(list.emplace_back());
  }
  void value(Blob& blob) {
    (*this)(blob.digest, blob.size_bytes, blob.chunk_bytes);
    if (ok() && (blob.size_bytes == 0 || blob.size_bytes > kMostBlobBytes ||
                 blob.chunk_bytes < kLeastChunkBytes)) {
      fail(fmt::format("a blob of {} bytes in chunks of {}", blob.size_bytes, blob.chunk_bytes));
    }
  }
  template <Message T>
  void value(T& message) {
    fields(*this, message);
  }

  ByteView left_;
  std::string problem_;
};

}  // namespace pirt::cloud
