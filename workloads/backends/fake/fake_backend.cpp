#include "workloads/backends/fake/fake_backend.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <thread>
#include <utility>

#include "workloads/backends/fake/fake_options.h"
#include "workloads/backends/fake/fake_script.h"
#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/math/random.h"
#include "workloads/model/tensor_file.h"

namespace pirt {
namespace {

constexpr const char* kCacheVariable = "PIRT_FAKE_KERNEL_CACHE";

/// Spends what the script says: on a clock of its own, or on everybody's.
class ScriptedClock : public Clock {
 public:
  explicit ScriptedClock(bool wall) : wall_(wall) {}

  [[nodiscard]] bool is_wall() const { return wall_; }
  [[nodiscard]] Nanos now() const override { return wall_ ? machine_.now() : now_; }

  /// @param since  When what takes that long began.
  void hold(Nanos by, Nanos since) {
    if (wall_) {
      std::this_thread::sleep_for(by - (machine_.now() - since));
      return;
    }
    if (by > Nanos::max() - now_) throw_bad_input("the times of a fake unit add up to 292 years");
    now_ += by;
  }
  void hold(Nanos by) { hold(by, now()); }

 private:
  bool wall_;
  MachineClock machine_;
  Nanos now_{0};
};

Nanos draw(const fake::ScriptedStage& stage, Random& random) {
  const auto width = static_cast<std::uint64_t>((stage.high - stage.low).count());
  return width == 0 ? stage.low
                    : stage.low + Nanos(static_cast<std::int64_t>(random.below(width + 1)));
}

/// A reference tensor in the element type of the output: references give floating point as f64.
void copy_converted(const Tensor& from, Tensor& to) {
  if (from.spec().element == to.spec().element) {
    copy_tensor(from, to);
    return;
  }
  assert(from.spec().element == Element::kF64 && to.spec().element == Element::kF32);
  if (to.spec().varies) to.set_rows(from.rows());
  std::ranges::transform(from.used<double>(), to.as<float>().begin(),
                         [](double value) { return static_cast<float>(value); });
}

void spoil_first_element(Tensor& tensor) {
  if (tensor.used_count() == 0) return;
  switch (tensor.spec().element) {
    case Element::kU8:
      tensor.as<std::uint8_t>()[0] ^= 1U;
      break;
    case Element::kI16:
      tensor.as<std::int16_t>()[0] ^= 1;
      break;
    case Element::kI32:
      tensor.as<std::int32_t>()[0] ^= 1;
      break;
    case Element::kF32:
      tensor.as<float>()[0] += 1.0F;
      break;
    case Element::kF64:
      tensor.as<double>()[0] += 1.0;
      break;
  }
}

bool same_content(const Tensor& a, const Tensor& b) {
  return std::ranges::equal(a.used_bytes(), b.used_bytes());
}

/// What a call gives: found once for inputs and a state, and kept for a while, since the same calls
/// come again and again.
class References {
 public:
  struct Result {
    std::vector<Tensor> outputs;  ///< As the reference gives them.
    std::vector<Tensor> state;    ///< After the call.
  };

  References(const fake::Script& script, const Workload& workload)
      : script_(script), workload_(workload) {}

  [[nodiscard]] std::shared_ptr<const Result> find(const Data& data,
                                                   std::span<const Tensor> state) {
    Hash64 hash;
    for (const auto tensors : {std::span<const Tensor>(data.inputs), state}) {
      for (const Tensor& tensor : tensors) hash.add(tensor.used_bytes());
    }
    const auto known = std::ranges::find(kept_, hash.value(), &Kept::first);
    if (known != kept_.end()) return known->second;
    auto result = std::make_shared<Result>();
    result->state = copy_tensors(state);
    result->outputs = compute(data, result->state);
    if (kept_.size() == kMostKept) kept_.erase(kept_.begin());
    kept_.emplace_back(hash.value(), result);
    return result;
  }

 private:
  using Kept = std::pair<std::uint64_t, std::shared_ptr<const Result>>;
  static constexpr std::size_t kMostKept = 16;

  [[nodiscard]] std::vector<Tensor> compute(const Data& data, std::span<Tensor> state) const {
    if (workload_.state) return workload_.step(state, data);
    if (!script_.reference_folder.empty() && !workload_.is_played()) {
      const auto path =
          std::filesystem::path(script_.reference_folder) / (workload_.name + ".reference");
      if (std::filesystem::exists(path)) return read_tensors(path, reference_specs(workload_));
    }
    return workload_.reference(data);
  }

  const fake::Script& script_;
  const Workload& workload_;
  std::vector<Kept> kept_;  ///< The latest last.
};

class FakeKernel : public Kernel {
 public:
  FakeKernel(const fake::Script& script, const Workload& workload,
             std::span<const Tensor> parameters, double factor, ScriptedClock& clock)
      : script_(script),
        workload_(workload),
        factor_(factor),
        clock_(clock),
        random_(derive_seed(script.seed, workload.name)),
        references_(script_, workload_) {
    data_.parameters = copy_tensors(parameters);
  }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
    take_inputs();
  }

