#include "characterize/worker/worker.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>
#include <istream>
#include <iterator>
#include <optional>
#include <ostream>

#include "characterize/machine/answering.h"
#include "characterize/machine/host_load.h"
#include "characterize/platform/platform.h"
#include "characterize/statistics/statistics.h"
#include "characterize/worker/cache_sweep.h"
#include "characterize/worker/job.h"
#include "characterize/worker/neighbour.h"
#include "characterize/worker/own_checks.h"
#include "characterize/worker/peaks.h"
#include "characterize/worker/resident_memory.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/system/caches.h"
#include "workloads/base/system/control_groups.h"
#include "workloads/base/text/json.h"
#include "workloads/catalog/catalog.h"
#include "workloads/catalog/own_files.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/device_memory.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/player.h"
#include "workloads/model/remote.h"
#include "workloads/model/tensor_file.h"
#include "workloads/own/guarded_memory.h"

namespace pirt {
namespace {

/// Of the data, each once, and that they are a sequence.
std::vector<std::string> notes_of(const Workload& workload, std::span<const Data> frames) {
  std::vector<std::string> notes;
  for (const Data& data : frames) {
    for (const std::string& note : data.notes) {
      if (std::ranges::find(notes, note) == notes.end()) notes.push_back(note);
    }
  }
  if (workload.is_played()) notes.push_back(sequence_note(workload));
  return notes;
}

/// Weights of a large layer are made as fast as they are read, and would fill the disk.
constexpr std::size_t kMostKept = std::size_t{8} << 20;

std::size_t size_bytes(std::span<const Data> frames) {
  std::size_t size = 0;
  for (const Data& data : frames) {
    for (const Tensor& tensor : data.inputs) size += tensor.bytes().size();
    for (const Tensor& tensor : data.parameters) size += tensor.bytes().size();
  }
  return size;
}

/// The calls that are metered. A meter sees what lies between frames too, such as resetting the
/// state: each frame is called again and again without going on, so often that the window sees the
/// sequence about once.
class MeteredFrames {
 public:
  MeteredFrames(Player& player, const Clock& clock, Nanos window) : player_(player) {
    const Nanos start = clock.now();
    for (std::size_t i = 0; i < player.frames(); ++i) {
      player.call();
      player.next();
    }
    const Nanos once = std::max(clock.now() - start, Nanos(1));
    calls_ = std::max<std::int64_t>(1, (window + once - Nanos(1)) / once);
  }

  void call() {
    if (called_ == calls_) {
      player_.next();
      called_ = 0;
      frame_ = (frame_ + 1) % player_.frames();
    }
    player_.call();
    ++called_;
  }

  /// Every frame was called as often as the others: a mean over them is the sequence's.
  [[nodiscard]] bool is_at_end() const {
    return player_.frames() == 1 || (called_ == calls_ && frame_ + 1 == player_.frames());
  }

 private:
  Player& player_;
  std::size_t frame_ = 0;
  std::int64_t calls_ = 1;  ///< Of each frame.
  std::int64_t called_ = 0;
};

class Worker {
 public:
  /// @param records  Null = nobody follows.
  Worker(const Job& job, const Injection& injection, std::ostream* records, JobResult& result)
      : job_(job),
        injection_(injection),
        records_(records),
        result_(result),
        backend_(find_backend(job.backend)) {}

  void run() {
    if (!job_.own.empty()) load_own();
    switch (job_.kind) {
      case JobKind::kDescribe:
        break;
      case JobKind::kProbe:
        probe();
        break;
      case JobKind::kDevices:
        begin("probing the backend");
        result_.found = backend_.probe();
        break;
      case JobKind::kReference:
        reference();
        break;
      case JobKind::kSetup:
        set_up();
        break;
      case JobKind::kSample:
        set_up();
        sample();
        break;
      case JobKind::kMeter:
        set_up();
        meter();
        break;
      case JobKind::kPeaks:
        peaks();
        break;
    }
  }

