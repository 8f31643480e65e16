#include "characterize/cell.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "characterize/energy.h"
#include "characterize/statistics.h"
#include "characterize/validity.h"

namespace pirt {
namespace {

constexpr std::array kSetupPhases = {Phase::kDeviceInit, Phase::kPrepare};
constexpr std::array kSetupStates = {State::kCold, State::kWarm};

bool is_setup(Phase phase) { return std::ranges::find(kSetupPhases, phase) != kSetupPhases.end(); }

void append(std::vector<std::string>& to, const std::vector<std::string>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// A kernel cache of its own that is gone afterwards.
class CacheFolder {
 public:
  explicit CacheFolder(const std::filesystem::path& scratch) : path_(scratch / "kernel-cache") {
    clear();
  }
  ~CacheFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  CacheFolder(const CacheFolder&) = delete;
  CacheFolder& operator=(const CacheFolder&) = delete;

  void clear() const {
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

class CellMeasurement {
 public:
  CellMeasurement(const CellRequest& request, const JobRunner& runner)
      : request_(request), runner_(runner), cache_(request.scratch) {
    environment_ = request.backend.kernel_cache_environment(cache_.path());
    last_.provenance = request.provenance;
  }

  /// False if stopped.
  bool measure() {
    const int repeats = request_.setup_repeats;
    for (int i = 1; i <= repeats; ++i) {
      cache_.clear();
      if (!run(JobKind::kSetup, State::kCold, fmt::format("cold set-up {}/{}", i, repeats)))
        return false;
      if (failed()) return true;
    }
    for (int i = 1; i < repeats; ++i) {
      if (!run(JobKind::kSetup, State::kWarm, fmt::format("warm set-up {}/{}", i, repeats)))
        return false;
      if (failed()) return true;
    }
    // The sampling process is fresh and finds the cache filled: its set-up is the last warm one.
    if (!run(JobKind::kSample, State::kWarm, "sampling")) return false;
    if (!failed() && is_unstable(call_samples())) {
      if (!run(JobKind::kSample, State::kWarm, "sampling again (unstable)")) return false;
      unstable_ = is_unstable(call_samples());
    }
    return true;
  }

  void fail(const std::string& error) { last_.error = error; }

  [[nodiscard]] CellRecord record() const {
    const Workload& workload = request_.workload;
    CellRecord cell{workload.name,
                    request_.unit.name,
                    workload.ops,
                    workload.bytes(),
                    last_.verification,
                    {},
                    {}};
    for (const Phase phase : request_.backend.phases()) {
      if (is_setup(phase)) {
        for (const State state : kSetupStates) cell.phases.push_back(setup_row(phase, state));
      } else if (auto row = call_row(phase)) {
        cell.phases.push_back(std::move(*row));
      }
    }
    const auto call = std::ranges::find(cell.phases, Phase::kCall, &PhaseRecord::phase);
    if (call != cell.phases.end()) {
      cell.energy = model_energy(request_.platform, request_.unit, workload, *call);
    }
    return cell;
  }

 private:
  bool run(JobKind kind, State state, const std::string& step) {
    request_.on_step(step);
    Job job = request_.job;
    job.kind = kind;
    auto result = runner_.run(job, environment_);
    if (!result) return false;
    last_ = std::move(*result);
    if (!last_.device) last_.provenance = request_.provenance;
    if (last_.device_init) times(Phase::kDeviceInit, state).push_back(*last_.device_init);
    if (last_.prepare) times(Phase::kPrepare, state).push_back(*last_.prepare);
    return true;
  }

  [[nodiscard]] bool failed() const { return !last_.error.empty(); }

  [[nodiscard]] std::span<const Nanos> call_samples() const {
    const auto it = std::ranges::find(last_.phases, Phase::kCall, &PhaseSamples::phase);
    return it == last_.phases.end() ? std::span<const Nanos>() : it->samples;
  }

  static std::size_t index(Phase phase, State state) {
    return (phase == Phase::kPrepare ? 2U : 0U) + (state == State::kWarm ? 1U : 0U);
  }
  std::vector<Nanos>& times(Phase phase, State state) { return setup_[index(phase, state)]; }

  /// Why every row of a cell whose worker failed is not valid, as far as the row is not complete.
  [[nodiscard]] std::vector<std::string> failure() const {
    return failed() ? std::vector{"error: " + last_.error} : std::vector<std::string>();
  }

  [[nodiscard]] PhaseRecord setup_row(Phase phase, State state) const {
    PhaseRecord row{phase, state, last_.provenance, {}, {}, setup_[index(phase, state)]};
    const bool complete = static_cast<int>(row.samples.size()) >= request_.setup_repeats;
    if (!complete) {
      append(row.reasons, failed() ? failure() : std::vector<std::string>{"few_samples"});
    } else if (is_clock_bound(median(row.samples), 1, last_.clock)) {
      row.reasons.emplace_back("clock_bound");
    }
    if (phase == Phase::kPrepare) {
      // It ends with a completed run, and that run was wrong.
      if (last_.wrong_output) row.reasons.emplace_back("wrong_output");
      append(row.notes, last_.notes);
    }
    if (environment_.empty()) row.notes.emplace_back("no_kernel_cache");
    if (request_.unit.shares_cores) row.notes.emplace_back("shared_core");
    return row;
  }

  /// Nothing for a phase that the sampling did not find, such as launching on a device without time
  /// stamps.
  [[nodiscard]] std::optional<PhaseRecord> call_row(Phase phase) const {
    const auto found = std::ranges::find(last_.phases, phase, &PhaseSamples::phase);
    const bool none = found == last_.phases.end();
    if (none && !failed() && !last_.wrong_output) return std::nullopt;
    PhaseRecord row{phase, State::kSteady, last_.provenance, failure(), last_.notes, {}};
    if (none) {
      if (last_.wrong_output) row.reasons.emplace_back("wrong_output");
    } else {
      row.samples = found->samples;
      append(row.reasons, judge(*found, last_, request_.job.sampling, unstable_));
      append(row.notes, annotate(*found, last_, request_.job.sampling));
    }
    if (request_.unit.shares_cores) row.notes.emplace_back("shared_core");
    return row;
  }

  const CellRequest& request_;
  const JobRunner& runner_;
  CacheFolder cache_;
  std::vector<std::pair<std::string, std::string>> environment_;
  std::array<std::vector<Nanos>, kSetupPhases.size() * kSetupStates.size()> setup_;
  JobResult last_;
  bool unstable_ = false;
};

}  // namespace

std::optional<CellRecord> measure_cell(const CellRequest& request, const JobRunner& runner) {
  CellMeasurement cell(request, runner);
  if (!cell.measure()) return std::nullopt;
  return cell.record();
}

CellRecord failed_cell(const CellRequest& request, const std::string& error) {
  const JobRunner unused("", Nanos(0), nullptr);
  CellMeasurement cell(request, unused);
  cell.fail(error);
  return cell.record();
}

}  // namespace pirt
