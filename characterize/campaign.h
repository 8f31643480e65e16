// `pirt characterize`: which cells (workload on unit) there are, measuring them in random order,
// storing each as it is done.
//
// The coordinator opens no device: all that touches one happens in worker processes (worker.h), one
// at a time, so that nothing is timed beside something else.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "characterize/database.h"
#include "characterize/environment.h"
#include "characterize/platform.h"
#include "workloads/workload.h"

namespace pirt {

struct CampaignOptions {
  std::filesystem::path database;
  Platform platform;
  std::vector<std::string> units;  ///< Empty = all measured units of the platform.
  std::string filter;  ///< ECMAScript regular expression, searched in workload names; empty = all.
  std::optional<std::filesystem::path>
      images;  ///< For images_from; absent = generated from the seed.
  std::uint64_t seed = 1;
  double precision =
      0.02;  ///< Half the 95 % interval of the median, relative; within 0 and 1, both excluded.
  bool quick =
      false;  ///< 2 set-ups and up to 0.8 s of sampling a cell, instead of 5 and up to 5 s.
  std::filesystem::path program = "/proc/self/exe";  ///< Started as `PROGRAM worker`.
  Nanos job_limit = std::chrono::seconds(
      120);  ///< A worker that takes longer is killed and its cell is an error.
  const std::atomic<bool>* stop = nullptr;  ///< Set it (from a signal handler, say) to end the run;
                                            ///< finished cells stay. May be null.
};

/// Something that will not be measured.
struct Skip {
  std::string unit;
  std::string workload;  ///< Empty = the whole unit.
  std::string reason;    ///< With the remedy where there is one.
};

struct PlannedCell {
  const Workload* workload = nullptr;  ///< In the catalog.
  std::string unit;
};

struct CampaignPlan {
  std::vector<PlannedCell> cells;  ///< In the order of measuring: random, from the seed.
  std::vector<Skip> skipped;
  std::vector<UnitRecord>
      units;  ///< Those with cells, in platform order, with the device that each got.
  std::vector<Provenance> provenances;  ///< Of each of `units`.
  Environment facts;                    ///< What probing found: "unit.cpu.version".
  Nanos estimate{0};  ///< Rough: what cells take on the machine that this was written on.
};

/// Checks all arguments, probes each unit in a worker process and lays out the cells. Writes
/// nothing and makes no database.
/// @throws Error{kBadInput}: a unit that the platform does not have or does not measure; a filter
/// that is no regular expression or matches
///         nothing (with the nearest names); bad images; a precision out of range.
/// @throws Error{kEnvironment}: a unit that was named is not available (with the remedy), or none
/// is; no unit supports any chosen workload.
[[nodiscard]] CampaignPlan plan_campaign(const CampaignOptions& options);

struct Progress {
  std::string workload, unit;
  std::string step;  ///< "warm set-up 1/2"
  int cell = 0;      ///< 1 to cells.
  int cells = 0;
  Nanos elapsed{0};
  Nanos estimated_left{0};  ///< From the plan's estimate at first, then from the cells done.
};

struct ProgressSink {
  std::function<void(const Progress&)> progress;  ///< At each step of each cell; may be empty.
  std::function<void(const std::string&)>
      warning;  ///< A row that turned out invalid, in one line; may be empty.
};

struct CampaignSummary {
  std::int64_t run_id = 0;
  int cells = 0;  ///< Stored.
  int rows_valid = 0;
  int rows_invalid = 0;
  bool interrupted = false;  ///< By options.stop; the cell that was being measured is not stored.
  Nanos elapsed{0};
};

/// Appends one run to the database, which is made if there is none.
/// @throws Error as ProfileWriter; Error{kEnvironment} if no worker can be started or scratch space
/// cannot be made.
CampaignSummary run_campaign(const CampaignOptions& options, const CampaignPlan& plan,
                             const ProgressSink& sink = {});

}  // namespace pirt
