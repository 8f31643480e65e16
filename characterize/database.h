// Writing a profile database: a run, then its cells, each in one transaction. The format is
// documented in schema.sql.
//
// Reading is in profile.h.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "characterize/profile.h"
#include "workloads/base/time.h"
#include "workloads/phase.h"

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

/// One row of profile_summary with its samples; the statistics are computed when it is written, so
/// that they always belong to them.
struct PhaseRecord {
  Phase phase = Phase::kCall;
  State state = State::kSteady;
  Provenance provenance = Provenance::kMeasured;
  std::vector<std::string> reasons;  ///< Empty = valid; never empty without samples.
  std::vector<std::string> notes;
  std::vector<Nanos> samples;
  /// Of each sample the worker process that took it, from 0. Empty = one process took all, or, in a
  /// set-up phase, which happens once in a process, each its own.
  std::vector<std::int32_t> processes = {};
};

/// The defaults are those of model_energy, whose watts are above idle.
struct EnergyRecord {
  std::optional<double> energy_j;
  Provenance provenance = Provenance::kModelled;
  std::string source;
  std::vector<std::string> reasons;  ///< Empty = valid; never empty without energy_j.
  std::string domain = "unit";       ///< What the meter or model covers.
  bool idle_subtracted = true;       ///< What the domain takes anyway is not in energy_j.
};

/// What a unit can do at most.
struct PeakRecord {
  std::string unit;
  PeakKind kind = PeakKind::kF32;
  std::optional<double> per_second;  ///< Operations or bytes, above 0.
  std::string variant;               ///< Which loop was the fastest; empty if none ran.
  Provenance provenance = Provenance::kMeasured;
  std::vector<std::string> reasons;  ///< Empty = valid; never empty without per_second.
};

/// Everything about one workload on one unit.
struct CellRecord {
  std::string workload, unit;
  std::optional<std::int64_t> ops;
  std::int64_t bytes = 0;
  std::string verification;
  std::vector<PhaseRecord> phases;
  std::optional<EnergyRecord> energy;
};

struct CellName {
  std::string workload, unit;
  friend bool operator==(const CellName&, const CellName&) = default;
};

/// One worker process of a cell that is not done.
struct VisitRecord {
  std::int64_t position = 0;  ///< From 0, in order of time within the cell.
  State setup = State::kCold;
  std::string record;  ///< to_record of its JobResult.
};

/// A run that did not end, and what is needed to go on with it.
struct UnfinishedRun {
  RunInfo run;
  std::string plan;            ///< RunHeader::plan.
  std::int64_t checksum = 0;   ///< Of the state that this is.
  std::vector<CellName> done;  ///< The cells that are complete, in the order of storing.
  std::vector<std::pair<CellName, VisitRecord>> visits;  ///< Of cells that are not; in order.
};

/// Appends runs to a profile database. Used by one thread; other processes may read and write the
/// file at the same time.
class ProfileWriter {
 public:
  /// Opens the database, or creates it where no file is.
  /// @param busy_wait  How long another writer is waited for.
  /// @throws Error{kBadInput}: not a profile database, damaged, newer, not writable, no such
  /// folder. Nothing is written or created then.
  explicit ProfileWriter(const std::filesystem::path& path,
                         Nanos busy_wait = std::chrono::seconds(10));
  ~ProfileWriter();
  ProfileWriter(ProfileWriter&&) noexcept;
  ProfileWriter& operator=(ProfileWriter&&) = delete;

  /// Each of the following is one transaction: it is stored completely or not at all, whatever
  /// happens.
  /// @throws Error{kEnvironment}: another program is writing, no space, input/output error.
  std::int64_t begin_run(const RunHeader& header);
  /// Nothing is stored: the run, which another writer began, becomes this one's, as those are that
  /// it begins itself, until it goes.
  /// @throws Error{kEnvironment}: it is another's, or has changed since @p run was read.
  void resume_run(const UnfinishedRun& run);
  /// Keeps what one worker process of a cell reported, for find_unfinished_run.
  /// @throws Error{kBadInput}: the run has that cell, or that process of it, already.
  void write_visit(std::int64_t run_id, const CellName& cell, const VisitRecord& visit);
  /// Also into a run that another process began (find_unfinished_run). The cell's visits go, and
  /// what write_interrupted_cell wrote of it.
  /// @throws Error{kBadInput}: the run has that cell already.
  void write_cell(std::int64_t run_id, const CellRecord& cell);
  /// A cell as far as it was measured. Its visits stay, so that it can be gone on with.
  void write_interrupted_cell(std::int64_t run_id, const CellRecord& cell);
  /// Peaks of units of the run; takes the place of earlier ones of the same unit and kind.
  void write_peaks(std::int64_t run_id, std::span<const PeakRecord> peaks);
  /// @param facts  What is known of the run now that it is over; added to its environment.
  void finish_run(std::int64_t run_id, const std::string& finished,
                  const std::map<std::string, std::string>& facts = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Reasons and notes as the database has them: separated by "; ". A semicolon inside an entry
/// becomes a comma.
[[nodiscard]] std::string join_words(const std::vector<std::string>& words);
[[nodiscard]] std::vector<std::string> split_words(const std::string& text);

/// The newest run that did not end and has a plan; nothing if there is none.
/// @throws Error as load_profile, but not because there are no measurements yet.
[[nodiscard]] std::optional<UnfinishedRun> find_unfinished_run(const std::filesystem::path& path);

/// The raw samples behind one row of profile_summary.
struct RowSamples {
  std::string workload, unit;
  Phase phase = Phase::kCall;
  State state = State::kSteady;
  std::vector<Nanos> samples;           ///< In the order in which they were taken.
  std::vector<std::int32_t> processes;  ///< Of each sample, the worker process that took it.
};

/// The samples of all rows of one run that have any; empty if there is no such run.
/// @throws Error as load_profile.
[[nodiscard]] std::vector<RowSamples> load_samples(const std::filesystem::path& path,
                                                   std::int64_t run_id);

}  // namespace pirt
