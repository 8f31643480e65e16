#include "tests/scheduler/simulation/scripted_units.h"

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/scheduler/simulation/script.h"
#include "workloads/base/error.h"
#include "workloads/catalog/specs.h"
#include "workloads/model/remote.h"

namespace pirt {
namespace simulated {
namespace {

constexpr Nanos kPatience = std::chrono::milliseconds(3);

class ScriptedDevice;

/// Has its state on its device: what the host's holds is a copy of that.
class ScriptedKernel final : public Kernel {
 public:
  ScriptedKernel(const Workload& workload, std::string unit, bool remote)
      : workload_(workload), unit_(std::move(unit)), remote_(remote) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
    withdrawn_ = false;
  }
  void unbind() override { inputs_ = {}, outputs_ = {}; }
  void upload() override { wait_for_the_way(); }
  std::optional<Nanos> execute(int) override {
    const bool may_hang = !remote_ && Script::here().chances().devices_hang;
    const bool sliced = workload_.name == "alexnet" || workload_.name == "describe_scene";
    Script::here().compute(workload_, unit_, inputs_, outputs_, may_hang, sliced ? 3 : 0);
    if (workload_.state) {
      next_here_ = here_ + 1;
      for (Tensor& each : outputs_) value_in(each) = here_;
    }
    return std::nullopt;
  }
  void download() override {
    wait_for_the_way();
    if (workload_.state) value_in(next_[0]) = next_here_;
  }
  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override {
    current_ = current;
    next_ = next;
  }
  void upload_state() override { here_ = value_in(current_[0]); }
  void commit_state() override { here_ = next_here_; }
  void withdraw() { withdrawn_ = true; }

 private:
  void wait_for_the_way() {
    Script& script = Script::here();
    if (!remote_) return;
    script.spend(script.draw_time(script.chances().longest / 4), false);
    const Nanos given_up = script.world().now() + kPatience;
    while (script.is_away()) {
      if (withdrawn_ || script.world().now() > given_up) throw_environment("out of reach");
      script.spend(kPatience / 8, false);
    }
    if (withdrawn_) throw_environment("withdrawn");
  }

  const Workload& workload_;
  std::string unit_;
  bool remote_;
  std::span<const Tensor> inputs_, current_;
  std::span<Tensor> outputs_, next_;
  double here_ = 0, next_here_ = 0;
  bool withdrawn_ = false;
};

class ScriptedDevice : public Device {
 public:
  ScriptedDevice(std::string unit, bool remote) : unit_(std::move(unit)), remote_(remote) {}
  [[nodiscard]] DeviceInfo info() const override {
    return {.name = unit_, .platform = "script", .version = "1", .compute_units = 1};
  }
  [[nodiscard]] Support supports(const Workload&) const override { return {true, ""}; }
  [[nodiscard]] bool is_lost() const override {
    return Script::here().draw(remote_ ? 0 : Script::here().chances().loses_device);
  }

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                    std::span<const Tensor>) override {
    Script& script = Script::here();
    script.spend(script.draw_time(script.chances().longest / 4), false);
    return std::make_unique<ScriptedKernel>(workload, unit_, remote_);
  }
  std::string unit_;
  bool remote_;
};

class RemoteScriptedDevice final : public ScriptedDevice, public Remote {
 public:
  explicit RemoteScriptedDevice(std::string unit) : ScriptedDevice(std::move(unit), true) {}
  [[nodiscard]] bool is_reachable() const override { return !Script::here().is_away(); }
  void withdraw(Kernel& kernel) override { dynamic_cast<ScriptedKernel&>(kernel).withdraw(); }
  void expires_in(Kernel& kernel, Nanos time_left) override {
    if (time_left <= Nanos::zero()) withdraw(kernel);
  }
  [[nodiscard]] Nanos patience() const override { return kPatience; }
  [[nodiscard]] LinkEstimate link() const override { return {}; }
  [[nodiscard]] std::uint64_t heard() const override { return Script::here().heard(); }
  /// Others have come where the way was lost.
  [[nodiscard]] Support supports(const Workload& workload) const override {
    const bool ok = heard() > 1 || workload.name.size() % 2 == 0;
    return {ok, ok ? "" : "nobody there has it"};
  }
};

class ScriptedBackend final : public Backend {
 public:
  explicit ScriptedBackend(std::string name) : name_(std::move(name)) {}
  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] std::string_view description() const override { return "scripted"; }
  [[nodiscard]] std::vector<Phase> phases() const override {
    return {kAllPhases.begin(), kAllPhases.end()};
  }
  [[nodiscard]] Probe probe() const override { return {true, "", {}}; }
  [[nodiscard]] Support supports(const Workload&) const override { return {true, ""}; }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest& request) const override {
    Script& script = Script::here();
    script.spend(script.draw_time(script.chances().longest), false);
    if (script.draw(script.chances().fails_to_open)) throw_environment("there is no such device");
    if (request.unit == "cloud") return std::make_unique<RemoteScriptedDevice>(request.unit);
    return std::make_unique<ScriptedDevice>(request.unit, false);
  }

 private:
  std::string name_;
};

}  // namespace

Workload make_scripted(const std::string& name, int inputs, const std::string& state) {
  Workload workload;
  workload.name = name;
  workload.inputs.assign(static_cast<std::size_t>(inputs), kValue);
  workload.outputs = {kValue};
  workload.make_data = [name, inputs](const DataRequest& request) {
    Data data;
    for (int i = 0; i < inputs; ++i) {
      Tensor& made = data.inputs.emplace_back(kValue);
      value_in(made) = 10.0 * request.frame + i;
    }
    return data;
  };
  if (state.empty()) return workload;
  workload.state = StateSpec{.name = state, .tensors = {kValue}};
  workload.make_state = [] {
    std::vector<Tensor> zero;
    zero.emplace_back(kValue);
    return zero;
  };
  return workload;
}

}  // namespace simulated

const Backend& find_scripted_backend(std::string_view name) {
  static std::map<std::string, simulated::ScriptedBackend, std::less<>> known;
  const auto at = known.find(name);
  return at != known.end() ? at->second
                           : known.emplace(std::string(name), std::string(name)).first->second;
}

const Workload& find_scripted_workload(std::string_view name) {
  static std::map<std::string, Workload, std::less<>> known;
  if (const auto at = known.find(name); at != known.end()) return at->second;
  const auto spec = try_find_spec(name);
  if (!spec) throw_bad_input("there is no workload '" + std::string(name) + "'");
  Workload made = simulated::make_scripted(std::string(name), static_cast<int>(spec->inputs.size()),
                                           spec->state ? spec->state->name : "");
  made.outputs.assign(spec->outputs.size(), simulated::kValue);
  if (!made.state) made.frames = 4;
  return known.emplace(std::string(name), std::move(made)).first->second;
}

}  // namespace pirt
