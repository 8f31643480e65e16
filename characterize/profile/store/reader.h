// Reading a profile database.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "characterize/profile/profile.h"
#include "characterize/profile/records.h"

namespace pirt {

namespace sqlite {
class Connection;
}

/// Which runs of a database are read.
struct RunRange {
  std::int64_t first = 0;
  std::int64_t last = std::numeric_limits<std::int64_t>::max();
};

/// A profile database, verified when it is opened and then read as often as wished. Whoever appends
/// a run meanwhile is kept waiting by no more than one of these calls.
class ProfileReader {
 public:
  /// @throws Error{kBadInput}: missing file, not a database, not pirt's, damaged, newer version.
  /// @throws Error{kEnvironment}: busy, unreadable disk.
  explicit ProfileReader(const std::filesystem::path& path);
  ~ProfileReader();
  ProfileReader(const ProfileReader&) = delete;
  ProfileReader& operator=(const ProfileReader&) = delete;

  /// The newest rows of one platform, from one state of the file.
  /// @param platform  Only runs of that platform; empty = that of the newest run.
  /// @param runs      Only these, as if there were no others.
  /// @throws Error{kBadInput}: no runs, no run of that platform.
  [[nodiscard]] Profile read(std::string_view platform = {}, RunRange runs = {}) const;

  /// That of the newest run that ended, or else of the newest at all; empty = there is none.
  [[nodiscard]] std::string newest_platform() const;
  /// The runs of a platform that ended, newest first.
  [[nodiscard]] std::vector<std::int64_t> finished_runs(std::string_view platform) const;
  /// Those that did not end and have a plan, newest first.
  [[nodiscard]] std::vector<RunInfo> unfinished_runs(std::string_view platform) const;

  /// Fills in the values of all rows: for whoever needs distributions, not medians alone.
  /// @param profile  Read from here.
  /// @throws Error{kEnvironment} where another program has replaced a cell since.
  void read_samples(Profile& profile) const;

 private:
  std::unique_ptr<sqlite::Connection> connection_;
};

/// What a ProfileReader of that file reads. @throws Error as ProfileReader and its read.
[[nodiscard]] Profile load_profile(const std::filesystem::path& path,
                                   std::string_view platform = {}, RunRange runs = {});

/// A run that did not end, and what is needed to go on with it.
struct UnfinishedRun {
  RunInfo run;
  std::string plan;            ///< RunHeader::plan.
  std::int64_t checksum = 0;   ///< Of the state that this is.
  Nanos spent{0};              ///< What it took until its last process.
  std::vector<PeakRow> peaks;  ///< That were measured.
  std::vector<UnitTimeRow> unit_times;
  std::vector<CellName> done;  ///< The cells that are complete, in the order of storing.
  std::vector<std::pair<CellName, VisitRecord>> visits;  ///< Of cells that are not; in order.
};

/// The newest run that did not end and has a plan; nothing if there is none.
/// @throws Error as load_profile, but not because there are no measurements yet.
[[nodiscard]] std::optional<UnfinishedRun> find_unfinished_run(const std::filesystem::path& path);

/// The raw samples behind one row of profile_summary or condition_summary.
struct RowSamples {
  std::string workload, unit;
  Phase phase = Phase::kCall;
  State state = State::kSteady;
  Condition condition = Condition::kSteady;
  std::vector<Nanos> samples;           ///< In the order in which they were taken.
  std::vector<std::int32_t> processes;  ///< Of each sample, the worker process that took it.
};

/// The samples of all rows of one run that have any; empty if there is no such run.
/// @throws Error as load_profile.
[[nodiscard]] std::vector<RowSamples> load_samples(const std::filesystem::path& path,
                                                   std::int64_t run_id);

}  // namespace pirt
