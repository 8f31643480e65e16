// The paper's Table IV for every workload: computed here or in the cloud, in time and in what it
// costs the robot, and how fast the link has to be for that.
//
// What the robot pays for a call elsewhere is its radio, while it sends and receives: active_w of
// the cloud's unit for the phases upload and download, active_w of the unit's link for bytes /
// bandwidth, or the joules a call that the platform states. Waiting for the reply costs nothing
// beyond idle power, which is drawn either way.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "reports/document/table.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// A call somewhere.
struct CallThere {
  std::string unit;
  Nanos time{0};
  std::optional<double> energy_j;  ///< Absent where nobody knows it.
  Origin time_from, energy_from;
};

struct OffloadChoice {
  std::string workload;
  CallThere fastest;                ///< Of the robot's own units,
  std::optional<CallThere> frugal;  ///< and the one that takes the least joules, if any is known.
  CallThere cloud;
  std::optional<Nanos>
      cloud_worst;         ///< p99 of what was measured, the upper end of what is modelled.
  std::int64_t bytes = 0;  ///< Inputs and outputs, lists as if they were full.
  Nanos fixed{0};          ///< Of the cloud's call what no bandwidth changes.
  std::optional<double>
      radio_w;         ///< While it sends and receives; absent = joules are stated a call.
  double fixed_j = 0;  ///< Of the call's joules, what does not follow from radio_w.

  [[nodiscard]] bool cloud_is_faster() const { return cloud.time < fastest.time; }
  /// Absent where either is not known.
  [[nodiscard]] std::optional<bool> cloud_is_frugal() const;
  /// From which bandwidth on, in Mbit/s, the cloud takes less time, or fewer joules, than the best
  /// unit here; absent = at none, or nobody knows.
  [[nodiscard]] std::optional<double> break_even_time() const;
  [[nodiscard]] std::optional<double> break_even_energy() const;
};

struct OffloadChoices {
  std::vector<OffloadChoice> choices;  ///< By workload, as the profile has them.
  std::vector<std::string> left_out;   ///< Workloads that lack one side, with the reason.
};

/// @throws Error{kBadInput} if the platform has no unit of role cloud.
[[nodiscard]] OffloadChoices offload_choices(const Profile& profile, const Platform& platform);

/// With the paper's row behind AlexNet's, or at the end.
[[nodiscard]] Table offload_table(const OffloadChoices& choices, const Platform& platform);
/// Key "offload".
[[nodiscard]] Json offload_json(const OffloadChoices& choices);

}  // namespace pirt
