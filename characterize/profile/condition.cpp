#include "characterize/profile/condition.h"

#include <algorithm>

namespace pirt {
namespace {

constexpr std::array<std::string_view, kAllConditions.size()> kConditionNames = {
    "steady", "cold_cache", "cold_memory", "beside_memory", "beside_compute"};

}  // namespace

std::string_view to_string(Condition condition) {
  return kConditionNames[static_cast<std::size_t>(condition)];
}

std::optional<Condition> condition_from_string(std::string_view text) {
  const auto found = std::ranges::find(kConditionNames, text);
  if (found == kConditionNames.end()) return std::nullopt;
  return static_cast<Condition>(found - kConditionNames.begin());
}

}  // namespace pirt
