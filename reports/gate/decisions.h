// What another profile changes in the decisions: which unit is preferable for each workload, and
// what a robot's mix then costs in each mode. Virtual time only; nothing is measured.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "reports/profile/profile_diff.h"
#include "scheduler/mix/mix.h"
#include "scheduler/record/run_record.h"

namespace pirt {

/// A workload whose preferable unit is another one now.
struct Flip {
  std::string workload;
  std::string by;               ///< "time" or "energy".
  std::string base, candidate;  ///< Units.
  /// Whether the intervals of the two units are apart in both profiles: only then is it more than
  /// two equals changing places. Never for energy, which has no interval.
  bool clear = false;
};

/// One mode on both profiles; a run is absent where the mode cannot run, with the reason.
struct ModeCost {
  std::string mode;
  std::optional<RunRecord> base, candidate;
  std::string reason;
};

struct Decisions {
  std::string mix;
  std::vector<Flip> flips;
  std::vector<ModeCost> modes;
};

/// Preferable by time: the least median of `call`; by energy: the least joules a call. Only units
/// that both profiles have valid rows of.
[[nodiscard]] std::vector<Flip> find_flips(const Profile& base, const Profile& candidate);

/// Runs the paper's four modes on both profiles.
[[nodiscard]] Decisions compare_decisions(const Profile& base, const Profile& candidate,
                                          const Platform& platform, const Mix& mix);

}  // namespace pirt
