// What else holds on the machine while a row of `execute` is measured.
//
// `steady` are calls in a row with nothing beside them: profile_summary. All others are rows of
// their own (Profile::conditions, view condition_summary), so that nobody takes one for the other.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace pirt {

enum class Condition : std::uint8_t {
  kSteady,
  kColdCache,      ///< Before each call the unit's own caches were filled with other bytes,
  kColdMemory,     ///< or the last ones that it reaches, with all before them.
  kBesideMemory,   ///< A unit of the same memory streams through it meanwhile,
  kBesideCompute,  ///< or computes on what its registers hold.
};
inline constexpr std::array kAllConditions = {Condition::kSteady, Condition::kColdCache,
                                              Condition::kColdMemory, Condition::kBesideMemory,
                                              Condition::kBesideCompute};

/// "steady", "cold_cache", "cold_memory", "beside_memory", "beside_compute": `state` in the profile
/// database.
[[nodiscard]] std::string_view to_string(Condition condition);
[[nodiscard]] std::optional<Condition> condition_from_string(std::string_view text);

}  // namespace pirt