 private:
  /// Says that the device goes on, however slow this machine is at it.
  void show_life(std::int64_t samples) {
    // Twenty signs at most before the machine's limit ends the sampling: of fast devices none.
    const Nanos now = machine_.now();
    const bool due = now - life_shown_ >= job_.sampling.limit / 20;
    if (records_ == nullptr || device_->own_clock() == nullptr || !due) return;
    life_shown_ = now;
    *records_ << progress_record(fmt::format("{}, {} samples in {:.3g} s of this machine",
                                             result_.step, samples, to_s(machine_.now() - begun_)))
              << std::endl;
  }

  /// From here on a failure is one of doing @p what.
  void begin(const std::string& what) {
    result_.step = what;
    begun_ = machine_.now();
    if (records_ != nullptr) *records_ << to_record(result_) << std::endl;
  }

  void probe() {
    begin("probing the backend");
    const Probe found = backend_.probe();
    if (!found.available) throw_environment(found.reason);
    begin("opening the device");
    const auto device = backend_.open(job_.unit);
    result_.device = device->info();
    result_.provenance = device->provenance();
  }

  /// What the workload's file has; what it says goes to standard error, as a library's words do.
  void load_own() {
    begin("loading " + job_.own);
    Json definitions = Json::array();
    for (const own::Definition& each : load_workloads(job_.own)) {
      if (!job_.own_digest.empty() && each.digest != job_.own_digest) {
        throw_environment(job_.own +
                          " is not what it was when the run began; start a new run; what its "
                          "program writes itself stands under `writes`");
      }
      definitions.push_back(own::to_json(each));
    }
    if (job_.kind == JobKind::kDescribe) result_.definitions = json_text(definitions);
  }

  void peaks() {
    begin("opening the device");
    const auto device = backend_.open(job_.unit);
    result_.device = device->info();
    result_.provenance = device->provenance();
    begin("measuring peaks");
    const Clock* own = device->own_clock();
    result_.peaks = measure_peaks(*device, own != nullptr ? *own : machine_);
  }

  std::vector<Data> make_data(const Workload& workload) {
    begin("making the input data");
    const bool may_be_there = job_.kind != JobKind::kReference && !job_.inputs.empty();
    if (may_be_there && std::filesystem::exists(job_.inputs)) {
      initial_ = read_state(job_.inputs, workload);
      return read_data(job_.inputs, workload);
    }
    if (workload.state) initial_ = workload.make_state();
    const auto images = job_.images.empty() ? generated_images(job_.seed)
                                            : images_from(job_.images, job_.images_topic);
    auto frames = make_sequence(workload, {job_.seed, images.get()});
    check_inputs(workload, frames);
    return frames;
  }

  void reference() {
    const Workload& workload = find_workload(job_.workload);
    const auto data = make_data(workload);
    if (!job_.inputs.empty() && size_bytes(data) <= kMostKept) {
      write_data(job_.inputs, data, initial_);
    }
    if (has_reference(workload)) {
      begin("computing the reference");
      write_reference(job_.reference, reference_of(workload, data));
    } else {
      begin("computing what others are compared with");
      write_reference(job_.reference, computed_here(workload, data));
    }
  }

  static bool has_reference(const Workload& workload) {
    return workload.reference || workload.step;
  }

  /// What this unit makes of the data.
  std::vector<std::vector<Tensor>> computed_here(const Workload& workload,
                                                 const std::vector<Data>& data) {
    device_ = backend_.open(job_.unit);
    player_.emplace(device_->prepare(workload, data.front().parameters), workload, data,
                    std::move(initial_), &guarded_);
    player_->scribble(std::byte{0});  // Of samples other bytes: what nobody writes is not the same.
    player_->complete();
    std::vector<std::vector<Tensor>> outputs;
    for (const PlayedFrame& frame :
         player_->played(std::vector<std::vector<Tensor>>(data.size()))) {
      outputs.push_back(own::widened(frame.outputs));
    }
    return outputs;
  }

