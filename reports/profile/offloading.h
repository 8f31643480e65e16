// What offloading costs with set-up included (the paper's Observation Three and Fig. 7), and from
// how many calls on one unit beats another.
//
// Pure arithmetic on a profile's medians and their intervals; a process that does nothing but these
// calls is supposed.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "characterize/profile/profile.h"

namespace pirt {

/// What a number of calls costs.
struct CallCosts {
  Nanos first{0};    ///< From nothing to the end of the first call.
  Nanos further{0};  ///< Each call after it.

  /// Time from nothing to the end of the @p calls-th call, at least one.
  [[nodiscard]] Nanos total(std::int64_t calls) const;
  friend bool operator==(const CallCosts&, const CallCosts&) = default;
};

/// One workload on one unit, its set-up cold or warm. Medians of valid rows.
struct OffloadingCost {
  std::string workload, unit;
  State state = State::kCold;
  Nanos device_init{0};
  Nanos prepare{0};  ///< Ends with one completed call.
  Nanos call{0};
  std::optional<Nanos> upload, launch, execute, download;  ///< Of one call; as far as the unit has
                                                           ///< them.
  Origin provenance = Provenance::kMeasured;               ///< Of the sum of its times.
  std::string doubt = {};  ///< "?", "??": the most that one of its three rows is doubted.
  /// With device_init, prepare and call at the lower and at the upper ends of their 95 % intervals;
  /// absent if one has no interval.
  std::optional<CallCosts> least, most;

  /// Device and kernel prepared, before the first call; not below 0.
  [[nodiscard]] Nanos set_up() const;
  [[nodiscard]] CallCosts calls() const { return {device_init + prepare, call}; }
};

struct MissingCost {
  std::string workload, unit;
  State state = State::kCold;
  std::string reason;  ///< "prepare is not valid: few_samples".
};

struct OffloadingCosts {
  std::vector<OffloadingCost> costs;  ///< By workload, unit, cold before warm, as the profile has
                                      ///< them.
  std::vector<MissingCost> missing;   ///< What the profile has rows of, but no costs follow from.
  [[nodiscard]] const OffloadingCost* find(std::string_view workload, std::string_view unit,
                                           State state) const;
};

[[nodiscard]] OffloadingCosts offloading_costs(const Profile& profile);

/// For which numbers of calls one unit is faster than another, set-up included.
struct Crossover {
  enum class Kind : std::uint8_t {
    kNever,      ///< Not for any number.
    kFromFirst,  ///< For every number.
    kFrom,       ///< From `calls` on, at least 2.
    kUpTo,       ///< Up to `calls` only: its set-up is shorter, its call is longer.
  };
  Kind kind = Kind::kNever;
  std::int64_t calls = 0;  ///< kFrom and kUpTo.
  friend bool operator==(const Crossover&, const Crossover&) = default;
};

/// When @p b takes strictly less time than @p a. Exact, in whole nanoseconds.
[[nodiscard]] Crossover crossover(const CallCosts& a, const CallCosts& b);

/// Between which crossovers the true one lies.
struct CrossoverRange {
  Crossover
      soonest;       ///< With every figure at the end of its interval that favours the second unit,
  Crossover latest;  ///< and the first.
  friend bool operator==(const CrossoverRange&, const CrossoverRange&) = default;
};

/// Wider than 95 %, since all figures stand at their ends at once. Absent without the intervals.
[[nodiscard]] std::optional<CrossoverRange> crossover_range(const OffloadingCost& a,
                                                            const OffloadingCost& b);

/// Whether calls on @p b take less time than on @p a once both are set up; nothing where their
/// intervals overlap, or, without intervals, where the medians are equal.
[[nodiscard]] std::optional<bool> is_faster_call(const OffloadingCost& a, const OffloadingCost& b);

}  // namespace pirt
