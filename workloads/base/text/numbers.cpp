#include "workloads/base/text/numbers.h"

#include <fmt/core.h>

#include <cassert>
#include <charconv>
#include <cmath>
#include <cstdint>

namespace pirt {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Takes the digits at the front of @p text. @return how many.
std::size_t take_digits(std::string_view& text) {
  std::size_t count = 0;
  while (count < text.size() && is_digit(text[count])) ++count;
  text.remove_prefix(count);
  return count;
}

/// Takes sign and digits before the point; leading zeros are not taken.
/// @return how many digits; none for what must not begin a number.
std::size_t take_integer_part(std::string_view& text) {
  if (text.starts_with('-')) text.remove_prefix(1);
  if (text.starts_with('0')) {
    text.remove_prefix(1);
    return 1;
  }
  return take_digits(text);
}

bool is_whole(std::string_view text) { return take_integer_part(text) > 0 && text.empty(); }

bool is_decimal(std::string_view text) {
  std::size_t digits = take_integer_part(text);
  if (text.starts_with('.')) {
    text.remove_prefix(1);
    digits += take_digits(text);
  }
  if (digits == 0) return false;
  if (text.starts_with('e') || text.starts_with('E')) {
    text.remove_prefix(1);
    if (text.starts_with('+') || text.starts_with('-')) text.remove_prefix(1);
    if (take_digits(text) == 0) return false;
  }
  return text.empty();
}

/// Reads what has the right form already; without a value, the type cannot hold it.
template <typename T>
std::optional<T> converted(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

template <typename T>
NumberRead<T> out_of_range(std::string_view text, T low, T high) {
  return {.value = {},
          .problem = fmt::format("must be between {} and {}, got {}", low, high, text)};
}

}  // namespace

template <std::integral T>
NumberRead<T> whole_number(std::string_view text, T low, T high) {
  if (!is_whole(text)) {
    return {.value = {},
            .problem = fmt::format("must be a whole number in plain digits, got '{}'", text)};
  }
  const auto value = converted<T>(text);
  if (!value || *value < low || *value > high) return out_of_range(text, low, high);
  return {.value = value, .problem = {}};
}

template NumberRead<int> whole_number(std::string_view, int, int);
template NumberRead<std::int64_t> whole_number(std::string_view, std::int64_t, std::int64_t);
template NumberRead<std::uint64_t> whole_number(std::string_view, std::uint64_t, std::uint64_t);

NumberRead<double> decimal_number(std::string_view text, double low, double high) {
  assert(std::isfinite(low) && std::isfinite(high));
  const auto value = is_decimal(text) ? converted<double>(text) : std::nullopt;
  if (!value) {
    // A double cannot hold 1e-999 either, and taking it for 0 would be a guess.
    return {.value = {},
            .problem = fmt::format("must be a finite number in decimal notation, got '{}'", text)};
  }
  if (*value < low || *value > high) return out_of_range(text, low, high);
  return {.value = value, .problem = {}};
}

NumberRead<Nanos> milliseconds(std::string_view text, double low_ms, double high_ms) {
  assert(low_ms == 0 || low_ms >= kNanosecondMs);
  assert(high_ms <= 9e12);
  const auto read = decimal_number(text, low_ms, high_ms);
  if (!read.value) return {.value = {}, .problem = read.problem};
  if (*read.value > 0 && *read.value < kNanosecondMs) {
    return {.value = {},
            .problem = fmt::format("must be 0 or at least {} (a nanosecond), got {}", kNanosecondMs,
                                   text)};
  }
  return {.value = from_ms(*read.value), .problem = {}};
}

}  // namespace pirt
