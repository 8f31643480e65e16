// How the figure of a row is printed: "invalid" where it is none, `?` and its interval where it is
// doubted, `??` where the interval spans more than a factor of 4.
#pragma once

#include <optional>
#include <string>

#include "characterize/profile/profile.h"
#include "reports/document/figures.h"
#include "workloads/base/text/text.h"

namespace pirt {

/// "", "?" or "??".
template <typename Row>
[[nodiscard]] std::string doubt_mark(const Row& row) {
  return is_doubted(row) ? "?" : "";
}
template <>
[[nodiscard]] std::string doubt_mark(const PhaseRow& row);

/// A figure of a row, in front of which stands where it comes from, and behind it what it is worth.
template <typename Row>
[[nodiscard]] std::string shown_figure(const Row& row, const std::string& text, Origin provenance) {
  return is_used(row) ? marked(text, provenance) + doubt_mark(row) : "invalid";
}
/// The median in ms; of a doubted row with its interval: "12.1? (9.80 to 14.2)".
[[nodiscard]] std::string shown_ms(const PhaseRow& row);
/// The median in ms without; "-" where there is no row, or nobody knows its time.
[[nodiscard]] std::string median_cell(const PhaseRow* row);
/// Joules a call in mJ, as shown_ms.
[[nodiscard]] std::string shown_mj(const EnergyRow& row);
/// Median of @p row over that of @p base; absent unless both are used and that of @p base is above
/// 0.
template <typename Row>
[[nodiscard]] std::optional<double> ratio_of(const Row& row, const Row& base) {
  const bool known =
      is_used(row) && is_used(base) && row.median && base.median && *base.median > Nanos::zero();
  if (!known) return std::nullopt;
  return static_cast<double>(row.median->count()) / static_cast<double>(base.median->count());
}
/// "1.50x", "-".
[[nodiscard]] std::string times_cell(const PhaseRow* row, const PhaseRow* base);
/// "INVALID: crashed", "uncertain: contended, imprecise", "" where nothing is held against it.
template <typename Row>
[[nodiscard]] std::string judgement_text(const Row& row) {
  if (!is_used(row)) return "INVALID: " + join(row.reasons, ", ");
  return is_doubted(row) ? "uncertain: " + join(row.doubts, ", ") : "";
}

}  // namespace pirt
