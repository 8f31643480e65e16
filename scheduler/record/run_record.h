// The result of one run of a mix: what `pirt schedule --json` writes and reports read.
//
// Values are in the unit of their name, as in the file. What does not apply to a run is absent,
// never 0.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "workloads/base/text/json.h"

namespace pirt {

struct UnitResult {
  std::string unit;
  std::string role;
  std::optional<std::string> backend;  ///< Of measured units.
  std::optional<std::string> device;   ///< What computed, as the profile names it.
  std::optional<bool> device_is_cpu;   ///< The device computes on the host's own cores.
  /// Live, if the unit tells time by a clock of its own: its figures here are what the machine
  /// took.
  std::optional<bool> own_clock;
  /// Live, of a unit that computes elsewhere: the way there, as it was measured while it ran.
  std::optional<double> round_trip_ms, link_mbit_s;
  std::optional<std::int64_t> late_replies;  ///< That nobody waited for any more.
  std::vector<std::string>
      provenance;  ///< Of the times of the services that the run could use, each once.
  std::vector<std::string> energy_provenance;  ///< Of their energy.
  /// Whether one of these is a sum of several provenances; absent if none is.
  std::optional<bool> mixture, energy_mixture;
  /// Of a unit with contexts: how often it loaded another one, and the part of busy_s that it took.
  std::optional<std::int64_t> prepares;
  std::optional<double> prepare_s;
  std::int64_t completed = 0;
  std::optional<double>
      mean_latency_ms;  ///< Dispatch to completion. Absent if it completed nothing.
  std::optional<double> p99_latency_ms;
  double busy_s = 0;                  ///< Server-seconds.
  std::optional<double> utilization;  ///< busy_s over servers x makespan.
  /// Its share; a link's counts for the unit that used it. Absent where nobody knows what the unit
  /// draws.
  std::optional<double> energy_j;
  friend bool operator==(const UnitResult&, const UnitResult&) = default;
};

struct PipelineResult {
  std::string pipeline;
  std::int64_t fired = 0;
  std::int64_t completed = 0;   ///< Firings of which every task completed.
  std::int64_t dropped = 0;     ///< No image buffer, or a task was dropped, expired or failed.
  std::int64_t unfinished = 0;  ///< The others: fired = completed + dropped + unfinished.
  /// Of the dropped ones, those that no earlier firing had made data for. Absent where none is
  /// read.
  std::optional<std::int64_t> no_predecessor;
  std::optional<bool> never_ran;  ///< It fired, and no task of it was ever begun; else absent.
  /// Of the unfinished ones, those that came more than a period ago, and their deadline if that is
  /// later. Open loops only.
  std::optional<std::int64_t> queued;
  std::optional<bool> real_time;  ///< Absent in records of before; then it is.
  std::optional<double> rate_hz;  ///< Completed firings a second. Absent if no time passed.
  std::optional<double> p50_ms, p95_ms,
      p99_ms;  ///< Firing to last completion. Absent if none completed.
  std::optional<double> deadline_ms;
  /// Completed late, or unfinished when the deadline had passed. Absent without a deadline.
  std::optional<std::int64_t> deadline_misses;
  // Of mode budget: what a firing takes at most, if no call takes longer than the plan's worst, and
  // whether that is no longer than the deadline; or why nothing is said.
  std::optional<double> response_bound_ms;
  std::optional<bool> guaranteed;
  std::optional<std::string> not_analysed;
  friend bool operator==(const PipelineResult&, const PipelineResult&) = default;
};

/// A figure of the profile that the run rests on, and that is uncertain.
struct DoubtedFigure {
  std::string workload, unit;
  std::vector<std::string> doubts;
  double low = 1, high = 1;     ///< Its 95 % interval, as parts of it.
  std::optional<double> taken;  ///< The share of its time that others had its cores.
  std::optional<bool> wild;     ///< Used, since nothing else serves the workload.
  friend bool operator==(const DoubtedFigure&, const DoubtedFigure&) = default;
};

/// Calls of one workload on one unit: how long each held its unit. In virtual time that is its
/// stages, with what other calls made it wait within them; live what the call itself took. Without
/// what preparing its kernel took where that was not there.
struct CallResult {
  std::string workload, unit;
  std::int64_t completed = 0;  ///< At least 1: others have no entry.
  double p50_ms = 0, p95_ms = 0;
  /// Medians, of live calls alone; `launch_ms` where the unit stamps it.
  std::optional<double> upload_ms = {}, launch_ms = {}, execute_ms = {}, download_ms = {};
  friend bool operator==(const CallResult&, const CallResult&) = default;
};

/// What no scheduler could beat on this platform with these services; see bounds/bounds.h.
struct RunBounds {
  std::optional<double> throughput_per_ms;  ///< At most.
  std::optional<double> energy_j;           ///< At least, for what completed in this makespan.
  std::optional<double> makespan_s;         ///< At least. Closed loops only.
  std::map<std::string, double> critical_path_ms;  ///< At least, by pipeline: latency of a firing.
  friend bool operator==(const RunBounds&, const RunBounds&) = default;
};

/// reached / bound - 1: below 0 for what should be high, above 0 for what should be low. Absent
/// without both.
[[nodiscard]] std::optional<double> gap(std::optional<double> reached, std::optional<double> bound);

/// What a static plan laid down for one task.
struct PlanRow {
  std::string pipeline, task, unit;
  double start_ms = 0, finish_ms = 0;
  friend bool operator==(const PlanRow&, const PlanRow&) = default;
};

/// Where 95 % of what a figure may be lies.
struct FigureInterval {
  double low = 0, high = 0;
  friend bool operator==(const FigureInterval&, const FigureInterval&) = default;
};

/// What mode budget might have followed, as it ran in virtual time before.
struct TriedPlan {
  std::string name;
  std::int64_t late = 0;                  ///< Of real-time firings: dropped and queued ones too.
  double rate_per_ms = 0, energy_mj = 0;  ///< Energy of a task.
  double latency_ms = 0;                  ///< Of a firing, to its end.
  bool taken = false;
  friend bool operator==(const TriedPlan&, const TriedPlan&) = default;
};

struct RunRecord {
  static constexpr int kSchemaVersion = 2;

