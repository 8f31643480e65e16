// `pirt characterize`: which cells (workload on unit) there are, measuring them in rounds, storing
// each as it is done.
//
// A round visits every cell that needs a process, each with a fresh one, in an order of its own: a
// cell's processes are spread over the whole run, so that a busy spell or a slow drift of the
// machine is within each interval and not between cells.
//
// The coordinator opens no device: all that touches one happens in worker processes (worker.h), one
// at a time, so that nothing is timed beside something else.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "characterize/campaign/unit_times.h"
#include "characterize/energy/metered_calls.h"
#include "characterize/machine/environment.h"
#include "characterize/platform/platform.h"
#include "characterize/platform/selection.h"
#include "characterize/profile/profile.h"
#include "characterize/profile/records.h"
#include "characterize/profile/store/reader.h"
#include "workloads/model/backend.h"
#include "workloads/model/workload.h"

namespace pirt {

/// A workload of the mix that the profile is wanted for.
struct NeededWorkload {
  std::string workload;
  std::vector<std::string> served_by;  ///< Units or roles; empty = all.
  friend bool operator==(const NeededWorkload&, const NeededWorkload&) = default;
};

struct CampaignOptions {
  std::filesystem::path database;
  std::string command;  ///< That measures the same again, but for the database; empty = none does.
  Platform platform;
  std::vector<std::string> units;  ///< Empty = all measured units of the platform.
  /// Files of workloads that are not pirt's, absolute, which have been made known
  /// (learn_workloads).
  std::vector<std::string> own;
  std::string filter;                 ///< As choose_workloads has it; so are the next three.
  std::vector<std::string> variants;  ///< Measured beside the plain workloads (catalog.h).
  std::optional<int> batch;  ///< AlexNet's rows are measured with this many images a call as well.
  std::vector<std::string> sizes;
  std::optional<std::filesystem::path>
      images;  ///< For images_from; absent = generated from the seed.
  std::string images_topic;
  std::uint64_t seed = 1;
  double precision =
      0.02;  ///< Half the 95 % interval of the median, relative; within 0 and 1, both excluded.
  bool quick = false;  ///< 4 processes a cell, 2 of them cold, instead of 10 and 5.
  /// Sample beside the units of the same memory, and after all caches were emptied, too. A run that
  /// is not quick does.
  bool interference = false;
  /// See CampaignPlan; absent = kMostQuickTime and what meters take, or what the plan needs with
  /// kFullTime a cell.
  std::optional<Nanos> max_time;
  std::optional<Nanos> precision_time;  ///< Likewise; absent = max_time, if that is given.
  std::string mix;                      ///< What `first` is from, for messages.
  /// Their cells get a process before all others, and all cells one before any gets two. Measured
  /// also where nothing chooses them, unless a filter is given, or only others' are wanted.
  std::vector<NeededWorkload> first;
  /// What is to be measured of a unit beside its calls, in order; empty = nothing is.
  std::function<std::vector<UnitTimePart>(const UnitRecord&)> unit_times;
  /// What `platform` was loaded from, so that the run can be gone on with.
  std::string platform_argument;
  std::vector<std::string> settings;
  std::optional<UnfinishedRun> resumed;  ///< From resume_options: no new run, but the rest of this.
  std::filesystem::path program = "/proc/self/exe";  ///< Started as `PROGRAM worker`.
  std::filesystem::path sysfs = "/sys";              ///< Where energy meters are looked for.
  Nanos job_limit = std::chrono::seconds(
      120);  ///< A worker that takes longer is killed and its cell is an error.
  const std::atomic<bool>* stop = nullptr;  ///< Set it (from a signal handler, say) to end the run;
                                            ///< finished cells stay. May be null.
};

/// The default of precision_time, for each cell, without what is not of cells.
inline constexpr Nanos kQuickTime = std::chrono::milliseconds(1'900);
inline constexpr Nanos kFullTime = std::chrono::milliseconds(15'000);
/// The default of max_time of a quick run without meters, which may add twice as much, and the
/// least of another.
inline constexpr Nanos kMostQuickTime = std::chrono::minutes(3);

struct PlannedCell {
  const Workload* workload = nullptr;  ///< In the catalog.
  std::string unit;
  bool first = false;  ///< See CampaignOptions::first.
};

/// How long a campaign will take, or what is left of it.
struct Estimate {
  Nanos needed{0};     ///< What valid rows, peaks, meters and times of units need.
  Nanos total{0};      ///< With what the precision will take, as far as max_time goes.
  std::string source;  ///< "run 3 of a.db", or what machine the constants are from.
};

struct CampaignPlan {
  std::vector<PlannedCell> cells;  ///< In platform order; each round has its own order.
  std::vector<Skip> skipped;
  std::vector<UnitRecord>
      units;  ///< Those with cells, in platform order, with the device that each got.
  std::vector<Provenance> provenances;         ///< Of each of `units`.
  std::vector<DeviceInfo> devices;             ///< Of each of `units`, as it was asked.
  std::map<std::string, MeterRequest> meters;  ///< By unit; those without one are modelled.
  /// Where a unit is not what the platform asks for; why its energy is modelled, or from another
  /// meter.
  std::vector<std::string> remarks;
  Environment facts;  ///< What probing found: "unit.cpu.version".
  /// Of all units, but those that an unfinished run has.
  std::vector<PlannedUnitTime> unit_times;
  Nanos max_time{0};        ///< From then on no process begins, and no time of a unit.
  Nanos precision_time{0};  ///< No process is started for precision alone after that.
  Nanos spent{0};           ///< Of max_time, by an unfinished run.
  Estimate estimate;
};

/// Checks all arguments, probes each unit in a worker process and lays out the cells. Writes
/// nothing and makes no database.
/// @throws Error{kBadInput}: a unit that the platform does not have or does not measure; a filter
/// that is no regular expression or matches
///         nothing (with the nearest names); bad images; a precision out of range; an unfinished
///         run
/// that has spent its time.
/// @throws Error{kEnvironment}: a unit that was named is not available (with the remedy), or none
/// is; no unit supports any chosen workload.
[[nodiscard]] CampaignPlan plan_campaign(const CampaignOptions& options);

/// What --max-time suffices to go on with a run that has spent its time: whole minutes, twice the
/// larger of both.
[[nodiscard]] std::int64_t longer_minutes(Nanos max_time, Nanos spent);

/// The options that the newest unfinished run of @p database was started with, to go on with it;
/// program, job_limit and stop are left to the caller.
/// @throws Error{kBadInput} if there is none, or its plan is not readable; as load_profile.
[[nodiscard]] CampaignOptions resume_options(const std::filesystem::path& database);

struct Progress {
  std::string workload, unit;
  std::string step;  ///< "process 3, cold set-up"
  int done = 0;      ///< Cells that are stored.
  int cells = 0;
  Nanos elapsed{0};
  Nanos estimated_left{0};  ///< From the plan's estimate at first, then from the visits done.
};

struct ProgressSink {
  std::function<void(const Progress&)> progress;  ///< At each step of each cell; may be empty.
  std::function<void(const std::string&)>
      warning;  ///< A row that turned out invalid, in one line; may be empty.
  std::function<void(const CellName&)>
      stored;  ///< A cell that is in the database from here on, whatever happens; may be empty.
  /// The run is in the database, and can be gone on with; may be empty.
  std::function<void(std::int64_t run_id)> begun = {};
  /// That another program holds the database, which is waited for; may be empty.
  std::function<void(const std::string&)> waiting = {};
};

struct CampaignSummary {
  std::int64_t run_id = 0;
  int cells = 0;                     ///< Complete.
  int cells_begun = 0;               ///< Not complete when the run ended, and stored as they are.
  std::vector<CellName> unmeasured;  ///< The time was over before they got a process.
  int unit_times_left_out = 0;       ///< Likewise.
  std::vector<std::string> peaks_left_out;  ///< Units; likewise.
  int rows_valid = 0, rows_doubted = 0, rows_invalid = 0;
  int processes = 0;         ///< That were run to their end.
  int within_precision = 0;  ///< Stored cells whose `call` and `execute` reached the precision.
  bool interrupted = false;  ///< By options.stop; what was measured is kept.
  Nanos elapsed{0};          ///< Of max_time: with CampaignPlan::spent.

  /// Whether the run is over, and not to be gone on with.
  [[nodiscard]] bool complete() const {
    return !interrupted && cells_begun == 0 && unmeasured.empty() && unit_times_left_out == 0 &&
           peaks_left_out.empty();
  }
};

/// Appends one run to the database, which is made if there is none, or goes on with one.
/// @throws Error as ProfileWriter; Error{kBadInput} if the machine is not the one that the run was
/// begun on; Error{kEnvironment} if no worker can be started, scratch space cannot be made, or a
/// unit's device is not the plan's any more: what was measured before is kept.
CampaignSummary run_campaign(const CampaignOptions& options, const CampaignPlan& plan,
                             const ProgressSink& sink = {});

}  // namespace pirt
