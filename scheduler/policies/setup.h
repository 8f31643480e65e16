// From a platform, a profile, a mix and a mode to what a dispatcher is made of: the same for
// virtual time, live runs and the runtime.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/mix.h"
#include "scheduler/policies/policy.h"
#include "scheduler/services/faults.h"
#include "scheduler/services/redraw.h"
#include "scheduler/services/scenario.h"
#include "scheduler/services/services.h"
#include "workloads/base/time.h"

namespace pirt {

inline constexpr Nanos kDefaultDuration = std::chrono::seconds(60);

/// What Algorithms 2 and 3 do when all queues are full.
enum class Overflow : std::uint8_t {
  kHold,     ///< The task waits.
  kLiteral,  ///< As printed: the `else`.
};

/// What mode budget is for once deadlines are met; the others follow.
enum class Objective : std::uint8_t {
  kRate,     ///< Most tasks a millisecond, then least energy.
  kEnergy,   ///< Least energy, then most tasks.
  kLatency,  ///< Least latency, then most tasks.
};
[[nodiscard]] std::vector<std::string> objective_names();
[[nodiscard]] std::string_view to_string(Objective objective);
/// @throws Error{kBadInput} with the nearest name.
[[nodiscard]] Objective find_objective(const std::string& name);

struct ScheduleOptions {
  std::string mode;                  ///< A name of policies().
  std::string basic = "throughput";  ///< Fallback of mode advanced.
  std::map<std::string, int>
      weights;                   ///< By unit; empty = the platform's for the mode, else derived.
  std::optional<int> in_flight;  ///< Frames in flight of closed loops; absent = the platform's,
                                 ///< else what keeps the units busy.
  std::optional<Overflow> overflow;  ///< Absent = hold.
  std::vector<std::string> without;  ///< Units that serve nothing; they draw idle power.
  bool strict = false;               ///< Profile rows that are doubted are not used.
  /// Tasks with a nearer deadline are let in between two slices of a call, where its workload says
  /// that it can be suspended; absent = in mode budget alone.
  std::optional<bool> slices = {};
  Draw draw = Draw::kMedian;      ///< What a profile's rows take.
  std::optional<Nanos> duration;  ///< Of open loops; absent = kDefaultDuration.
  // Of mode budget.
  std::optional<Objective> objective;     ///< Absent = rate.
  std::optional<double> min_rate_per_ms;  ///< Of completed tasks, whatever the objective.
  std::optional<double> power_cap_w;      ///< In any second; see policies/power_window.h.
  bool watch_power = false;  ///< RunRecord::power_highest_w without a cap, too; in virtual time.
  std::uint64_t seed = 1;
  std::optional<Redraw> redraw = {};  ///< What calls take is redrawn.
  std::optional<Faults> faults;       ///< Calls that do not complete; absent = none.
  std::optional<std::string> trace;   ///< Path; see trace/trace_writer.h.

  /// Whether something is wanted that only mode budget gives.
  [[nodiscard]] bool has_budget() const { return objective || min_rate_per_ms || power_cap_w; }
  [[nodiscard]] ScheduleOptions without_budget() const;
};

/// What makes a dispatcher, and what it was made from.
struct ModeSetup {
  Mode mode;
  Scenario scenario;
  std::vector<std::optional<int>> slots;  ///< By unit.
  PolicySetup policy_setup;
  std::unique_ptr<Policy> policy;
  std::optional<std::string>
      weights_from;              ///< "given", "platform", "derived"; absent = no weights.
  bool in_flight_given = false;  ///< By the options or the platform.
};

/// @param platform  As @p mix, must outlive what is returned.
/// @param profile  Null = only what the platform file says.
/// @throws Error{kBadInput}: unknown mode, bad weights, a duration or in_flight below 1, a duration
/// for a mix without open loop, an overflow for a mode that has none, a least rate or a cap of
/// power for a mix that fires once, `eligible` that names nothing, a platform of more than 64
/// units, a profile of another platform, a workload that no unit (or none that the mode uses) can
/// serve: then with each unit's reason and the command that measures it.
[[nodiscard]] ModeSetup set_up_mode(const Platform& platform, const Profile* profile,
                                    const Mix& mix, const ScheduleOptions& options);

}  // namespace pirt
