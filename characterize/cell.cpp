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

void empty_folder(const std::filesystem::path& path) {
  std::filesystem::remove_all(path);
  std::filesystem::create_directories(path);
}

}  // namespace

CellMeasurement::CellMeasurement(CellRequest request, const JobRunner& runner)
    : request_(std::move(request)),
      runner_(runner),
      cache_(request_.scratch /
             fmt::format("kernels-{}-{}", request_.workload.name, request_.unit.name)),
      environment_(request_.backend.kernel_cache_environment(cache_.string())) {
  last_.provenance = request_.provenance;
}

CellMeasurement::~CellMeasurement() {
  std::error_code ignored;
  std::filesystem::remove_all(cache_, ignored);
}

bool CellMeasurement::measure() {
  const int repeats = request_.setup_repeats;
  for (int i = 1; i <= repeats; ++i) {
    empty_folder(cache_);
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
  return sample("sampling");
}

bool CellMeasurement::sample_again() { return sample("sampling again (unstable)"); }

bool CellMeasurement::sample(const std::string& step) {
  if (!run(JobKind::kSample, State::kWarm, step)) return false;
  unstable_ = !failed() && is_unstable(call_samples());
  return true;
}

CellRecord CellMeasurement::record() const {
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

bool CellMeasurement::run(JobKind kind, State state, const std::string& step) {
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

std::span<const Nanos> CellMeasurement::call_samples() const {
  const auto it = std::ranges::find(last_.phases, Phase::kCall, &PhaseSamples::phase);
  return it == last_.phases.end() ? std::span<const Nanos>() : it->samples;
}

std::vector<Nanos>& CellMeasurement::times(Phase phase, State state) {
  return setup_[{phase, state}];
}

const std::vector<Nanos>& CellMeasurement::times(Phase phase, State state) const {
  static const std::vector<Nanos> kNone;
  const auto found = setup_.find({phase, state});
  return found == setup_.end() ? kNone : found->second;
}

/// Why every row of a cell whose worker failed is not valid, as far as the row is not complete.
std::vector<std::string> CellMeasurement::failure() const {
  return failed() ? std::vector{"error: " + last_.error} : std::vector<std::string>();
}

PhaseRecord CellMeasurement::setup_row(Phase phase, State state) const {
  PhaseRecord row{phase, state, last_.provenance, {}, {}, times(phase, state)};
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
std::optional<PhaseRecord> CellMeasurement::call_row(Phase phase) const {
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

CellRecord failed_cell(const CellRequest& request, const std::string& error) {
  const JobRunner unused("", Nanos(0), nullptr);
  CellMeasurement cell(request, unused);
  cell.last_.error = error;
  return cell.record();
}

}  // namespace pirt
