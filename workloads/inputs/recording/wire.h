// How ROS writes the fields of a message one after the other: ROS 1 packed, ROS 2 as CDR, in which
// each stands at a multiple of its size. Little-endian, as both are on every robot's computer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

enum class WireFormat : std::uint8_t { kRos1, kCdr };

/// Throws Error{kBadInput} where a message ends within a field.
class WireReader {
 public:
  /// @param what  Of the message, for errors: "'a.bag', message 7 of /imu".
  WireReader(std::string_view bytes, WireFormat format, std::string what);

  std::uint8_t u8();
  std::uint32_t u32();
  double f64();
  std::string_view text();
  std::string_view bytes();  ///< uint8[]
  std::vector<double> numbers();
  std::vector<double> numbers(std::size_t count);  ///< float64[count]
  Nanos stamp();
  [[noreturn]] void fail(const std::string& problem) const;
  [[nodiscard]] WireFormat format() const { return format_; }

 private:
  std::string_view take(std::size_t size, std::size_t align);

  std::string_view bytes_;
  WireFormat format_;
  std::size_t at_ = 0;
  std::string what_;
};

class WireWriter {
 public:
  explicit WireWriter(WireFormat format);

  void u8(std::uint8_t value);
  void u32(std::uint32_t value);
  void f64(double value);
  void text(std::string_view value);
  void bytes(std::string_view value);
  void numbers(const std::vector<double>& values);  ///< float64[]
  void stamp(Nanos time);
  [[nodiscard]] WireFormat format() const { return format_; }
  [[nodiscard]] const std::string& written() const { return bytes_; }

 private:
  void put(const void* value, std::size_t size);

  std::string bytes_;
  WireFormat format_;
};

}  // namespace pirt
