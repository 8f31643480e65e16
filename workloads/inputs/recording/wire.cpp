#include "workloads/inputs/recording/wire.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "workloads/base/error.h"

namespace pirt {
namespace {

static_assert(std::endian::native == std::endian::little, "the fields are copied as they are");

/// The encapsulation header, which offsets do not count.
constexpr std::string_view kCdrHead("\0\1\0\0", 4);
constexpr std::int64_t kNanosPerSecond = 1'000'000'000;

}  // namespace

WireReader::WireReader(std::string_view bytes, WireFormat format, std::string what,
                       std::optional<bool> has_seq)
    : bytes_(bytes),
      format_(format),
      has_seq_(has_seq.value_or(format == WireFormat::kRos1)),
      what_(std::move(what)) {
  if (format_ != WireFormat::kCdr) return;
  if (bytes_.size() < kCdrHead.size()) fail("ends within the head of CDR");
  // Plain ones; those with lengths or numbers of fields are of types that may change.
  constexpr unsigned kPlain = 0, kPlain2 = 6;
  const unsigned kind =
      static_cast<unsigned char>(bytes_[0]) * 256U + static_cast<unsigned char>(bytes_[1]);
  is_big_endian_ = kind % 2 == 0;
  is_xcdr2_ = kind / 2 == kPlain2 / 2;
  if (kind / 2 != kPlain / 2 && !is_xcdr2_) {
    fail(fmt::format("is CDR of kind {}; plain CDR and XCDR2 are known", kind));
  }
  bytes_.remove_prefix(kCdrHead.size());
}

void WireReader::fail(const std::string& problem) const { throw_bad_input(what_ + " " + problem); }

std::string_view WireReader::take(std::size_t size, std::size_t align) {
  if (is_xcdr2_) align = std::min<std::size_t>(align, 4);
  if (format_ == WireFormat::kCdr) at_ = (at_ + align - 1) / align * align;
  if (at_ > bytes_.size() || size > bytes_.size() - at_) fail("ends within a field");
  const auto part = bytes_.substr(at_, size);
  at_ += size;
  return part;
}

std::uint8_t WireReader::u8() { return static_cast<std::uint8_t>(take(1, 1).front()); }

template <typename T>
T WireReader::number() {
  std::array<char, sizeof(T)> bytes{};
  std::ranges::copy(take(sizeof(T), sizeof(T)), bytes.begin());
  if (is_big_endian_) std::ranges::reverse(bytes);
  T value{};
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

std::uint32_t WireReader::u32() { return number<std::uint32_t>(); }
double WireReader::f64() { return number<double>(); }

std::uint32_t WireReader::count() {
  if (is_xcdr2_) u32();  // the bytes that follow
  return u32();
}

std::string_view WireReader::bytes() { return take(u32(), 1); }

std::string_view WireReader::text() {
  auto value = bytes();
  if (format_ == WireFormat::kCdr && !value.empty()) value.remove_suffix(1);  // the 0 behind it
  return value;
}

std::vector<double> WireReader::numbers(std::size_t count) {
  if (count > bytes_.size() / sizeof(double)) fail("ends within a field");
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(f64());
  return values;
}

std::vector<double> WireReader::numbers() { return numbers(u32()); }

Nanos WireReader::stamp() {
  const std::int64_t seconds = u32();
  // Of ROS 2 they have a sign.
  if (format_ == WireFormat::kCdr && seconds > INT32_MAX) fail("has a stamp before 1970");
  return Nanos(seconds * kNanosPerSecond + u32());
}

WireWriter::WireWriter(WireFormat format) : format_(format) {
  if (format_ == WireFormat::kCdr) bytes_ = kCdrHead;
}

void WireWriter::put(const void* value, std::size_t size) {
  // Behind the head, whose size is a multiple of 4 only.
  while (format_ == WireFormat::kCdr && (bytes_.size() - kCdrHead.size()) % size != 0) {
    bytes_ += '\0';
  }
  bytes_.append(static_cast<const char*>(value), size);
}

void WireWriter::u8(std::uint8_t value) { put(&value, sizeof value); }
void WireWriter::u32(std::uint32_t value) { put(&value, sizeof value); }
void WireWriter::f64(double value) { put(&value, sizeof value); }

void WireWriter::bytes(std::string_view value) {
  u32(static_cast<std::uint32_t>(value.size()));
  bytes_ += value;
}

void WireWriter::text(std::string_view value) {
  if (format_ != WireFormat::kCdr) return bytes(value);
  u32(static_cast<std::uint32_t>(value.size() + 1));
  bytes_ += value;
  bytes_ += '\0';
}

void WireWriter::numbers(const std::vector<double>& values) {
  u32(static_cast<std::uint32_t>(values.size()));
  for (const double value : values) f64(value);
}

void WireWriter::stamp(Nanos time) {
  u32(static_cast<std::uint32_t>(time.count() / kNanosPerSecond));
  u32(static_cast<std::uint32_t>(time.count() % kNanosPerSecond));
}

}  // namespace pirt
