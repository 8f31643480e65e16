#include "workloads/model/peak.h"

#include <algorithm>
#include <utility>

namespace pirt {
namespace {

constexpr std::pair<PeakKind, std::string_view> kNames[] = {
    {PeakKind::kF32, "f32"},
    {PeakKind::kInt8, "int8"},
    {PeakKind::kBandwidthL2, "bandwidth_l2"},
    {PeakKind::kBandwidthMemory, "bandwidth_memory"}};

}  // namespace

std::string_view to_string(PeakKind kind) {
  return std::ranges::find(kNames, kind, &std::pair<PeakKind, std::string_view>::first)->second;
}

std::optional<PeakKind> peak_kind_from_string(std::string_view text) {
  const auto* found =
      std::ranges::find(kNames, text, &std::pair<PeakKind, std::string_view>::second);
  return found == std::end(kNames) ? std::nullopt : std::optional(found->first);
}

}  // namespace pirt
