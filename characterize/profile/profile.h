// What is known of each (workload, unit), as read from a profile database: the rows of its stable
// views.
//
// Scheduler and reports see this and never SQLite (store/).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/profile/condition.h"
#include "characterize/profile/judgement.h"
#include "characterize/profile/unit_phase.h"
#include "workloads/base/time.h"
#include "workloads/model/peak.h"
#include "workloads/model/phase.h"

namespace pirt {

/// A row of view profile_summary; of another condition than kSteady, of condition_summary.
struct PhaseRow {
  std::int64_t run_id = 0;
  std::string platform, workload, unit, backend;
  Phase phase = Phase::kCall;
  State state = State::kSteady;
  Condition condition = Condition::kSteady;
  Origin provenance = {};
  std::vector<std::string> reasons;  ///< Why it is no figure (judgement.h).
  std::vector<std::string> notes;
  std::int64_t samples = 0;
  std::optional<Nanos> median, mad, p95, p99, ci_low, ci_high;  ///< Absent if there are no samples.
  std::optional<std::int64_t> ops;
  std::int64_t bytes = 0;
  std::int64_t processes = 0;            ///< Fresh worker processes that the samples come from.
  std::vector<std::string> doubts = {};  ///< Why its interval is wide.
  std::optional<Nanos> bound = std::nullopt;  ///< The least that the phase can take, where known.
  /// Mean of the process means (statistics.h), for what adds up; absent if there are no samples. In
  /// no view: read from the samples.
  std::optional<Nanos> mean = std::nullopt;
  std::optional<Nanos> cpu = std::nullopt;     ///< Processor time of a call on the host's cores.
  std::optional<double> taken = std::nullopt;  ///< The share of its time that others had its cores.
  std::optional<std::int64_t> host_memory_bytes = std::nullopt;    ///< What a call's process has,
  std::optional<std::int64_t> device_memory_bytes = std::nullopt;  ///< and its device.
  // Its samples as they were taken, and of each the process that took it; empty until
  // ProfileReader::read_samples.
  std::vector<Nanos> values;
  std::vector<std::int32_t> value_processes;
  std::vector<std::int64_t> pooled_runs = {};  ///< Others whose samples were added to these.

  /// Whether the figure repeats exactly, so that one sample is all there is to know.
  [[nodiscard]] bool is_deterministic() const;
  /// Why nobody knows the phase's time; empty if there is one, or it was not to be had otherwise.
  [[nodiscard]] std::string unknown() const;
  /// Processes of its cell that ended with an error, as its notes say.
  [[nodiscard]] int failed_processes() const;
  /// Whether it is doubted, and its interval spans so much that it tells nothing of the order of
  /// units.
  [[nodiscard]] bool is_wild() const;
  /// With its state, and without its condition: "execute", "prepare cold".
  [[nodiscard]] std::string phase_name() const;
};

/// A note of rows whose figure repeats exactly.
inline constexpr std::string_view kDeterministic = "deterministic";
/// What the note of rows begins with of whose cell some process failed; their number follows.
inline constexpr std::string_view kFailedProcesses = "failed_processes: ";
/// What the reason of a row begins with whose phase nobody knows the time of.
inline constexpr std::string_view kUnknownPhase = "unknown: ";

/// A row of view energy_summary: joules a call.
struct EnergyRow {
  std::int64_t run_id = 0;
  std::string workload, unit;
  std::optional<double> energy_j;
  Origin provenance = Provenance::kModelled;
  std::string source;  ///< "model: active_w 10 W x call", "rapl: package-0".
  std::vector<std::string> reasons;
  std::string domain = {};       ///< What the meter or model covers: "unit", "package".
  bool idle_subtracted = false;  ///< What the domain takes anyway is not in energy_j.
  std::optional<double> ci_low_j = std::nullopt, ci_high_j = std::nullopt;
  std::vector<std::string> doubts = {};
};

/// A row of view unit_time_summary: what a unit that is a thread of the host takes beside its
/// calls.
struct UnitTimeRow {
  std::int64_t run_id = 0;
  std::string unit, backend;
  UnitPhase phase = UnitPhase::kHandover;
  /// It had nothing to do for so long; a hand-over after 0 is from the end of one call to the
  /// beginning of the next, which waits.
  Nanos sleep{0};
  std::vector<std::string> reasons;
  std::int64_t samples = 0;
  std::optional<Nanos> median, mad, p95, p99, ci_low, ci_high;  ///< Absent if there are no samples.
  std::vector<Nanos> values;  ///< Its samples; empty until ProfileReader::read_samples.
  std::vector<std::string> doubts = {};
};

/// What a unit can do at most: operations (f32, int8) or bytes (bandwidth) a second.
struct PeakRow {
  std::int64_t run_id = 0;
  std::string unit;
  PeakKind kind = PeakKind::kF32;
  std::optional<double> per_second;
  std::string variant;  ///< Which loop was the fastest.
  Provenance provenance = Provenance::kMeasured;
  std::vector<std::string> reasons;
  std::vector<std::string> doubts = {};
};

struct CellName {
  std::string workload, unit;
  friend bool operator==(const CellName&, const CellName&) = default;
};

/// A device that a unit of the run computed on.
struct UnitRecord {
  std::string unit, backend, device;
  bool device_is_cpu = false;
  std::vector<int> cores;
};

/// Facts "unit.NAME.own_cache_bytes", "unit.NAME.last_cache_bytes" of a run: what rows of
/// kColdCache and of kColdMemory found full of other bytes.
inline constexpr std::string_view kOwnCacheBytes = "own_cache_bytes";
inline constexpr std::string_view kLastCacheBytes = "last_cache_bytes";

struct RunInfo {
  std::int64_t run_id = 0;
  std::string started;   ///< ISO 8601, UTC.
  std::string finished;  ///< Empty if the run did not end.
  std::string platform;
  std::uint64_t seed = 0;
  std::map<std::string, std::string> environment;  ///< "cpu_model", "kernel", "governor", ...
  std::set<std::string> identity =
      {};  ///< Keys of those facts that must match for runs to compare.
  std::vector<UnitRecord> units;
  std::vector<CellName> planned = {};  ///< The cells that it was to measure; empty = not known.

