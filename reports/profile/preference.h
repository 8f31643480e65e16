// Which unit is preferable for each workload, by time and by energy: the paper's Table III for the
// machine of a profile.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/profile/profile.h"

namespace pirt {

/// One unit's figure for a workload, in the unit of the ranking (ms or J a call).
struct RankedUnit {
  std::string unit;
  double value = 0;
  double low = 0;  ///< 95 % confidence interval of the median; equal to value where there is none.
  double high = 0;
  Origin provenance = Provenance::kMeasured;
  std::string doubt = {};  ///< "?", "??" of a row that is doubted.
};

/// Units of one workload, best first; only those with a valid figure.
struct Ranking {
  std::vector<RankedUnit> units;

  /// The best unit; "a = b" if the intervals of the two best overlap (a tie is not a preference);
  /// "-" if there is none.
  [[nodiscard]] std::string preferable() const;
  /// How many times the second best takes what the best takes; absent if there is no second.
  [[nodiscard]] std::optional<double> advantage() const;
};

struct Preference {
  std::string workload;
  Ranking by_time;    ///< Phase `call`, ms: what offloading costs each time, transfers included.
  Ranking by_energy;  ///< J a call.
  /// What the paper's Table III prefers, for its six vision workloads.
  std::optional<std::string> paper_time, paper_energy;
};

/// What the paper prefers for one of its vision workloads.
struct PaperPreference {
  std::string_view workload, time, energy;
};
/// @source Paper, Table III, in its order.
[[nodiscard]] std::span<const PaperPreference> paper_preferences();

/// In the profile's order of workloads.
[[nodiscard]] std::vector<Preference> preferences(const Profile& profile);

}  // namespace pirt
