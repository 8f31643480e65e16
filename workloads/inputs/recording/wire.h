// How ROS writes the fields of a message one after the other: ROS 1 packed, ROS 2 as CDR, in which
// each stands at a multiple of its size, of XCDR2 of at most 4. Little-endian is written; CDR says
// what it is, and both are read.
#pragma once

#include <cstdint>
#include <optional>
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
  /// @param has_seq  Whether heads of messages count; absent = as is usual of the format.
  WireReader(std::string_view bytes, WireFormat format, std::string what,
             std::optional<bool> has_seq = {});

  std::uint8_t u8();
  std::uint32_t u32();
  double f64();
  std::uint32_t count();  ///< Of a list of messages.
  std::string_view text();
  std::string_view bytes();  ///< uint8[]
  std::vector<double> numbers();
  std::vector<double> numbers(std::size_t count);  ///< float64[count]
  Nanos stamp();
  [[noreturn]] void fail(const std::string& problem) const;
  [[nodiscard]] bool has_seq() const { return has_seq_; }

 private:
  std::string_view take(std::size_t size, std::size_t align);
  template <typename T>
  T number();

  std::string_view bytes_;
  WireFormat format_;
  bool has_seq_;
  bool is_big_endian_ = false, is_xcdr2_ = false;
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
