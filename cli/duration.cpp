#include "cli/duration.h"

#include <array>
#include <charconv>
#include <optional>
#include <string_view>
#include <utility>

#include "workloads/base/error.h"

namespace pirt::cli {
namespace {

/// A finite number at the front of @p text; the rest is left in @p rest.
std::optional<double> leading_number(std::string_view text, std::string_view& rest) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || !std::isfinite(value)) return std::nullopt;
  rest = text.substr(static_cast<std::size_t>(end - text.data()));
  return value;
}

}  // namespace

Nanos parse_duration(const std::string& text) {
  constexpr std::array<std::pair<std::string_view, double>, 7> kUnits = {{{"", 1.0},
                                                                          {"s", 1.0},
                                                                          {"ms", 1e-3},
                                                                          {"us", 1e-6},
                                                                          {"min", 60.0},
                                                                          {"h", 3600.0},
                                                                          {"d", 86400.0}}};
  std::string_view unit;
  if (const auto value = leading_number(text, unit)) {
    for (const auto& [name, seconds] : kUnits) {
      const double total = *value * seconds;
      if (unit == name && total >= 1e-9 && total <= 10 * 366 * 86400.0) return from_s(total);
    }
  }
  throw_bad_input("'" + text + "' is not a duration; write e.g. 60s, 500ms or 2min");
}

double parse_fraction(const std::string& text) {
  std::string_view unit;
  if (const auto value = leading_number(text, unit)) {
    const double fraction = unit == "%" ? *value / 100 : *value;
    if ((unit == "%" || unit.empty()) && fraction > 0 && fraction <= 1) return fraction;
  }
  throw_bad_input("'" + text + "' is not a fraction between 0 and 1; write e.g. 2% or 0.02");
}

}  // namespace pirt::cli
