// Measuring one workload on one unit through worker processes, and judging what came back.
//
// A cell is measured in visits: one fresh process each, which sets the unit up (cold or warm) and
// then samples calls. The campaign decides when a cell is visited (campaign.h); the cell knows what
// a visit has to be, and when it needs no more.
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

#include "characterize/campaign/validity.h"
#include "characterize/platform/platform.h"
#include "characterize/profile/records.h"
#include "characterize/worker/job_runner.h"
#include "workloads/model/backend.h"
#include "workloads/model/workload.h"

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
  double precision = 0.02;    ///< Wanted of `call` and `execute`.
  std::filesystem::path
      scratch;  ///< Folder for kernel caches; what is made in it is removed again.
  std::function<void(std::string_view step)> on_step;  ///< "process 3, cold set-up"; never empty.
};

/// Processes that a cell has at most: with 100, one more would narrow the interval by 0.5 %.
inline constexpr int kMostProcesses = 100;
/// Processes from which on an interval is one whatever their distribution (statistics.h): a cell
/// that ended before, as soon as it looks precise, would hold the median in 87 to 94 % only.
inline constexpr int kFewestForPrecision = 6;

/// What the next process of a cell is for.
struct Visit {
  State setup = State::kCold;  ///< Whether it finds an empty kernel cache or a filled one.
  bool needed = true;          ///< A valid row needs it; otherwise it only narrows the interval.
};

/// One cell on its way from nothing to a record.
class CellMeasurement {
 public:
  /// @param runner  Outlives this.
  CellMeasurement(CellRequest request, const JobRunner& runner);
  ~CellMeasurement();
  CellMeasurement(const CellMeasurement&) = delete;
  CellMeasurement& operator=(const CellMeasurement&) = delete;

  /// Cold and warm set-ups in turns, then, if the cell is unstable or spoilt by other programs, as
  /// many processes again, whose samples take the place of the earlier ones, then more while the
  /// precision is not reached, which fewer than kFewestForPrecision do not tell. One cold and one
  /// warm where every figure repeats exactly: the second checks the first.
  /// A process that fails is tried once more: a second failure ends the cell, and its rows say why.
  /// Nothing then, and when all is done.
  [[nodiscard]] std::optional<Visit> next() const;
  /// Does next(), which must be there. @return What the worker found; nothing if the runner was
  /// stopped.
  [[nodiscard]] std::optional<JobResult> visit();
  /// Takes in a result of visit(), or of the same visit of an earlier, interrupted campaign.
  void add(State setup, JobResult result);

  /// The wider of the intervals of `call` and `execute`, half of it, relative; nothing as long as
  /// there is no interval.
  [[nodiscard]] std::optional<double> reached() const { return reached_; }
  /// Visits to come: those that are needed, and those that the precision will take if processes go
  /// on to differ as they do (an interval narrows with the square root of their number).
  [[nodiscard]] int expected_visits() const;
  [[nodiscard]] int needed_visits() const;
  /// Those of expected_visits() for the precision; nothing if a cell does not get as many.
  [[nodiscard]] std::optional<int> visits_to_precision() const;
  /// At the end of a run: where the only process failed, and there was no time to try once more,
  /// its failure is what rows say. @return Whether that is so.
  bool believe_first_failure();
  [[nodiscard]] int processes() const { return static_cast<int>(taken_.size()); }
  /// Results taken in: the processes, and one that failed and was tried again.
  [[nodiscard]] int visits() const { return processes() + (failures_ > 0 ? 1 : 0); }
  /// Whether it had all its set-ups, so that no more would add but sampling again.
  [[nodiscard]] bool has_set_ups() const { return failed() || processes() >= setups(); }

  /// Whether the unit has an energy meter and the cell has calls that it has not been read for.
  [[nodiscard]] bool metering_due() const;
  /// Reads the meters, in a process of its own. @return False if the runner was stopped.
  [[nodiscard]] bool meter();
  /// What meter() found; absent before it.
  [[nodiscard]] const std::optional<JobResult>& metered() const { return metered_; }
  /// Of the open device before the calls that were metered; absent where no meter showed it.
  [[nodiscard]] std::optional<double> idle_w() const;
  [[nodiscard]] CellRecord record() const;

 private:
  friend CellRecord failed_cell(const CellRequest& request, const std::string& error);
  struct Taken {
    State setup;
    JobResult result;
  };
  [[nodiscard]] bool failed() const {
    return !taken_.empty() && !taken_.back().result.error.empty();
  }
  [[nodiscard]] bool wrong_output() const;
  void begin_step(const std::string& step);
  [[nodiscard]] std::optional<JobResult> run(JobKind kind);
  [[nodiscard]] int setups() const;
  [[nodiscard]] bool is_settled_by_one() const;
  [[nodiscard]] int repeats() const;
  [[nodiscard]] bool repeated() const;
  [[nodiscard]] std::span<const Taken> shown() const;
  [[nodiscard]] CellSamples samples(Phase phase) const;
  [[nodiscard]] bool is_precise() const;
  [[nodiscard]] std::optional<double> taken(const CellSamples& calls) const;
  [[nodiscard]] CellConditions conditions() const;
  [[nodiscard]] CellConditions setup_conditions(State state) const;
  [[nodiscard]] std::optional<Nanos> bound(Phase phase) const;
  [[nodiscard]] const JobResult* opened() const;
  [[nodiscard]] const JobResult* timed(Phase phase) const;
  [[nodiscard]] std::string unknown(Phase phase) const;
  [[nodiscard]] Origin provenance(Phase phase) const;
  [[nodiscard]] bool repeats(Phase phase) const;
  [[nodiscard]] CallWork work() const;
  [[nodiscard]] std::vector<std::string> notes() const;
  [[nodiscard]] std::vector<std::string> failure() const;
  [[nodiscard]] PhaseRecord setup_row(Phase phase, State state) const;
  [[nodiscard]] std::optional<PhaseRecord> call_row(Phase phase) const;
  [[nodiscard]] std::vector<PhaseRecord> condition_rows() const;
  [[nodiscard]] EnergyRecord energy(const PhaseRecord& call,
                                    std::span<const PhaseRecord> phases) const;
  void judge_samples();
  void measure_precision();

  CellRequest request_;
  const JobRunner& runner_;
  std::filesystem::path cache_;  ///< The cell's own kernel cache; gone with this.
  bool cache_filled_ = false;
  std::string step_;  ///< The latest.
  std::vector<std::pair<std::string, std::string>> environment_;
  std::vector<Taken> taken_;  ///< In order of time; without the first that failed.
  std::optional<Taken> first_failure_;
  int failures_ = 0;
  std::optional<std::size_t> again_at_;  ///< How many had been taken when it turned out.
  std::string_view again_why_;           ///< "unstable".
  bool unstable_ = false;                ///< Of what is shown.
  std::optional<double> reached_;
  std::optional<JobResult> metered_;
};

/// The record of a cell that could not be measured at all: every row of the backend's phases,
/// without samples.
[[nodiscard]] CellRecord failed_cell(const CellRequest& request, const std::string& error);

}  // namespace pirt
