// What a measurement leaves to be stored, before there are statistics of it: the rows of profile.h
// are read back from these.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/profile/profile.h"
#include "characterize/statistics/statistics.h"
#include "workloads/base/time.h"
#include "workloads/model/phase.h"

namespace pirt {

/// What is written before anything is measured.
struct RunHeader {
  std::string started;  ///< ISO 8601, UTC.
  std::string platform;
  std::uint64_t seed = 0;
  std::map<std::string, std::string> environment;  ///< No empty values.
  std::vector<UnitRecord> units;
  std::string plan = {};  ///< What find_unfinished_run gives back; empty = cannot be resumed.
};

/// One row of profile_summary or condition_summary with its samples; the statistics are computed
/// when it is written, so that they always belong to them.
struct PhaseRecord {
  Phase phase = Phase::kCall;
  State state = State::kSteady;
  Origin provenance = {};
  std::vector<std::string> reasons;  ///< Never empty without samples.
  std::vector<std::string> notes;
  std::vector<Nanos> samples;
  /// Of each sample the worker process that took it, from 0. Empty = one process took all, or, in a
  /// set-up phase, which happens once in a process, each its own.
  std::vector<std::int32_t> processes = {};
  std::optional<Nanos> bound = {};  ///< What no sample can be below, where the device knows that.
  bool deterministic = false;       ///< Each sample is the figure: nothing varies.
  Condition condition = Condition::kSteady;  ///< Another one: of a call's phase, state kSteady.
  std::vector<std::string> doubts = {};
  std::vector<Nanos> cpu = {};       ///< Processor time of each sample's call; empty = not known.
  std::optional<double> taken = {};  ///< See PhaseRow.
  /// As somebody states it who keeps the samples: in place of theirs, and not below their median.
  std::optional<Nanos> p95 = {};
};

/// The process of each sample, as PhaseRecord::processes says.
[[nodiscard]] std::vector<std::int32_t> processes_of(const PhaseRecord& record);
/// A note of rows that nobody measured on this machine.
inline constexpr std::string_view kMeasuredElsewhere = "measured elsewhere";
/// Of a record with samples. What repeats exactly has an interval without width; what others took
/// of its cores may be in all of its samples, so that its interval begins below them; samples of
/// too few processes to say how these differ (few_samples) have a wide one.
[[nodiscard]] Statistics statistics_of(const PhaseRecord& record);

/// The defaults are those of model_energy, whose watts are above idle.
struct EnergyRecord {
  std::optional<double> energy_j;
  Origin provenance = Provenance::kModelled;
  std::string source;
  std::vector<std::string> reasons;  ///< Never empty without energy_j.
  std::string domain = "unit";       ///< What the meter or model covers.
  bool idle_subtracted = true;       ///< What the domain takes anyway is not in energy_j.
  std::optional<double> ci_low_j = {}, ci_high_j = {};
  std::vector<std::string> doubts = {};
};

/// UnitTimeRow with its samples.
struct UnitTimeRecord {
  std::string unit;
  UnitPhase phase = UnitPhase::kHandover;
  Nanos sleep{0};
  std::vector<std::string> reasons;  ///< Never empty without samples.
  std::vector<Nanos> samples;
  std::vector<std::string> doubts = {};
};

/// What a unit can do at most.
struct PeakRecord {
  std::string unit;
  PeakKind kind = PeakKind::kF32;
  std::optional<double> per_second;  ///< Operations or bytes, above 0.
  std::string variant;               ///< Which loop was the fastest; empty if none ran.
  Provenance provenance = Provenance::kMeasured;
  std::vector<std::string> reasons;  ///< Never empty without per_second.
  std::vector<std::string> doubts = {};
};

/// What a call computes and moves at least.
struct CallWork {
  std::optional<std::int64_t> ops;  ///< Absent where they depend on the data and nobody says how.
  std::int64_t bytes = 0;
};

/// Everything about one workload on one unit.
struct CellRecord {
  std::string workload, unit;
  std::optional<std::int64_t> ops;
  std::int64_t bytes = 0;
  std::string verification;
  std::vector<PhaseRecord> phases;
  std::optional<EnergyRecord> energy;
  std::vector<PhaseRecord> conditions = {};  ///< Of another one than kSteady.
  std::optional<std::int64_t> host_memory_bytes = {}, device_memory_bytes = {};  ///< See PhaseRow.
};

/// One worker process of a cell that is not done.
struct VisitRecord {
  std::int64_t position = 0;  ///< From 0, in order of time within the cell.
  State setup = State::kCold;
  std::string record;  ///< to_record of its JobResult.
  Nanos spent{0};      ///< What the run had taken when it ended.
};

}  // namespace pirt