  void upload() override {
    const Nanos start = clock_.now();
    take_inputs();
    hold(Phase::kUpload, start);
  }

  std::optional<Nanos> execute(int repeats) override {
    const std::string& name = workload_.name;
    if (script_.crash.contains(name)) std::abort();
    while (script_.hang.contains(name)) ::pause();
    if (script_.fail_execute.contains(name)) {
      throw_environment(fmt::format("{}: execution fails as its script says", name));
    }
    Nanos launch{0};
    for (int i = 0; i < repeats; ++i) {
      launch += hold(Phase::kLaunch, clock_.now());
      const Nanos start = clock_.now();
      // Of what a unit computes in real time, the reference is part of the time.
      if (clock_.is_wall()) compute();
      if (script_.machine.count() > 0) std::this_thread::sleep_for(script_.machine);
      hold_execute(start);
      ++calls_;
    }
    return launch.count() == 0 ? std::nullopt : std::optional(launch);
  }

  void download() override {
    const Nanos start = clock_.now();
    compute();
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      copy_converted(result_->outputs[i], outputs_[i]);
      if (is_wrong()) spoil_first_element(outputs_[i]);
      if (script_.nan_output.contains(workload_.name)) {
        std::memset(outputs_[i].data(), 0xFF, outputs_[i].bytes().size());  // a NaN in f32 and f64
      }
    }
    for (std::size_t i = 0; i < next_.size(); ++i) copy_tensor(result_->state[i], next_[i]);
    hold(Phase::kDownload, start);
  }

  [[nodiscard]] std::optional<Nanos> bound(Phase phase) const override {
    std::optional<Nanos> sum;
    for (const auto& stage : script_.stages_of(workload_.name)) {
      if (stage.phase != phase || !stage.bound) continue;
      sum = sum.value_or(Nanos(0)) + scaled(*stage.bound, factor_);
    }
    return sum;
  }

  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override {
    if (!workload_.state) Kernel::bind_state(current, next);
    current_ = current;
    next_ = next;
  }

  void upload_state() override {
    state_ = copy_tensors(current_);
    result_.reset();
  }

  void commit_state() override {
    compute();
    state_ = copy_tensors(result_->state);
    result_.reset();
  }

 private:
  /// The device's copies of the inputs, as they are now.
  void take_inputs() {
    const auto& have = data_.inputs;
    if (have.size() == inputs_.size() &&
        std::ranges::equal(have, inputs_, [](const Tensor& a, const Tensor& b) {
          return a.rows() == b.rows() && same_content(a, b);
        })) {
      return;
    }
    data_.inputs = copy_tensors(inputs_);
    result_.reset();
  }

  void compute() {
    if (!result_) result_ = references_.find(data_, state_);
  }

  /// @param start  When the phase began. @return How long it took.
  Nanos hold(Phase phase, Nanos start) {
    Nanos time{0};
    for (const auto& stage : script_.stages_of(workload_.name)) {
      if (stage.phase == phase) time += scaled(draw(stage, random_), factor_);
    }
    if (time.count() == 0) return time;
    if (is_measured(phase)) {
      std::this_thread::sleep_for(time);
      return time;
    }
    clock_.hold(time, start);
    return clock_.now() - start;
  }

  /// By the machine's clock, beside a clock of its own.
  [[nodiscard]] bool is_measured(Phase phase) const {
    const auto account = script_.accounts.find(phase);
    return account != script_.accounts.end() && account->second.unknown.empty() &&
           account->second.provenance == Provenance::kMeasured;
  }

  void hold_execute(Nanos start) {
    const auto samples = script_.samples.find(workload_.name);
    if (samples == script_.samples.end()) {
      hold(Phase::kExecute, start);
    } else {
      const auto at = static_cast<std::size_t>(calls_) % samples->second.size();
      const Nanos time = scaled(samples->second[at], factor_);
      if (is_measured(Phase::kExecute)) {
        std::this_thread::sleep_for(time);
      } else {
        clock_.hold(time, start);
      }
    }
  }

  [[nodiscard]] bool is_wrong() const {
    if (script_.wrong_output.contains(workload_.name)) return true;
    const auto after = script_.wrong_output_after.find(workload_.name);
    return after != script_.wrong_output_after.end() && calls_ > after->second;
  }

  const fake::Script& script_;
  Workload workload_;  ///< A copy, since prepare() does not say that its argument lives on.
  double factor_ = 1;  ///< Of all times of calls.
  ScriptedClock& clock_;
  Random random_;
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
  std::span<const Tensor> current_;
  std::span<Tensor> next_;
  Data data_;                  ///< The device's.
  std::vector<Tensor> state_;  ///< The device's current one.
  References references_;
  /// Of data_ and state_; found when it is first asked for.
  std::shared_ptr<const References::Result> result_;
  std::int64_t calls_ = 0;
};

/// 1e6 operations or bytes at the scripted rate.
class FakePeakLoop : public PeakLoop {
 public:
  FakePeakLoop(PeakKind kind, double per_second, ScriptedClock& clock)
      : kind_(kind), per_second_(per_second), clock_(clock) {}