  std::string mode;
  std::optional<std::string> basic;  ///< Of mode advanced.
  std::optional<std::string>
      overflow;  ///< "hold" or "literal", where the algorithm has an overflow.
  std::string platform;
  /// Where these were read from, by its absolute path; absent = shipped, and in records of before.
  std::optional<std::string> platform_file, mix_file;
  std::vector<std::string> settings;        ///< Of the platform, by the user: "cpu.active_w=15".
  std::optional<std::string> assumptions;   ///< Of the platform; what modelled energy rests on.
  std::optional<std::string> profile;       ///< Path, if one was used.
  std::optional<std::string> profile_file;  ///< The same, absolute.
  /// Of the platform's text and of the runs that the profile's rows are of: what a name and a path
  /// do not tell. Absent in records of before.
  std::optional<std::string> platform_hash, profile_hash;
  /// Flags by which units, rows or calls are others: "--without gpu", "--strict", "--faults ...".
  std::vector<std::string> besides;
  std::optional<bool> slices;       ///< As it was asked for; see ScheduleOptions.
  std::optional<std::string> draw;  ///< What its rows took; see Draw.
  std::string mix;
  std::string time = "virtual";  ///< Or "live".
  // Of live runs.
  std::optional<double> set_up_s;       ///< Devices and kernels, before the first firing.
  std::optional<double> first_call_ms;  ///< Of the first task that completed.
  std::uint64_t seed = 1;
  std::optional<double> duration_s;  ///< Open loops only.
  std::optional<int> in_flight;      ///< Closed loops only.

