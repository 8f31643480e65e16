// Writing a profile database: a run, then its cells, each in one transaction. The format is
// documented in schema.sql.
//
// Reading is in reader.h.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "characterize/profile/records.h"
#include "characterize/profile/store/file_wait.h"
#include "characterize/profile/store/reader.h"
#include "workloads/base/time.h"

namespace pirt {

/// Appends runs to a profile database. Used by one thread; other processes may read and write the
/// file at the same time.
class ProfileWriter {
 public:
  /// Opens the database, or creates it where no file is.
  /// @param waiting  How other programs that write are waited for, and those that read, whenever
  /// something is stored.
  /// @throws Error{kBadInput}: not a profile database, damaged, newer, not writable, no such
  /// folder. Nothing is written or created then.
  explicit ProfileWriter(const std::filesystem::path& path, const FileWait& waiting = {});
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
  /// Of units of the run, each pair of unit and sleep once.
  void write_unit_times(std::int64_t run_id, std::span<const UnitTimeRecord> times);
  /// @param facts  What is known of the run now that it is over; added to its environment.
  void finish_run(std::int64_t run_id, const std::string& finished,
                  const std::map<std::string, std::string>& facts = {});
  /// Of a run that is to be gone on with.
  void write_facts(std::int64_t run_id, const std::map<std::string, std::string>& facts);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pirt
