#include "characterize/campaign/cell.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <map>
#include <utility>

#include "characterize/energy/model.h"
#include "characterize/statistics/rank_tests.h"
#include "characterize/statistics/statistics.h"

namespace pirt {
namespace {

constexpr std::array kSetupStates = {State::kCold, State::kWarm};
constexpr int kFewestRepeats = 4;  // two halves of two processes

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
      environment_(request_.backend.kernel_cache_environment(cache_.string())) {}

CellMeasurement::~CellMeasurement() {
  std::error_code ignored;
  std::filesystem::remove_all(cache_, ignored);
}

std::optional<Visit> CellMeasurement::next() const {
  if (failed()) return std::nullopt;
  const int taken = processes();
  if (taken < setups()) return Visit{taken % 2 == 0 ? State::kCold : State::kWarm, true};
  if (wrong_output()) return std::nullopt;
  if (again_at_ && !repeated()) return Visit{State::kWarm, true};
  if (unstable_ || taken >= kMostProcesses) return std::nullopt;
  if (is_precise()) return std::nullopt;
  return Visit{State::kWarm, false};
}

std::optional<JobResult> CellMeasurement::visit() {
  const Visit visit = next().value();
  if (visit.setup == State::kCold) {
    empty_folder(cache_);
  } else if (!cache_filled_ && !environment_.empty()) {
    // Going on with an earlier campaign, whose cache went with it.
    begin_step("filling the kernel cache");
    empty_folder(cache_);
    auto filled = run(JobKind::kSetup);
    if (!filled || !filled->error.empty()) return filled;
  }
  const bool again = again_at_ && !repeated();
  begin_step(fmt::format("process {}, {}", processes() + 1,
                         again          ? fmt::format("again ({})", again_why_)
                         : visit.needed ? fmt::format("{} set-up", to_string(visit.setup))
                                        : "for precision"));
  // A wrong computation is not timed, but its set-up is.
  return run(wrong_output() ? JobKind::kSetup : JobKind::kSample);
}

void CellMeasurement::begin_step(const std::string& step) {
  step_ = step;
  request_.on_step(step);
}

std::optional<JobResult> CellMeasurement::run(JobKind kind) {
  Job job = request_.job;
  job.kind = kind;
  job.verifies_first = taken_.empty();  // the others find the same before they time, or after it
  auto result = runner_.run(job, environment_, [this](std::string_view progress) {
    request_.on_step(fmt::format("{}: {}", step_, progress));
  });
  cache_filled_ = result && result->error.empty();
  return result;
}

void CellMeasurement::add(State setup, JobResult result) {
  if (!result.error.empty() && ++failures_ == 1) {
    first_failure_ = {setup, std::move(result)};
    return;
  }
  taken_.push_back({setup, std::move(result)});
  if (!failed() && processes() >= setups()) judge_samples();
}

bool CellMeasurement::believe_first_failure() {
  if (!taken_.empty() || !first_failure_) return false;
  taken_.push_back(*std::exchange(first_failure_, std::nullopt));
  return true;
}

void CellMeasurement::judge_samples() {
  if (again_at_ && !repeated()) return;
  if (is_settled_by_one()) {
    reached_ = 0;
    return;
  }
  const CellSamples calls = samples(Phase::kCall);
  unstable_ = is_unstable(calls.samples, calls.processes);
  measure_precision();
  if (again_at_) return;
  again_why_ = unstable_ ? "unstable" : is_spoilt_by_others(conditions()) ? "contended" : "";
  if (!again_why_.empty()) again_at_ = taken_.size();
}

void CellMeasurement::measure_precision() {
  reached_.reset();
  for (const Phase phase : {Phase::kCall, Phase::kExecute}) {
    const CellSamples found = samples(phase);
    if (found.samples.empty()) continue;
    const auto medians = process_medians(found.samples, found.processes);
    const auto half = relative_half_width(interval_over_processes(medians), median(medians));
    if (!half) {
      reached_.reset();
      return;
    }
    reached_ = std::max(reached_.value_or(0), *half);
  }
}

/// Where all processes say the same, more would too.
bool CellMeasurement::is_precise() const {
  if (!reached_ || *reached_ > request_.precision) return false;
  return *reached_ == 0 || static_cast<int>(shown().size()) >= kFewestForPrecision;
}

int CellMeasurement::needed_visits() const {
  if (failed()) return 0;
  if (processes() < setups()) return setups() - processes();
  if (!again_at_ || wrong_output()) return 0;
  return std::max(0, static_cast<int>(*again_at_) + repeats() - processes());
}

int CellMeasurement::expected_visits() const {
  const int needed = needed_visits();
  if (needed > 0 || !next()) return needed;
  return visits_to_precision().value_or(kMostProcesses - processes());
}

std::optional<int> CellMeasurement::visits_to_precision() const {
  if (!reached_) return std::nullopt;
  const double ratio = *reached_ / request_.precision;
  const int now = static_cast<int>(shown().size());
  const double wanted = std::ceil(now * (ratio * ratio - 1));
  if (wanted > kMostProcesses - processes()) return std::nullopt;
  return std::max({1, static_cast<int>(wanted), kFewestForPrecision - now});
}

/// Two processes where all figures repeat exactly: the second one checks that they do.
int CellMeasurement::setups() const { return is_settled_by_one() ? 2 : 2 * request_.setup_repeats; }

/// Whether nothing about the cell varies: no phase is measured, and the others repeat.
bool CellMeasurement::is_settled_by_one() const {
  if (taken_.empty() || taken_.front().result.accounts.empty()) return false;
  const JobResult& first = taken_.front().result;
  return std::ranges::all_of(first.accounts, [&first](const PhaseAccount& account) {
    return first.repeats(account.phase) || !account.accounting.unknown.empty();
  });
}

int CellMeasurement::repeats() const { return std::max(kFewestRepeats, request_.setup_repeats); }

/// Whether a cell that was not to be believed has been sampled again to the end.
bool CellMeasurement::repeated() const {
  return again_at_ && processes() >= static_cast<int>(*again_at_) + repeats();
}

/// The processes that the figures of calls come from.
std::span<const CellMeasurement::Taken> CellMeasurement::shown() const {
  const std::span all(taken_);
  if (!again_at_) return all;
  return repeated() ? all.subspan(*again_at_) : all.first(*again_at_);
}

CellSamples CellMeasurement::samples(Phase phase) const {
  CellSamples all{.phase = phase, .batch = 0};
  std::int32_t process = 0;
  for (const Taken& taken : shown()) {
    const auto found = std::ranges::find(taken.result.phases, phase, &PhaseSamples::phase);
    if (found == taken.result.phases.end() || found->samples.empty()) continue;
    all.odd_stamps += found->odd_stamps;
    const bool has_cpu = all.cpu.size() == all.samples.size() && !found->cpu.empty();
    all.samples.insert(all.samples.end(), found->samples.begin(), found->samples.end());
    all.processes.resize(all.samples.size(), process++);
    all.others.push_back(taken.result.during_calls.others);
    if (has_cpu) all.cpu.insert(all.cpu.end(), found->cpu.begin(), found->cpu.end());
    all.batch = all.batch == 0 ? found->batch : std::min(all.batch, found->batch);
  }
  return all;
}

std::optional<Nanos> CellMeasurement::bound(Phase phase) const {
  std::vector<Nanos> bounds;
  for (const Taken& taken : shown()) {
    const auto found = std::ranges::find(taken.result.phases, phase, &PhaseSamples::phase);
    if (found != taken.result.phases.end() && found->bound) bounds.push_back(*found->bound);
  }
  return bounds.empty() ? std::nullopt : std::optional(median(bounds));
}

/// What opened the device first, or the first of all.
const JobResult* CellMeasurement::opened() const {
  const auto found = std::ranges::find_if(
      taken_, [](const Taken& taken) { return taken.result.device.has_value(); });
  return found == taken_.end() ? nullptr : &found->result;
}

std::string CellMeasurement::unknown(Phase phase) const {
  const JobResult* result = opened();
  return result == nullptr ? "" : result->unknown(phase);
}

/// Of a process that has samples of the phase, if there is one.
const JobResult* CellMeasurement::timed(Phase phase) const {
  for (const Taken& taken : taken_) {
    const auto found = std::ranges::find(taken.result.phases, phase, &PhaseSamples::phase);
    if (found != taken.result.phases.end() && !found->samples.empty()) return &taken.result;
  }
  return opened();
}

bool CellMeasurement::wrong_output() const {
  return std::ranges::any_of(taken_, [](const Taken& taken) { return taken.result.wrong_output; });
}

namespace {

/// What befell so many of a row's processes that it concerns the row.
void take_in(std::span<const Interference> processes, CellConditions& conditions) {
  const auto befell = [&processes](bool Interference::*what) {
    return concerns_row(std::ranges::count(processes, true, what),
                        static_cast<std::int64_t>(processes.size()));
  };
  conditions.contended = befell(&Interference::contended);
  conditions.crowded = befell(&Interference::crowded);
  conditions.throttled = befell(&Interference::throttled);
}

}  // namespace

/// Of the time of calls, what they did not have of their cores, by their processor time: no more
/// than others used, since a call may leave cores idle itself.
std::optional<double> CellMeasurement::taken(const CellSamples& calls) const {
  if (calls.cpu.size() != calls.samples.size()) return std::nullopt;
  const auto cores = cores_or_usable(request_.unit.cores).size();
  const auto wall = process_medians(calls.samples, calls.processes);
  const auto cpu = process_medians(calls.cpu, calls.processes);
  std::vector<double> shares;
  for (std::size_t i = 0; i < wall.size(); ++i) {
    if (wall[i] <= Nanos::zero()) return std::nullopt;
    const double idle = 1 - to_s(cpu[i]) / to_s(wall[i]) / static_cast<double>(cores);
    shares.push_back(std::min(idle, calls.others[i].value_or(idle)));
  }
  return std::clamp(median_of(shares), 0.0, 1.0);
}

/// Of calls.
CellConditions CellMeasurement::conditions() const {
  CellConditions found;
  std::vector<Interference> processes;
  for (const Taken& taken : shown()) {
    found.clock.cost_ns = std::max(found.clock.cost_ns, taken.result.clock.cost_ns);
    found.clock.resolution = std::max(found.clock.resolution, taken.result.clock.resolution);
    processes.push_back(taken.result.during_calls);
  }
  take_in(processes, found);
  found.wrong_output = wrong_output();
  found.unstable = unstable_;
  found.precise = reached_ && *reached_ <= request_.precision;
  const CellSamples calls = samples(Phase::kCall);
  if (calls.samples.empty()) return found;
  found.call = median(calls.samples, calls.processes);
  if (found.contended) found.taken = taken(calls);
  return found;
}

CellConditions CellMeasurement::setup_conditions(State state) const {
  CellConditions found;
  std::vector<Interference> processes;
  for (const Taken& taken : taken_) {
    if (taken.setup == state) processes.push_back(taken.result.during_setup);
  }
  take_in(processes, found);
  return found;
}

bool CellMeasurement::metering_due() const {
  return !request_.job.metering.meters.empty() && !taken_.empty() && !failed() && !wrong_output() &&
         !metered_;
}

bool CellMeasurement::meter() {
  begin_step("metering");
  Job job = request_.job;
  job.kind = JobKind::kMeter;
  metered_ = runner_.run(job, environment_);
  return metered_.has_value();
}

std::optional<double> CellMeasurement::idle_w() const {
  return metered_ && metered_->metered ? metered_->metered->idle_before_w : std::nullopt;
}

EnergyRecord CellMeasurement::energy(const PhaseRecord& call,
                                     std::span<const PhaseRecord> phases) const {
  const MeterRequest& request = request_.job.metering;
  if (request.meters.empty() || (!metered_ && !metering_due())) {
    const JobResult* const device = opened();
    const UnitModel unit =
        device != nullptr ? on_device(request_.unit, device->device->is_cpu) : request_.unit;
    return model_energy(request_.platform, unit, request_.workload, call, work(), phases);
  }
  if (metered_ && metered_->metered) {
    MeteredCalls metered = *metered_->metered;
    // A simulated device's time has nothing to do with the machine's.
    const bool same_clock = call.provenance == Origin(Provenance::kMeasured);
    if (same_clock && !call.samples.empty())
      check_call_time(metered, mean(call.samples, call.processes));
    return metered_energy(metered);
  }
  MeteredCalls none;
  none.source = request.source;
  none.domain = request.domain;
  if (!metered_) {
    none.reasons = {"not_metered: the run ended before"};
  } else {
    none.reasons = {metered_->error.empty() ? "wrong_output" : "error: " + metered_->error};
  }
  return metered_energy(none);
}

CellRecord CellMeasurement::record() const {
  const Workload& workload = request_.workload;
  CellRecord cell;
  cell.workload = workload.name;
  cell.unit = request_.unit.name;
  const CallWork call_work = work();
  cell.ops = call_work.ops;
  cell.bytes = call_work.bytes;
  for (const Taken& taken : taken_) {
    cell.host_memory_bytes =
        std::max(cell.host_memory_bytes, taken.result.host_memory_bytes);  // absent is least
    cell.device_memory_bytes = std::max(cell.device_memory_bytes, taken.result.device_memory_bytes);
    // That of the last process that compared, or the one that was wrong.
    if (taken.result.verification.empty()) continue;
    cell.verification = taken.result.verification;
    if (taken.result.wrong_output) break;
  }
  for (const Phase phase : request_.backend.phases()) {
    if (is_setup(phase)) {
      for (const State state : kSetupStates) cell.phases.push_back(setup_row(phase, state));
    } else if (auto row = call_row(phase)) {
      cell.phases.push_back(std::move(*row));
    }
  }
  if (failures_ > 0) {
    for (PhaseRecord& row : cell.phases) {
      row.notes.push_back(std::string(kFailedProcesses) + std::to_string(failures_));
    }
  }
  cell.conditions = condition_rows();
  const auto call = std::ranges::find(cell.phases, Phase::kCall, &PhaseRecord::phase);
  if (call != cell.phases.end()) {
    cell.energy = energy(*call, cell.phases);
  }
  return cell;
}

Origin CellMeasurement::provenance(Phase phase) const {
  const JobResult* result = timed(phase);
  return result == nullptr ? request_.provenance : result->origin(phase);
}

bool CellMeasurement::repeats(Phase phase) const {
  const JobResult* result = timed(phase);
  return result != nullptr && result->repeats(phase);
}

/// Operations and bytes of a call: what a process found in the data, which are the same in all, or
/// else what the workload says of all data.
CallWork CellMeasurement::work() const {
  for (const Taken& taken : taken_) {
    if (taken.result.bytes) return {taken.result.ops, *taken.result.bytes};
  }
  return {request_.workload.ops, request_.workload.bytes()};
}

/// Of the data, which are the same in all processes; one that failed early may not have them.
std::vector<std::string> CellMeasurement::notes() const {
  for (const Taken& taken : taken_) {
    if (!taken.result.notes.empty()) return taken.result.notes;
  }
  return {};
}

/// Why every row of a cell whose worker failed is not valid, as far as the row is not complete.
std::vector<std::string> CellMeasurement::failure() const {
  return failed() ? std::vector{"error: " + taken_.back().result.error}
                  : std::vector<std::string>();
}

namespace {

/// Whether the samples of every process are those of the first.
bool is_same_in_all(const CellSamples& found) {
  std::map<std::int32_t, std::vector<Nanos>> of;
  for (std::size_t i = 0; i < found.samples.size(); ++i) {
    of[found.processes[i]].push_back(found.samples[i]);
  }
  return std::ranges::all_of(
      of, [&of](const auto& entry) { return entry.second == of.begin()->second; });
}

std::string count_text(const std::vector<Nanos>& samples) {
  const auto [least, most] = std::ranges::minmax(samples);
  return fmt::format("{} ns to {} ns", least.count(), most.count());
}

/// Of a phase whose figure repeats: the first process' samples, if the others have the same.
/// @return Why it is not valid; empty if it is.
std::string keep_first(CellSamples& found) {
  if (!is_same_in_all(found)) {
    return "counts_differ: " + count_text(found.samples) + ", and the device says that they repeat";
  }
  const auto others = std::ranges::count_if(found.processes, [&found](std::int32_t process) {
    return process != found.processes.front();
  });
  found.samples.resize(found.samples.size() - static_cast<std::size_t>(others));
  found.processes.resize(found.samples.size());
  return "";
}

PhaseRecord unknown_row(Phase phase, State state, const std::string& why) {
  PhaseRecord row;
  row.phase = phase;
  row.state = state;
  row.reasons = {std::string(kUnknownPhase) + why};
  return row;
}

}  // namespace

PhaseRecord CellMeasurement::setup_row(Phase phase, State state) const {
  if (const std::string why = unknown(phase); !why.empty()) return unknown_row(phase, state, why);
  PhaseRecord row;
  row.phase = phase;
  row.state = state;
  row.provenance = provenance(phase);
  row.deterministic = repeats(phase);
  ClockQuality clock;
  for (const Taken& taken : taken_) {
    const JobResult& result = taken.result;
    const auto& time = phase == Phase::kDeviceInit ? result.device_init : result.prepare;
    if (taken.setup != state || !time) continue;
    row.processes.push_back(static_cast<std::int32_t>(row.samples.size()));
    row.samples.push_back(*time);
    if (result.is_measured(phase)) clock = result.clock;
  }
  if (row.deterministic && !row.samples.empty()) {
    CellSamples found{phase, std::move(row.samples), std::move(row.processes)};
    if (const std::string why = keep_first(found); !why.empty()) row.reasons.push_back(why);
    row.samples = std::move(found.samples);
    row.processes = std::move(found.processes);
    row.notes.emplace_back(kDeterministic);
  }
  const int needed = row.deterministic ? 1 : request_.setup_repeats;
  const bool complete = static_cast<int>(row.samples.size()) >= needed;
  if (!complete) {
    if (failed()) {
      append(row.reasons, failure());
    } else {
      hold_against(row, judgement_of({"few_samples"}, !row.samples.empty()));
    }
  } else if (is_clock_bound(median(row.samples), 1, clock)) {
    row.reasons.emplace_back("clock_bound");
  }
  if (!row.deterministic) {
    const CellConditions known = setup_conditions(state);
    hold_against(row, judge_setups(row.samples, known));
    if (known.contended && !known.crowded) row.notes.emplace_back("contended");
  }
  if (phase == Phase::kPrepare) {
    // It ends with a completed run, and that run was wrong.
    if (wrong_output()) row.reasons.emplace_back("wrong_output");
    append(row.notes, notes());
  }
  if (environment_.empty()) row.notes.emplace_back("no_kernel_cache");
  if (request_.unit.shares_cores) row.notes.emplace_back("shared_core");
  return row;
}

/// Nothing for a phase that the sampling did not find, such as launching on a device without time
/// stamps.
std::optional<PhaseRecord> CellMeasurement::call_row(Phase phase) const {
  if (const std::string why = unknown(phase); !why.empty()) {
    return unknown_row(phase, State::kSteady, why);
  }
  CellSamples found = samples(phase);
  const bool none = found.samples.empty();
  if (none && !failed() && !wrong_output()) return std::nullopt;
  PhaseRecord row;
  row.phase = phase;
  row.provenance = provenance(phase);
  row.bound = bound(phase);
  row.reasons = failure();
  row.notes = notes();
  if (none) {
    if (wrong_output()) row.reasons.emplace_back("wrong_output");
  } else {
    CellConditions known = conditions();
    if (!timed(phase)->is_measured(phase)) known.clock = {};  // which told nothing of it
    known.deterministic = row.deterministic = repeats(phase);
    if (known.deterministic) {
      if (const std::string why = keep_first(found); !why.empty()) row.reasons.push_back(why);
    }
    hold_against(row, judge(found, known));
    row.taken = known.taken;
    row.cpu = std::move(found.cpu);
    append(row.notes, annotate(found, known, request_.precision));
    row.samples = std::move(found.samples);
    row.processes = std::move(found.processes);
  }
  if (request_.unit.shares_cores) row.notes.emplace_back("shared_core");
  return row;
}

/// Those that some process sampled, by the same rules as steady ones; the cell's own precision says
/// nothing of them.
std::vector<PhaseRecord> CellMeasurement::condition_rows() const {
  std::map<Condition, CellSamples> found;
  std::int32_t process = 0;
  for (const Taken& taken : shown()) {
    for (const auto& [condition, samples] : taken.result.conditions) {
      CellSamples& all =
          found.try_emplace(condition, CellSamples{.phase = samples.phase}).first->second;
      all.samples.insert(all.samples.end(), samples.samples.begin(), samples.samples.end());
      all.processes.resize(all.samples.size(), process);
    }
    ++process;
  }
  std::vector<PhaseRecord> rows;
  for (auto& [condition, samples] : found) {
    PhaseRecord row;
    row.phase = samples.phase;
    row.condition = condition;
    row.provenance = provenance(samples.phase);
    const CellConditions known = conditions();
    row.reasons = failure();
    hold_against(row, judge(samples, known));
    row.taken = known.taken;
    row.notes = notes();
    append(row.notes, annotate(samples, known, request_.precision));
    row.samples = std::move(samples.samples);
    row.processes = std::move(samples.processes);
    rows.push_back(std::move(row));
  }
  return rows;
}

CellRecord failed_cell(const CellRequest& request, const std::string& error) {
  const JobRunner unused("", Nanos(0), nullptr);
  CellMeasurement cell(request, unused);
  JobResult failure;
  failure.error = error;
  cell.taken_.push_back({State::kCold, std::move(failure)});
  cell.failures_ = 2;  // the reference's processes
  return cell.record();
}

}  // namespace pirt
