// How the figure of a row is printed: "invalid" where it is none, `?` and its interval where it is
// doubted, `??` where the interval spans more than a factor of 4.
#pragma once

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
/// Joules a call in mJ, likewise.
[[nodiscard]] std::string shown_mj(const EnergyRow& row);
/// "INVALID: crashed", "uncertain: contended, imprecise", "" where nothing is held against it.
template <typename Row>
[[nodiscard]] std::string judgement_text(const Row& row) {
  if (!is_used(row)) return "INVALID: " + join(row.reasons, ", ");
  return is_doubted(row) ? "uncertain: " + join(row.doubts, ", ") : "";
}

}  // namespace pirt