  void set_up() {
    const Workload& workload = find_workload(job_.workload);
    data_ = make_data(workload);
    result_.notes = notes_of(workload, data_);

    begin("opening the device");
    const Before before = counters_before();
    const Nanos start = machine_.now();
    device_ = backend_.open(job_.unit);
    const Nanos opened = machine_.now();
    take_accounts();
    result_.device = device_->info();
    if (result_.unknown(Phase::kDeviceInit).empty()) {
      // An own clock starts at 0.
      result_.device_init =
          is_own(Phase::kDeviceInit) ? device_->own_clock()->now() : opened - start;
    }

    std::optional<ExtraWork> extra;
    if (injection_.prepare > 1) extra.emplace(machine_);
    begin("preparing");
    const Clock& clock = is_own(Phase::kPrepare) ? *device_->own_clock() : machine_;
    const ResidentMemory resident;
    const Nanos begun = clock.now();
    const auto memory = device_->output_memory();
    TensorMemory* const outputs =
        memory == nullptr && own_operation(workload) != nullptr ? &guarded_ : memory.get();
    player_.emplace(device_->prepare(workload, data_.front().parameters), workload, data_,
                    std::move(initial_), outputs);
    if (!has_reference(workload)) result_.notes.emplace_back("unverified");
    if (memory != nullptr && player_->outputs_in(*memory)) {
      result_.notes.emplace_back("pinned_outputs");
    }
    const Nanos beside = first_call();
    if (extra) {
      const auto taken = static_cast<double>((clock.now() - begun).count());
      ExtraWork::run(extra->steps_for(Nanos(std::llround((injection_.prepare - 1) * taken))));
    }
    if (result_.unknown(Phase::kPrepare).empty()) result_.prepare = clock.now() - begun + beside;
    result_.during_setup = interference_since(before);
    take_memory(resident);
    show_life(0);
    player_->wrap_kernel([this](std::unique_ptr<Kernel> kernel) {
      return slowed(std::move(kernel), injection_.execute, machine_);
    });
  }

  /// With what it was given, which was there before.
  void take_memory(const ResidentMemory& resident) {
    if (is_elsewhere() || device_->own_clock() != nullptr) return;
    held_bytes_ = static_cast<std::int64_t>(size_bytes(std::span(data_).first(1)));
    take_host_memory(resident);
    held_bytes_ += resident.kept_bytes();
    const auto* const counted = dynamic_cast<const DeviceMemory*>(&player_->kernel());
    if (counted != nullptr) result_.device_memory_bytes = counted->device_memory_bytes();
  }

  /// The highest of the set-up and the calls, with what was there before either, and what another
  /// process has.
  void take_host_memory(const ResidentMemory& resident) {
    const auto added = resident.added_bytes();
    if (!added) return;
    const auto* const other = program();
    const std::int64_t elsewhere = other != nullptr ? other->peak_bytes().value_or(0) : 0;
    result_.host_memory_bytes =
        std::max(result_.host_memory_bytes.value_or(0), held_bytes_ + *added + elsewhere);
  }

  /// That computes for this process; null if none does.
  [[nodiscard]] const OtherProcess* program() {
    return player_ ? dynamic_cast<const OtherProcess*>(&player_->kernel()) : nullptr;
  }
  [[nodiscard]] std::optional<Nanos> program_time() {
    const auto* const other = program();
    return other != nullptr ? other->processor_time() : std::nullopt;
  }
  /// The program's time is this process' own.
  [[nodiscard]] HostCounters counters(const std::vector<int>& cores) {
    HostCounters found = read_host_counters(cores);
    found.own += program_time().value_or(Nanos(0));
    return found;
  }

  struct Before {
    HostCounters host;
    ProcessTimes processes;
  };
  /// Processes where they may answer the device: elsewhere, or not yet known.
  [[nodiscard]] Before counters_before() {
    return {counters(cores_),
            device_ == nullptr || is_elsewhere() ? read_process_times() : ProcessTimes{}};
  }
  [[nodiscard]] bool is_elsewhere() const {
    return dynamic_cast<const Remote*>(device_.get()) != nullptr;
  }

