#include "characterize/profile/unit_phase.h"

#include <algorithm>

namespace pirt {
namespace {

constexpr std::array<std::string_view, kAllUnitPhases.size()> kUnitPhaseNames = {
    "handover", "leave", "reread", "reread_cold"};

}  // namespace

std::string_view to_string(UnitPhase phase) {
  return kUnitPhaseNames[static_cast<std::size_t>(phase)];
}

std::optional<UnitPhase> unit_phase_from_string(std::string_view text) {
  const auto found = std::ranges::find(kUnitPhaseNames, text);
  if (found == kUnitPhaseNames.end()) return std::nullopt;
  return static_cast<UnitPhase>(found - kUnitPhaseNames.begin());
}

}  // namespace pirt
