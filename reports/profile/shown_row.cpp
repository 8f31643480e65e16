#include "reports/profile/shown_row.h"

#include <fmt/core.h>

namespace pirt {
namespace {

std::string interval_text(std::optional<double> low, std::optional<double> high) {
  return low && high ? fmt::format(" ({} to {})", figure(*low), figure(*high)) : "";
}

std::optional<double> in_ms(std::optional<Nanos> time) {
  return time ? std::optional(to_ms(*time)) : std::nullopt;
}

}  // namespace

template <>
std::string doubt_mark(const PhaseRow& row) {
  return row.is_wild() ? "??" : is_doubted(row) ? "?" : "";
}

std::string shown_ms(const PhaseRow& row) {
  const std::string text = shown_figure(row, figure_ms(row.median), row.provenance);
  return is_doubted(row) ? text + interval_text(in_ms(row.ci_low), in_ms(row.ci_high)) : text;
}

std::string median_cell(const PhaseRow* row) {
  if (row == nullptr || !row->unknown().empty()) return "-";
  return shown_figure(*row, figure_ms(row->median), row->provenance);
}

std::string times_cell(const PhaseRow* row, const PhaseRow* base) {
  if (row == nullptr || base == nullptr) return "-";
  const auto ratio = ratio_of(*row, *base);
  return ratio ? fmt::format("{:.2f}x", *ratio) : "-";
}

std::string shown_mj(const EnergyRow& row) {
  if (!row.energy_j) return "invalid";
  const std::string text = shown_figure(row, figure(*row.energy_j * 1e3), row.provenance);
  if (!is_doubted(row) || !row.ci_low_j || !row.ci_high_j) return text;
  return text + interval_text(*row.ci_low_j * 1e3, *row.ci_high_j * 1e3);
}

}  // namespace pirt