  /// On the unit's cores; nothing on a device with a clock of its own, which others do not hold up.
  [[nodiscard]] Interference interference_since(const Before& before) {
    if (device_->own_clock() != nullptr) return {};
    if (is_elsewhere()) {
      const HostCounters after = counters(cores_);
      const ProcessTimes processes = read_process_times();
      return interference_elsewhere(
          before.host, after, used_by(answering_processes(processes), before.processes, processes));
    }
    return interference(before.host, counters(cores_), static_cast<int>(cores_.size()));
  }

  /// @return What of it is measured beside the device's own clock, which tells the preparation.
  Nanos first_call() {
    const PhaseClocks clocks = this->clocks();
    if (clocks.measured.empty() || !is_own(Phase::kPrepare)) {
      player_->call();
      return Nanos(0);
    }
    const SamplingOptions once{.warm_up = {}, .slice = {}, .warm_up_calls = 0, .min_samples = 1};
    Nanos beside{0};
    for (const auto& part : sample_calls(player_->kernel(), clocks, backend_.phases(), once)) {
      if (clocks.is_measured(part.phase)) beside += part.samples.front();
    }
    player_->called();
    return beside;
  }

  void take_accounts() {
    result_.provenance = device_->provenance();
    result_.own_clock = device_->own_clock() != nullptr;
    result_.deterministic = device_->is_deterministic();
    bool measured = false;
    for (const Phase phase : backend_.phases()) {
      if (phase == Phase::kCall) continue;
      result_.accounts.push_back({phase, device_->accounting(phase)});
      measured = measured || !is_own(phase);
    }
    if (measured) result_.clock = measure_clock(machine_);
  }

  /// Whether the device's own clock tells the time of @p phase.
  [[nodiscard]] bool is_own(Phase phase) const {
    return device_->own_clock() != nullptr &&
           result_.accounting(phase).provenance != Provenance::kMeasured;
  }

  /// Verifies what the calls since Player::scribble() wrote, of each frame of the sequence.
  bool verify(std::string_view when) {
    const Workload& workload = find_workload(job_.workload);
    player_->complete();
    show_life(0);
    guarded_.check();
    const Verdict verdict = verify_sequence(workload, player_->played(expected_));
    result_.verification = fmt::format("{}: {}", when, verdict.detail);
    result_.wrong_output = !verdict.ok;
    if (verdict.ok) {
      result_.ops = player_->mean_ops();
      result_.bytes = player_->mean_bytes();
    }
    return verdict.ok;
  }

  /// What repeats exactly does so from the same first call on.
  bool is_right() {
    if (job_.reference.empty()) return true;
    begin("verifying");
    expected_ = read_reference(job_.reference, find_workload(job_.workload));
    player_->scribble();
    if (job_.verifies_first && job_.backend == "cpu") {
      note_slices(find_workload(job_.workload), *player_, result_.notes);
    }
    return (!job_.verifies_first && !result_.deterministic) || verify("before timing");
  }

  /// Goes from sample to sample: the kernel was called by others.
  [[nodiscard]] PlayedCalls sequence() {
    return {.next =
                [this] {
                  player_->called();
                  player_->next();
                },
            .frames = static_cast<std::int64_t>(player_->frames())};
  }

  /// What repeats exactly is sampled once.
  [[nodiscard]] SamplingOptions sampling() const {
    SamplingOptions options = job_.sampling;
    const bool once = std::ranges::all_of(result_.accounts, [this](const PhaseAccount& account) {
      return is_setup(account.phase) || result_.repeats(account.phase);
    });
    if (!once || !result_.deterministic) return options;
    options.warm_up = options.slice = Nanos(0);
    options.warm_up_calls = 0;
    options.min_samples = 1;
    return options;
  }

