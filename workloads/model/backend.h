// A way to compute: backend -> device (one open unit) -> kernel (one workload prepared on that
// unit).
//
// A device answers for itself what it can do and why not. Nothing here reads a clock: who measures
// wraps the calls. Errors of a backend's library are translated to pirt::Error inside the backend's
// folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "workloads/base/error.h"
#include "workloads/base/time.h"
#include "workloads/model/peak.h"
#include "workloads/model/phase.h"
#include "workloads/model/workload.h"

namespace pirt {

struct Support {
  bool ok = false;
  std::string reason;  ///< Why not, with the remedy where there is one; empty if ok.
};

/// A device that a backend found on this machine.
struct DeviceInfo {
  std::string name;      ///< "pthread-haswell-AMD EPYC" or the CPU's model name.
  std::string platform;  ///< "Portable Computing Language", "OpenCV + oneDNN".
  std::string version;   ///< Driver or library versions.
  int compute_units = 0;
  bool is_cpu =
      false;  ///< The device computes on the host's own cores (PoCL): never to be taken for a GPU.
  /// The largest cache before the device's memory; absent where it does not say.
  std::optional<std::int64_t> cache_bytes = std::nullopt;
  /// The kernels' parameters that an open device uses: "default", or what was tuned,
  /// "conv_pixels=8, fc_rows=2". Empty for backends without, and before opening.
  std::string tuning = {};
  /// Where an open device is not what its unit asks for, in one line; empty = it is.
  std::string remark = {};
  std::string pci = {};     ///< "0000:01:00.0"; empty where its driver does not say it.
  bool own_memory = false;  ///< It computes in memory of its own, not in the host's: a GPU's card.
};

struct Probe {
  bool available = false;
  std::string reason;  ///< Why not and what to install; empty if available.
  std::vector<DeviceInfo> devices;
};

/// How a device's time of one phase is known.
struct Accounting {
  /// kMeasured: the machine's clock, around the phase. Any other: the device's own clock, which
  /// goes on during the phase.
  Provenance provenance = Provenance::kMeasured;
  /// Why nobody knows the phase's time, in one line; empty = it is known.
  std::string unknown = {};
};

/// A number that a platform file may give a backend.
struct OptionSpec {
  std::string name;                        ///< "clock_mhz"
  std::string unit;                        ///< "MHz"; empty = a plain number.
  std::string description;                 ///< One line.
  double low = 0, high = 0, standard = 0;  ///< Range, ends included, and default.
};

/// What a platform says about the unit that a device is opened for.
struct UnitRequest {
  std::string unit;        ///< The platform's name of the unit, for messages.
  std::vector<int> cores;  ///< Host cores that the unit owns; empty = all. Applied as the calling
                           ///< thread's affinity.
  std::string device;      ///< Which of the backend's devices, as choose_device() takes it.
  std::string script;      ///< Backend-specific: the fake backend's script (YAML text).
  std::map<std::string, double> options = {};  ///< Of options_of; others have their default.

  /// What @p option is for this unit.
  [[nodiscard]] double option(const OptionSpec& option) const {
    const auto given = options.find(option.name);
    return given == options.end() ? option.standard : given->second;
  }
};

/// One workload prepared on one unit. Used by one thread at a time.
class Kernel {
 public:
  virtual ~Kernel() = default;

  /// Sets the host tensors that upload() reads and download() writes (host backends compute on them
  /// in place). They must outlive the kernel's use and have the workload's specs. Inputs that vary
  /// are read with the rows that they have at upload (host backends: at execute).
  virtual void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) = 0;
  /// From now on nothing refers to the memory of what was bound, until the next bind; it may go
  /// before that. What was bound and outlives the kernel need not be unbound.
  virtual void unbind() {}

  /// Host to device; complete on return. Nothing to do for a backend without that phase.
  virtual void upload() {}
  /// Computes @p repeats times on the resident data, one after the other, and waits once for the
  /// last. Returns the time that launching took of it (submit to start, summed over the repeats),
  /// where the device knows it without being asked.
  /// With a state every repeat reads the current one and writes the next: all are the same call.
  virtual std::optional<Nanos> execute(int repeats) = 0;
  /// The same for a device that has to be asked, which takes time that calls do without: computes
  /// once more, with the device's stamps. Absent where it has none, or execute() gives it anyway.
  [[nodiscard]] virtual std::optional<Nanos> stamped_launch() { return std::nullopt; }
  /// The least that @p phase of the last call can have taken on such a device, where the device
  /// knows that beside its time; never above it.
  [[nodiscard]] virtual std::optional<Nanos> bound(Phase phase) const {
    static_cast<void>(phase);
    return std::nullopt;
  }
  /// What is to be known of the calls so far beside their time, a line each, for the notes of a
  /// row.
  [[nodiscard]] virtual std::vector<std::string> remarks() const { return {}; }
  /// Device to host; complete on return. Outputs that vary get their rows, here or in execute. With
  /// a state its next value comes as well.
  virtual void download() {}
  /// Fills with @p with what it keeps of the outputs beside those that are bound: what of them is
  /// another byte later was written later. Nothing to do where calls write to what is bound.
  virtual void scribble(std::byte with) { static_cast<void>(with); }