  [[nodiscard]] PeakKind kind() const override { return kind_; }
  [[nodiscard]] std::string variant() const override { return "scripted"; }
  [[nodiscard]] double work() const override { return 1e6; }
  void run(int repeats) override { clock_.hold(from_s(work() * repeats / per_second_)); }
  [[nodiscard]] Verdict verify() const override {
    return {.ok = true, .detail = "computes nothing"};
  }

 private:
  PeakKind kind_;
  double per_second_;
  ScriptedClock& clock_;
};

Support support_of(const fake::Script& script, const Workload& workload) {
  if (!script.unsupported.contains(workload.name)) return {true, ""};
  return {false, "excluded by the unit's script"};
}

class FakeDevice : public Device {
 public:
  FakeDevice(fake::Script script, double slowdown)
      : script_(std::move(script)), slowdown_(slowdown), clock_(script_.wall_clock) {
    take(Phase::kDeviceInit, script_.device_init);
  }

  [[nodiscard]] DeviceInfo info() const override {
    return {script_.device, "pirt fake", "1", 1, false, script_.cache_bytes};
  }

  [[nodiscard]] PeakLoops peak_loops() override {
    PeakLoops all;
    for (const PeakKind kind : kAllPeakKinds) {
      const auto rate = script_.peaks.find(kind);
      if (rate == script_.peaks.end()) {
        all.unavailable[kind] = "the unit's script gives none";
      } else {
        all.loops.push_back(std::make_unique<FakePeakLoop>(kind, rate->second, clock_));
      }
    }
    return all;
  }

  [[nodiscard]] Support supports(const Workload& workload) const override {
    return support_of(script_, workload);
  }

  [[nodiscard]] const Clock* own_clock() const override {
    return clock_.is_wall() ? nullptr : &clock_;
  }
  [[nodiscard]] Provenance provenance() const override { return Provenance::kModelled; }
  [[nodiscard]] Accounting accounting(Phase phase) const override {
    const auto account = script_.accounts.find(phase);
    return account == script_.accounts.end() ? Accounting{provenance()} : account->second;
  }
  [[nodiscard]] bool is_deterministic() const override { return script_.deterministic; }

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                    std::span<const Tensor> parameters) override {
    if (script_.fail_prepare.contains(workload.name)) {
      throw_environment(fmt::format("{}: preparation fails as its script says", workload.name));
    }
    const std::size_t earlier = count_preparation(workload.name);
    take(Phase::kPrepare, earlier > 0 ? script_.prepare_warm : script_.prepare_cold);
    const auto& factors = script_.process_factors;
    const double factor = slowdown_ * (factors.empty() ? 1 : factors[earlier % factors.size()]);
    return std::make_unique<FakeKernel>(script_, workload, parameters, factor, clock_);
  }

  /// What nobody knows the time of takes none.
  void take(Phase phase, Nanos time) {
    const auto account = script_.accounts.find(phase);
    if (account == script_.accounts.end()) return clock_.hold(time);
    if (!account->second.unknown.empty()) return;
    if (account->second.provenance == Provenance::kMeasured) {
      std::this_thread::sleep_for(time);
    } else {
      clock_.hold(time);
    }
  }

  /// How often the workload has been prepared since the kernel cache was empty; 0 if there is none.
  /// The cache has a file for each workload, one byte longer each time.
  static std::size_t count_preparation(const std::string& workload) {
    const char* folder = std::getenv(kCacheVariable);
    if (folder == nullptr || *folder == '\0') return 0;
    const auto path = std::filesystem::path(folder) / (workload + ".kernel");
    const std::size_t earlier =
        std::filesystem::exists(path) ? std::filesystem::file_size(path) : 0;
    std::ofstream(path, std::ios::app).put('.');
    return earlier;
  }

  fake::Script script_;
  double slowdown_;
  ScriptedClock clock_;
};

class FakeBackend : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "fake"; }
  [[nodiscard]] std::string_view description() const override {
    return "scripted times on a simulated clock or the wall's, for tests and what-if; computes "
           "nothing";
  }
  [[nodiscard]] std::vector<Phase> phases() const override {
    return {kAllPhases.begin(), kAllPhases.end()};
  }
  [[nodiscard]] Probe probe() const override {
    return {true, "", {{fake::Script().device, "pirt fake", "1", 1, false, std::nullopt}}};
  }
  [[nodiscard]] Support supports(const Workload&) const override { return {true, ""}; }
  [[nodiscard]] Support supports_on(const UnitRequest& request,
                                    const Workload& workload) const override {
    return support_of(fake::parse_script(request.script), workload);
  }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest& request) const override {
    auto script = fake::parse_script(request.script);
    if (script.fail_open) throw_environment(*script.fail_open);
    return std::make_unique<FakeDevice>(std::move(script), request.option(fake_options().front()));
  }
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> kernel_cache_environment(
      const std::string& folder) const override {
    return {{kCacheVariable, folder}};
  }
};

}  // namespace

std::unique_ptr<const Backend> make_fake_backend() { return std::make_unique<FakeBackend>(); }

}  // namespace pirt