  [[nodiscard]] PhaseClocks clocks() {
    const Clock* own = device_->own_clock();
    if (own == nullptr) {
      PhaseClocks clocks{.clock = machine_, .quality = result_.clock};
      if (computes_on_host() && !program_time()) clocks.processor = &processor_;
      return clocks;
    }
    PhaseClocks clocks{.clock = *own,
                       .quality = {},
                       .machine = &machine_,
                       .machine_quality = result_.clock,
                       .on_sample = [this](std::int64_t samples) { show_life(samples); }};
    for (const auto& [phase, accounting] : result_.accounts) {
      if (is_setup(phase)) continue;
      if (!accounting.unknown.empty()) {
        clocks.unknown.insert(phase);
      } else if (accounting.provenance == Provenance::kMeasured) {
        clocks.measured.insert(phase);
      }
    }
    return clocks;
  }

  void sample() {
    if (!is_right()) return;
    begin("sampling");
    player_->scribble();
    const auto phases = backend_.phases();
    const Before before = counters_before();
    const ResidentMemory resident;
    result_.phases = sample_calls(player_->kernel(), clocks(), phases, sampling(), sequence());
    if (result_.host_memory_bytes) take_host_memory(resident);
    sample_cold();
    result_.during_calls = interference_since(before);
    sample_beside(Condition::kBesideMemory, Neighbour::Work::kStreams);
    sample_beside(Condition::kBesideCompute, Neighbour::Work::kComputes);
    for (std::string& remark : player_->kernel().remarks()) {
      result_.notes.push_back(std::move(remark));
    }
    if (!job_.reference.empty()) verify("after timing");
  }

  /// Whether the host's caches are the device's, and its time the machine's.
  [[nodiscard]] bool computes_on_host() const {
    return device_->own_clock() == nullptr && device_->info().is_cpu;
  }

  void sample_cold() {
    if (job_.sampling.condition_samples == 0 || !computes_on_host()) return;
    const auto own = own_cache_bytes(cores_);
    const auto last = reached_cache_bytes(cores_);
    sample_after_sweep(Condition::kColdCache, own);
    if (job_.sampling.cold_memory && last && last != own)
      sample_after_sweep(Condition::kColdMemory, last);
  }

  /// Not of calls beside which filling the caches again is nothing: at most what emptying them
  /// takes.
  void sample_after_sweep(Condition condition, std::optional<std::int64_t> bytes) {
    constexpr int kNothingBeside = 20;
    const auto execute = std::ranges::find(result_.phases, Phase::kExecute, &PhaseSamples::phase);
    if (!bytes || *bytes > most_filled_bytes() || execute == result_.phases.end()) return;
    begin(fmt::format("sampling {}", to_string(condition)));
    CacheSweep sweep(cores_, *bytes);
    const Nanos start = machine_.now();
    sweep.run();
    if (median(execute->samples) > kNothingBeside * (machine_.now() - start)) return;
    result_.conditions.push_back(
        {condition, sample_executions(
                        player_->kernel(), machine_, job_.sampling.condition_samples,
                        [&sweep] { sweep.run(); }, sequence())});
  }

  /// Of several neighbours the one that slows it most. Not of calls so long that the process would
  /// come to its limit.
  void sample_beside(Condition condition, Neighbour::Work work) {
    const auto execute = std::ranges::find(result_.phases, Phase::kExecute, &PhaseSamples::phase);
    if (!computes_on_host() || execute == result_.phases.end()) return;
    const auto calls = job_.sampling.condition_samples * std::ssize(job_.neighbours);
    if (calls * median(execute->samples) > job_.sampling.limit / 4) return;
    std::optional<PhaseSamples> worst;
    for (const auto& cores : job_.neighbours) {
      begin(fmt::format("sampling {}", to_string(condition)));
      const Neighbour neighbour(cores, work);
      auto samples = sample_executions(
          player_->kernel(), machine_, job_.sampling.condition_samples, [] {}, sequence());
      if (samples.samples.empty()) return;
      if (!worst || median(samples.samples) > median(worst->samples)) worst = std::move(samples);
    }
    if (worst) result_.conditions.push_back({condition, *std::move(worst)});
  }