  // The rest is for workloads with a state only, of which host and device have two sets: the one
  // that is committed, and the one that a call writes. A call that fails or is cancelled leaves the
  // committed one as it was. One call: upload, execute, download, commit_state, then the driver
  // swaps the host's two sets and binds them again.

  /// Sets the host's two sets of Workload::state's tensors; moves nothing. They must outlive the
  /// kernel's use.
  /// @throws std::logic_error if the workload has none.
  virtual void bind_state(std::span<const Tensor> current, std::span<Tensor> next) {
    static_cast<void>(current), static_cast<void>(next);
    throw std::logic_error("a workload without a state has nothing to bind");
  }
  /// The current state to the device; complete on return. Needed before the first call, and where
  /// the device's copy is not the committed one.
  virtual void upload_state() {}
  /// What the last call wrote becomes the device's current state. Nothing to do for host backends,
  /// which compute on what is bound.
  virtual void commit_state() {}
};

/// One open unit.
class Device {
 public:
  virtual ~Device() = default;
  [[nodiscard]] virtual DeviceInfo info() const = 0;
  /// What Backend::supports_on says for this unit.
  [[nodiscard]] virtual Support supports(const Workload& workload) const = 0;
  /// Builds the kernels, allocates buffers and takes the parameters (weights, maps) to the device.
  /// Does not run it: who prepares completes one run afterwards, which ends the `prepare` phase.
  /// The only way to a kernel, so that nothing is computed in another way than its name says.
  /// @throws Error{kEnvironment} if the device cannot (not supported, build failure, out of
  /// memory); Error{kBadInput} for parameters that are none of the workload's: a kernel reads as
  /// much of them as its workload says.
  [[nodiscard]] std::unique_ptr<Kernel> prepare(const Workload& workload,
                                                std::span<const Tensor> parameters) {
    if (const Support support = supports(workload); !support.ok) {
      throw_environment("'" + workload.name + "' cannot run on " + info().name + ": " +
                        support.reason);
    }
    check_parameters(workload, parameters);
    return make_kernel(workload, parameters);
  }
  /// Whether it will never compute again, as a GPU whose context a kernel's fault has ended: asked
  /// after a call that failed. Who uses it lets go of its kernels and opens the unit anew.
  [[nodiscard]] virtual bool is_lost() const { return false; }
  /// Where outputs that come from it are best, if that is not the heap; it may outlive the device.
  [[nodiscard]] virtual std::shared_ptr<TensorMemory> output_memory() const { return nullptr; }
  /// Loops that try to reach the unit's limits; optional: a device without any says why.
  /// @throws Error{kEnvironment} if the device cannot (build failure, out of memory).
  [[nodiscard]] virtual PeakLoops peak_loops() {
    PeakLoops none;
    for (const PeakKind kind : kAllPeakKinds)
      none.unavailable[kind] = "the backend has no loop for it";
    return none;
  }
  /// The device's own time, for devices that simulate theirs; it starts at 0. Null = the machine's
  /// clock counts.
  [[nodiscard]] virtual const Clock* own_clock() const { return nullptr; }
  /// Where figures taken with own_clock() come from, where accounting() says nothing else.
  [[nodiscard]] virtual Provenance provenance() const { return Provenance::kMeasured; }
  /// How the time of @p phase is known; the call's follows from its phases'.
  [[nodiscard]] virtual Accounting accounting(Phase phase) const {
    static_cast<void>(phase);
    return {provenance()};
  }
  /// Whether all that own_clock() tells of a call is the same each time and in every process.
  [[nodiscard]] virtual bool is_deterministic() const { return false; }

 private:
  static void check_parameters(const Workload& workload, std::span<const Tensor> parameters) {
    const auto fits = [](const Tensor& tensor, const TensorSpec& spec) {
      return tensor.spec().element == spec.element && tensor.spec().shape == spec.shape;
    };
    if (std::ranges::equal(parameters, workload.parameters, fits)) return;
    throw_bad_input("'" + workload.name + "' was given parameters that are not its own");
  }
  /// prepare() of a workload that supports() has.
  [[nodiscard]] virtual std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                            std::span<const Tensor> parameters) = 0;
};

/// Stateless; any thread may call it.
class Backend {
 public:
  virtual ~Backend() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual std::string_view description() const = 0;
  /// The phases that its calls have, in order; kCall is always among them.
  [[nodiscard]] virtual std::vector<Phase> phases() const = 0;
  [[nodiscard]] virtual Probe probe() const = 0;
  [[nodiscard]] virtual Support supports(const Workload& workload) const = 0;
  /// The same for the unit of @p request, for backends where the request decides too; opens
  /// nothing.
  /// @throws Error{kBadInput} if the request itself is malformed.
  [[nodiscard]] virtual Support supports_on(const UnitRequest& request,
                                            const Workload& workload) const {
    static_cast<void>(request);
    return supports(workload);
  }
  /// @throws Error{kEnvironment} with the remedy if there is no such device.
  [[nodiscard]] virtual std::unique_ptr<Device> open(const UnitRequest& request) const = 0;
  /// Environment variables that move the backend's kernel caches into @p folder; empty = it keeps
  /// none between processes.
  [[nodiscard]] virtual std::vector<std::pair<std::string, std::string>> kernel_cache_environment(
      const std::string& folder) const {
    static_cast<void>(folder);
    return {};
  }
};

}  // namespace pirt
