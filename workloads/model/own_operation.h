// The operation of workloads that are not pirt's: what somebody else's library, source or program
// computes, by backend. Backends have a kernel "own" for it, and know nothing of where it comes
// from (workloads/own/).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "workloads/base/error.h"
#include "workloads/model/backend.h"
#include "workloads/model/workload.h"

namespace pirt {

/// A kernel says that this call of it failed: nothing is wrong with what it ran on, and no other
/// unit is to try.
class CallFailed : public Error {
 public:
  explicit CallFailed(const std::string& message) : Error(ErrorCode::kEnvironment, message) {}
};

/// Workload::kernel of all of them.
inline constexpr const char* kOwnKernel = "own";

/// Of an OpenCL kernel.
struct OpenclArgument {
  std::string tensor = {};  ///< "image", of the state also "next image"; empty = a number.
  Element element = Element::kI32;
  double value = 0;
};

/// A source in OpenCL C 1.2 whose kernel is launched once a call.
struct OpenclSource {
  std::string file;  ///< For messages.
  std::string text;
  std::string kernel = {};
  std::string options = {};              ///< Of the compiler, with a blank before each.
  std::array<std::int64_t, 3> global{};  ///< 0 = 1.
  std::array<std::int64_t, 3> local{};   ///< 0 = as the driver likes.
  std::vector<OpenclArgument> arguments = {};
};

/// What functions of somebody else's are given to enqueue on: OpenCL's handles.
struct OpenclUnit {
  void* context = nullptr;
  void* device = nullptr;
  void* queue = nullptr;  ///< In order.
  std::vector<void*> inputs = {}, outputs = {}, parameters = {};
};

/// A kernel that another process computes for.
class OtherProcess {
 public:
  virtual ~OtherProcess() = default;
  /// What that process has had resident at most, without what it shares with this one; absent where
  /// there is none, or it is not known.
  [[nodiscard]] virtual std::optional<std::int64_t> peak_bytes() const = 0;
  /// The processor time of its threads so far; absent likewise.
  [[nodiscard]] virtual std::optional<Nanos> processor_time() const = 0;
};

struct OwnOperation : Operation {
  std::string source;                 ///< The file that it comes from, absolute.
  std::string digest;                 ///< Of what that held.
  std::string definition;             ///< What it is, as text (workloads/own/definition.h).
  std::vector<std::string> backends;  ///< That have a kernel.
  std::vector<double> slices;         ///< As WorkloadSpec::slices.

  // Without these it is a spec, which computes nothing.
  /// On @p threads of the host's cores.
  std::function<std::unique_ptr<Kernel>(std::span<const Tensor> parameters, int threads)> cpu;
  std::optional<OpenclSource> opencl;
  /// In place of `opencl`: what enqueues a call, as long as the unit is as it is.
  std::function<std::function<void()>(const OpenclUnit& unit)> opencl_function;

  Nanos limit{0};  ///< Of a process that measures it: one that takes longer hangs.
  /// What a call takes at most, with a start, before its kernel ends it; 0 = it does not.
  Nanos ends_by_itself{0};

  /// Whether backend @p name has a kernel, and why not.
  [[nodiscard]] Support support_by(const std::string& name) const {
    if (std::ranges::find(backends, name) != backends.end()) return {.ok = true, .reason = {}};
    std::string all;
    for (const std::string& each : backends) all += (all.empty() ? "" : ", ") + each;
    return {.ok = false, .reason = source + " has it for backend " + all + " alone"};
  }
};

/// Null for workloads of pirt's.
[[nodiscard]] inline const OwnOperation* own_operation(const Workload& workload) {
  return dynamic_cast<const OwnOperation*>(workload.operation.get());
}

}  // namespace pirt
