// Numbers from text, for files and command lines alike: plain decimal notation within a stated
// range, or a message that says both.
//
// A whole number is written "0", "42" or "-7", a decimal also "2.5", ".5" or "1e-3". Everything
// else is refused and nothing is guessed: "" and blanks, "+5", "010" (8 to some readers), "0x10",
// "1_000", "nan", "inf", and numbers that the type cannot hold.
#pragma once

#include <concepts>
#include <optional>
#include <string>
#include <string_view>

#include "workloads/base/error.h"
#include "workloads/base/time.h"

namespace pirt {

template <typename T>
struct NumberRead {
  std::optional<T> value;
  std::string problem;  ///< If there is no value: "must be between 1 and 64, got 5000".

  /// @throws Error{kBadInput} "WHAT PROBLEM", e.g. with what = "--seed".
  [[nodiscard]] T or_refuse(std::string_view what) const {
    if (!value) throw_bad_input(std::string(what) + " " + problem);
    return *value;
  }
};

/// For T = int, std::int64_t and std::uint64_t.
template <std::integral T>
[[nodiscard]] NumberRead<T> whole_number(std::string_view text, T low, T high);

/// @param low, high  Finite; the value is within both.
[[nodiscard]] NumberRead<double> decimal_number(std::string_view text, double low, double high);

/// A nanosecond, the least time above 0 that a file or an option can say.
inline constexpr double kNanosecondMs = 1e-6;
/// The longest one, eleven days: longer is a slip of the pen, and sums of thousands of them stay
/// inside int64 nanoseconds.
inline constexpr double kLongestMs = 1e9;

/// A time in ms. What lies between 0 and a nanosecond is refused, not rounded to 0.
/// @param low_ms   0 (an exact 0 is good) or at least kNanosecondMs.
/// @param high_ms  At most 9e12, which int64 nanoseconds hold.
[[nodiscard]] NumberRead<Nanos> milliseconds(std::string_view text, double low_ms, double high_ms);

}  // namespace pirt
