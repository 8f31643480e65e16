#include "reports/document/figures.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "workloads/base/text/text.h"

namespace pirt {

std::string figure(double value) {
  if (value == 0.0) return "0";
  const int magnitude = static_cast<int>(std::floor(std::log10(std::abs(value))));
  const int decimals = std::clamp(2 - magnitude, 0, 9);
  return fmt::format("{:.{}f}", value, decimals);
}

std::string figure(std::optional<double> value) { return value ? figure(*value) : "-"; }

std::string figure_ms(std::optional<Nanos> value) { return value ? figure(to_ms(*value)) : "-"; }

std::string duration_text(Nanos value) {
  const double ns = std::abs(static_cast<double>(value.count()));
  if (ns < 1e3) return fmt::format("{} ns", value.count());
  if (ns < 1e6) return figure(to_us(value)) + " us";
  if (ns < 1e9) return figure(to_ms(value)) + " ms";
  return figure(to_s(value)) + " s";
}

std::string mark(Origin origin) {
  std::string sum = origin.mixture ? "*" : "";
  switch (origin.provenance) {
    case Provenance::kMeasured:
      return sum;
    case Provenance::kCounted:
      return "#" + sum;
    case Provenance::kModelled:
      return "~" + sum;
    case Provenance::kFitted:
      return "^" + sum;
    case Provenance::kPublished:
      return "+" + sum;
  }
  return "?";
}

std::string_view provenance_legend() {
  return "Unmarked figures are measured, on this machine unless a note says elsewhere; # counted, "
         "~ "
         "modelled, ^ fitted, + published; * a sum with stronger ones. ? uncertain, ?? by more "
         "than a factor of 4.";
}

std::string marked(const std::string& text, Origin provenance) { return mark(provenance) + text; }

std::string best_of(const std::vector<NamedFigure>& figures, bool greatest) {
  std::optional<double> best;
  std::vector<std::string> names;
  for (const auto& [name, value] : figures) {
    if (!value) continue;
    if (!best || (greatest ? *value > *best : *value < *best)) {
      best = value;
      names.clear();
    }
    if (*value == *best) names.push_back(name);
  }
  return names.empty() ? "-" : join(names, " = ");
}

}  // namespace pirt
