#include "cli/options/duration.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <string_view>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/text/numbers.h"

namespace pirt::cli {
namespace {

/// "2.5min" -> "2.5" and "min"; letters and signs of a unit are at the end.
std::pair<std::string_view, std::string_view> split_unit(std::string_view text) {
  const auto is_unit = [](unsigned char c) { return std::isalpha(c) != 0 || c == '%'; };
  const auto unit = std::find_if_not(text.rbegin(), text.rend(), is_unit).base();
  const auto digits = static_cast<std::size_t>(unit - text.begin());
  return {text.substr(0, digits), text.substr(digits)};
}

/// The number in front of @p unit, none of whose units is longer than this.
std::optional<double> number(std::string_view text) {
  constexpr double kMost = 1e18;
  return decimal_number(text, 0, kMost).value;
}

}  // namespace

Nanos parse_duration(const std::string& text) {
  constexpr double kMostSeconds = 10 * 366 * 86400.0;
  constexpr std::array<std::pair<std::string_view, double>, 8> kUnits = {{{"", 1.0},
                                                                          {"s", 1.0},
                                                                          {"ms", 1e-3},
                                                                          {"us", 1e-6},
                                                                          {"ns", 1e-9},
                                                                          {"min", 60.0},
                                                                          {"h", 3600.0},
                                                                          {"d", 86400.0}}};
  const auto [digits, unit] = split_unit(text);
  const auto value = number(digits);
  for (const auto& [name, seconds] : kUnits) {
    if (!value || unit != name) continue;
    const double total = *value * seconds;
    if (total >= 1e-9 && total <= kMostSeconds) return from_s(total);
  }
  throw_bad_input("'" + text +
                  "' is not a duration between 1 ns and 10 years; write e.g. 60s, 500ms or 2min");
}

double parse_fraction(const std::string& text) {
  const auto [digits, unit] = split_unit(text);
  if (const auto value = number(digits); value && (unit == "%" || unit.empty())) {
    const double fraction = unit == "%" ? *value / 100 : *value;
    if (fraction > 0 && fraction <= 1) return fraction;
  }
  throw_bad_input("'" + text + "' is not a fraction between 0 and 1; write e.g. 2% or 0.02");
}

double parse_watts(const std::string& text) {
  constexpr double kMost = 1e6;
  const auto [digits, unit] = split_unit(text);
  if (const auto value = number(digits); value && (unit == "W" || unit == "mW" || unit.empty())) {
    const double watts = unit == "mW" ? *value / 1e3 : *value;
    if (watts > 0 && watts <= kMost) return watts;
  }
  throw_bad_input("'" + text + "' is not a power between 0 and 1e6 W; write e.g. 11W or 800mW");
}

}  // namespace pirt::cli