  // Of mode budget.
  std::optional<std::string> objective;   ///< "rate", "energy", "latency".
  std::optional<double> min_rate_per_ms;  ///< That was wanted.
  std::optional<double> power_cap_w;      ///< In any second.
  std::optional<std::int64_t> over_cap;   ///< Tasks with a deadline that were begun beyond it.
  std::optional<double> power_highest_w;  ///< Of any second, with a cap, in virtual time.
  std::vector<TriedPlan> tried;           ///< What it might have followed.

  /// How often calls were suspended for more urgent ones; absent if they never were.
  std::optional<std::int64_t> suspensions;

  // Of static plans of a mix that fires once.
  std::optional<double> planned_makespan_s;
  std::vector<PlanRow> plan;  ///< In the mix's order.

  /// With an open loop the duration, at which all is counted; else to the last completion.
  double makespan_s = 0;
  std::optional<double> drain_s;  ///< From then to the last completion. Open loops only.
  // Tasks: submitted = completed + dropped + expired + failed + queued.
  std::int64_t submitted = 0, completed = 0, dropped = 0, expired = 0, failed = 0, queued = 0;
  /// Of the dropped ones, those that no earlier firing had made data for. Absent where none is
  /// read.
  std::optional<std::int64_t> no_predecessor;
  /// How often a unit gave a task back. Absent where nothing ever does.
  std::optional<std::int64_t> returned;
  std::int64_t stalled = 0;  ///< Of the queued ones, those that nothing was ever going to start.
  std::string trace_problem = {};  ///< Why that of a live run is not complete; not stored.
  std::int64_t offloaded = 0;      ///< Of the completed ones, those that the cloud served.
  std::optional<double> throughput_per_ms;
  std::optional<double> mean_latency_ms, p99_latency_ms;  ///< Of all tasks, dispatch to completion.
  /// Absent, with the power, where nobody knows what a unit draws that served something.
  std::optional<double> energy_j;
  std::optional<double> average_power_w;

  std::vector<UnitResult> units;          ///< In the platform's order.
  std::vector<PipelineResult> pipelines;  ///< In the mix's order.
  /// By workload, then unit; empty in records of before they were counted.
  std::vector<CallResult> calls;
  std::map<std::string, std::map<std::string, int>>
      weights;  ///< [workload][unit]; units that may serve it. Empty for modes without weights.
  std::optional<std::string> weights_from;  ///< "given", "platform", "derived".
  std::optional<std::int64_t> figures;      ///< Of the profile, that the run could use.
  std::vector<DoubtedFigure> doubted;       ///< Of these.
  std::optional<RunBounds> bounds;
  bool uncertain = false;  ///< What it rests on was measured, and has an interval. Not stored.
  /// By figure (record/interval.h), of runs that rest on a measured profile; empty = none.
  std::map<std::string, FigureInterval> intervals;
  /// The figures on redrawn profiles, one after the other: what two runs are compared by. Not
  /// stored.
  std::vector<std::map<std::string, double>> redrawn = {};
  std::vector<std::string> warnings;

  [[nodiscard]] bool is_live() const { return time == "live"; }
  [[nodiscard]] const UnitResult* find_unit(const std::string& name) const;  ///< Null: none.
  [[nodiscard]] const PipelineResult* find_pipeline(const std::string& name) const;
  friend bool operator==(const RunRecord&, const RunRecord&) = default;
};

[[nodiscard]] Json to_json(const RunRecord& record);

/// @param source  For messages: the file that the JSON came from.
/// @throws Error{kBadInput} for a missing, other or newer schema version, a missing key or a wrong
/// type.
[[nodiscard]] RunRecord run_record_from_json(const Json& json, const std::string& source);

/// @throws Error{kBadInput} as above, or if the file cannot be read or is not JSON.
[[nodiscard]] RunRecord load_run_record(const std::filesystem::path& path);

}  // namespace pirt