  /// The fact as a number; absent where there is none, or it is none.
  [[nodiscard]] std::optional<double> figure(const std::string& key) const;
};

/// What a unit's meter showed of its device, over the units that have the same meter, so that a
/// platform's sum is what was measured.
struct StandingPower {
  double idle_w = 0;                  ///< At rest: nobody has it open.
  std::optional<double> held_w = {};  ///< Of a GPU: what it draws more while it is open.
};
/// By the facts "meter.UNIT" of @p run; absent where its meter showed no idle power, or it has
/// none.
[[nodiscard]] std::optional<StandingPower> standing_power(const RunInfo& run,
                                                          const std::string& unit);

struct Profile {
  std::string path;
  std::vector<RunInfo> runs;  ///< Those that rows come from; newest first.
  std::vector<PhaseRow>
      phases;  ///< For each (workload, unit): the newest complete cell's, or else a begun one's.
  /// Of all conditions but kSteady; for each (workload, unit): those of the newest cell that has
  /// any.
  std::vector<PhaseRow> conditions;
  /// For each unit: the newest run's that has any, by phase and sleep.
  std::vector<UnitTimeRow> unit_times;
  std::vector<EnergyRow> energies;     ///< For each (workload, unit): as `phases`.
  std::vector<PeakRow> peaks;          ///< For each (unit, kind): the newest run's row.
  std::vector<PeakRow> earlier_peaks;  ///< Those of the runs before.

  /// Null if there is no such row.
  [[nodiscard]] const PhaseRow* find(std::string_view workload, std::string_view unit, Phase phase,
                                     State state = State::kSteady) const;
  /// Of `execute`; null for kSteady, too.
  [[nodiscard]] const PhaseRow* find_condition(std::string_view workload, std::string_view unit,
                                               Condition condition) const;
  [[nodiscard]] const EnergyRow* find_energy(std::string_view workload,
                                             std::string_view unit) const;
  [[nodiscard]] const PeakRow* find_peak(std::string_view unit, PeakKind kind) const;
  [[nodiscard]] const UnitRecord* find_unit(std::string_view unit) const;
  /// Null if no row comes from it.
  [[nodiscard]] const RunInfo* find_run(std::int64_t run_id) const;
  /// In order of first appearance.
  [[nodiscard]] std::vector<std::string> workloads() const;
  [[nodiscard]] std::vector<std::string> units() const;
  /// Of the newest run.
  [[nodiscard]] const std::string& platform() const;
};

}  // namespace pirt
