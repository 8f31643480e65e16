// Measuring one workload on one unit through worker processes, and judging what came back.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "characterize/database.h"
#include "characterize/job_runner.h"
#include "characterize/platform.h"
#include "workloads/backend.h"
#include "workloads/workload.h"

namespace pirt {

struct CellRequest {
  const Platform& platform;
  const UnitModel& unit;
  const Backend& backend;
  const Workload& workload;
  Job job;  ///< Everything but its kind.
  Provenance provenance =
      Provenance::kMeasured;  ///< Of rows whose worker did not get as far as opening the device.
  int setup_repeats = 2;      ///< Cold ones, and as many warm ones.
  std::filesystem::path
      scratch;  ///< Folder for kernel caches; what is made in it is removed again.
  std::function<void(std::string_view step)> on_step;  ///< "cold set-up 1/2"; never empty.
};

/// One cell on its way from nothing to a record.
class CellMeasurement {
 public:
  /// @param runner  Outlives this.
  CellMeasurement(CellRequest request, const JobRunner& runner);
  ~CellMeasurement();
  CellMeasurement(const CellMeasurement&) = delete;
  CellMeasurement& operator=(const CellMeasurement&) = delete;

  /// Cold set-ups (fresh process, empty kernel cache), warm ones (the cache filled), then sampling.
  /// The first failure ends the cell: its rows say why.
  /// @return False if the runner was stopped.
  [[nodiscard]] bool measure();
  /// Whether the samples depend on when they were taken (is_unstable in validity.h). A busy spell
  /// of the machine lasts for seconds: sample again when something else has been done.
  [[nodiscard]] bool unstable() const { return unstable_; }
  /// New samples take the place of the old ones. @return False if the runner was stopped.
  [[nodiscard]] bool sample_again();
  [[nodiscard]] CellRecord record() const;

 private:
  friend CellRecord failed_cell(const CellRequest& request, const std::string& error);
  bool run(JobKind kind, State state, const std::string& step);
  bool sample(const std::string& step);
  [[nodiscard]] bool failed() const { return !last_.error.empty(); }
  [[nodiscard]] std::span<const Nanos> call_samples() const;
  std::vector<Nanos>& times(Phase phase, State state);
  [[nodiscard]] const std::vector<Nanos>& times(Phase phase, State state) const;
  [[nodiscard]] std::vector<std::string> failure() const;
  [[nodiscard]] PhaseRecord setup_row(Phase phase, State state) const;
  [[nodiscard]] std::optional<PhaseRecord> call_row(Phase phase) const;

  CellRequest request_;
  const JobRunner& runner_;
  std::filesystem::path cache_;  ///< The cell's own kernel cache; gone with this.
  std::vector<std::pair<std::string, std::string>> environment_;
  std::map<std::pair<Phase, State>, std::vector<Nanos>> setup_;
  JobResult last_;
  bool unstable_ = false;
};

/// The record of a cell that could not be measured at all: every row of the backend's phases,
/// without samples.
[[nodiscard]] CellRecord failed_cell(const CellRequest& request, const std::string& error);

}  // namespace pirt
