// What it costs to serve a workload on a unit: stages, energy and where those figures come from.
//
// Stages come from the platform file, or for measured units from a profile; whatever cannot be used
// says why.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/profile.h"
#include "scheduler/mix/task.h"
#include "scheduler/services/conditions.h"

namespace pirt {

struct ServiceStage {
  std::string name;
  std::optional<UnitId> on;  ///< Absent = pure delay.
  Distribution time;         ///< Server time at rate 1, before the scale.
  double scale = 1;          ///< Stretches the time; the stage's energy stays.
  /// Of the time before the scale, what draws active_w: joules add up, so that a stage whose time
  /// is a median or a percentile draws for its mean.
  double energy_scale = 1;
  std::optional<Nanos> p95 = {};  ///< Of a measured row, before the scale, whatever is drawn of it.

  [[nodiscard]] Nanos mean() const;  ///< Scaled.
  /// Before the scale: what 95 of 100 do not exceed; the highest of what is modelled.
  [[nodiscard]] Nanos usual() const;
};

struct Service {
  std::vector<ServiceStage> stages;
  Origin time_provenance = Provenance::kModelled;  ///< Of the sum of its stages.
  Origin energy_provenance = Provenance::kModelled;
  /// Of a unit with contexts: what loading the workload takes; absent = the unit has none.
  std::optional<Nanos> prepare;
  /// Joules a call beyond busy servers and links: call_j, operations, bytes.
  double extra_j = 0;
  /// A meter's joules a call; stands in place of all modelled energy of a call.
  std::optional<double> metered_j;
  /// What preparing the workload takes of the unit's memory; absent where nobody has measured it.
  std::optional<std::int64_t> memory_bytes = {};
  bool of_rows = false;  ///< Its time is that of rows of a profile.
  /// Where the 95 % interval of what a call takes begins and ends, as parts of its median.
  struct Spread {
    double low = 1, high = 1;
  };
  Spread spread = {};
  Spread joules = {};                    ///< The same of metered_j, as parts of it.
  std::vector<std::string> doubts = {};  ///< Of its rows, each once (judgement.h).
  double taken = 0;  ///< The share of a call's time that others had its cores when it was measured.
  bool wild = false;  ///< PhaseRow::is_wild of one of its rows.
  /// False: no meter and no platform says what a call draws, and nobody may take it for nothing.
  bool energy_known = true;
  /// Of a stage that is the phase `execute` of a measured row; absent = it takes its time whatever
  /// else happens.
  std::optional<CallConditions> conditions = std::nullopt;
  /// Of the longest stage on the unit itself, the parts after each of which but the last the call
  /// can be suspended, as shares of its time; empty = it cannot.
  std::vector<double> slices = {};

  /// Joules of a call beyond busy servers and links.
  [[nodiscard]] double fixed_j() const { return metered_j.value_or(extra_j); }
  /// All stages, scaled.
  [[nodiscard]] Nanos total() const;
};

/// One cell: the service, or why there is none.
struct ServiceEntry {
  std::optional<Service> service;
  std::string reason;  ///< Empty if there is a service.
};

struct ServiceTable {
  std::vector<std::string> workloads;              ///< By WorkloadId.
  std::vector<std::vector<ServiceEntry>> entries;  ///< [workload][unit]
  std::vector<std::string> warnings;
  std::vector<UnitConditions> units;  ///< By UnitId; empty where no profile has any.

  [[nodiscard]] const Service* find(WorkloadId workload, UnitId unit) const {
    const auto& entry = entries[workload][unit];
    return entry.service ? &*entry.service : nullptr;
  }
  [[nodiscard]] UnitMask units_of(WorkloadId workload) const;
};

/// Whether calls there may be suspended between two slices: what runs on the unit has one thing
/// under way, which is here, and holds all programs at once.
[[nodiscard]] bool can_suspend_calls(const UnitModel& unit);

/// What 95 of 100 do not exceed; the value itself, or the highest, of what is modelled.
[[nodiscard]] Nanos usual_worst_of(const Distribution& time);

/// Which program a unit with contexts loads for the workload. Programs of several workloads come
/// first, then each workload is its own.
[[nodiscard]] std::uint32_t context_of(const Contexts& contexts, WorkloadId workload,
                                       const std::string& name);

/// Times of a call by workload and unit that no platform and no profile has.
using GivenServices = std::map<std::string, std::map<UnitId, Nanos>>;

/// What a measured row says a call takes; its joules are those of its mean time all the same.
/// Stages of the platform file are as they stand there.
enum class Draw : std::uint8_t {
  kMedian,
  kP95,
  kSamples,  ///< One of its samples, each alike; phases of a call are drawn apart.
};
[[nodiscard]] std::vector<std::string> draw_names();
/// @throws Error{kBadInput} with the nearest name.
[[nodiscard]] Draw find_draw(const std::string& name);
[[nodiscard]] std::string_view to_string(Draw draw);

struct ServiceOptions {
  GivenServices given;  ///< Of the mix's own tasks; in place of a workload of the catalog.
  std::map<std::string, double> stage_scale;  ///< "unit.stage" -> factor.
  std::vector<std::string> without;           ///< Units that serve nothing.
  bool strict = false;                        ///< Rows that are doubted are not used either.
  std::optional<Role> only = {};              ///< The role whose units alone the mode uses.
  Draw draw = Draw::kMedian;                  ///< kSamples: the profile's samples have been read.
  bool slices = false;                        ///< Calls are suspended where their workloads say so.
};

/// @param profile    Null = only what the platform file says.
/// @param workloads  Names of the catalog or of options.given, each once.
/// @throws Error{kBadInput} if the profile is of another platform, or there is no unit to leave out
/// of that name.
[[nodiscard]] ServiceTable resolve_services(const Platform& platform, const Profile* profile,
                                            const std::vector<std::string>& workloads,
                                            const ServiceOptions& options);

}  // namespace pirt