  /// A board that idles for long lowers its clocks also while it is open: before the first window
  /// it is as awake as after the calls.
  void wake(std::span<const Meter* const> meters) {
    constexpr Nanos kWaking = std::chrono::milliseconds(300);
    const bool is_board = std::ranges::any_of(
        meters, [](const Meter* meter) { return meter->info().domain == MeterDomain::kGpu; });
    const Nanos begin = machine_.now();
    while (is_board && machine_.now() - begin < kWaking) player_->call();
  }

  /// The same calls, on the machine's clock even if the device has its own: meters know no other.
  void meter() {
    if (!is_right()) return;
    begin("metering");
    const auto found = discover_meters(job_.metering.sysfs, device_->own_clock() == nullptr);
    const auto meters = find_meters(found, job_.metering.meters);
    wake(meters);
    player_->restart();
    player_->scribble();
    const Nanos window = metering_window(meters, job_.metering.window);
    // A meter sees all cores, whoever uses them.
    const auto before = counters({});
    std::vector<MeteredCalls> repeats;
    do {
      MeteredFrames frames(*player_, machine_, window);
      repeats.push_back(meter_calls(
          meters, machine_, window, [&frames] { frames.call(); },
          [&frames] { return frames.is_at_end(); }));
    } while (repeats.back().reasons.empty() && std::ssize(repeats) < kMeteredRepeats &&
             machine_.now() - begun_ < kLongestWindow);
    result_.metered = joined_repeats(repeats);
    const auto after = counters({});
    const auto online = static_cast<int>(::sysconf(_SC_NPROCESSORS_ONLN));
    check_disturbance(*result_.metered, meters, interference(before, after, online));
    if (!verify("after metering")) {
      result_.metered->reasons.emplace_back("wrong_output");
    }
  }

  const Job& job_;
  const std::vector<int> cores_ = cores_or_usable(job_.unit.cores);  // no driver has bound it yet
  Injection injection_;
  std::ostream* records_;
  JobResult& result_;
  const Backend& backend_;
  MachineClock machine_;
  ProcessorClock processor_;
  Nanos begun_{0};  ///< The step.
  Nanos life_shown_ = machine_.now();
  std::vector<Data> data_;                     ///< Of each frame of the sequence.
  std::vector<Tensor> initial_;                ///< The state before them, until it is played.
  std::vector<std::vector<Tensor>> expected_;  ///< The same.
  std::int64_t held_bytes_ = 0;                ///< Of the workload, on the host, between calls.
  own::GuardedMemory guarded_;  ///< Of the outputs of what somebody else computes on the host.
  std::unique_ptr<Device> device_;
  std::optional<Player> player_;  // goes before its device
};

}  // namespace

int run_worker(std::istream& job, std::ostream& records) {
  JobResult result;
  int code = kExitEnvironment;
  try {
    const std::string text{std::istreambuf_iterator<char>(job), std::istreambuf_iterator<char>()};
    const Job parsed = job_from_json(text);
    Worker worker(parsed, {}, &records, result);
    worker.run();
    result.done = true;
    // Before the device is closed: a driver that dies then cannot take back what was measured.
    records << to_record(result) << std::endl;
    return 0;
  } catch (const Error& error) {
    result.error = error.what();
    code = exit_code(error.code());
  } catch (const std::bad_alloc&) {
    result.error = "out of memory; raise the limit on it (ulimit -v), or leave this workload out";
  } catch (const std::exception& error) {
    result.error = fmt::format("unexpected: {}", error.what());
  }
  records << to_record(result) << std::endl;
  return code;
}

JobResult do_job(const Job& job, const Injection& injection) {
  JobResult result;
  Worker(job, injection, nullptr, result).run();
  result.done = true;
  return result;
}

}  // namespace pirt
