// How figures are printed: three significant digits, the unit in the column's header, a mark for
// where a figure comes from.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"
#include "workloads/model/phase.h"

namespace pirt {

/// Three significant digits without exponent: 0.0891, 12.3, 1230. An absent figure prints as "-".
[[nodiscard]] std::string figure(double value);
[[nodiscard]] std::string figure(std::optional<double> value);
[[nodiscard]] std::string figure_ms(std::optional<Nanos> value);

/// With a sign of its unit, for prose: "89.1 us", "12.3 ms", "1.23 s".
[[nodiscard]] std::string duration_text(Nanos value);

/// "" for measured, otherwise one character, and * behind it for a mixture; `provenance_legend`
/// explains them.
[[nodiscard]] std::string mark(Origin provenance);
[[nodiscard]] std::string_view provenance_legend();

/// A figure of that provenance: mark in front.
[[nodiscard]] std::string marked(const std::string& text, Origin provenance);

/// Begins a cell that says that something is missed; pages highlight it.
inline constexpr std::string_view kMiss = "✗ ";

/// A figure of somebody's; absent = not known.
struct NamedFigure {
  std::string name;
  std::optional<double> value;
};
/// Whose figure is the least, or the greatest if @p greatest; "a = b" if they share it, "-" if none
/// is known.
[[nodiscard]] std::string best_of(const std::vector<NamedFigure>& figures, bool greatest = false);

}  // namespace pirt
