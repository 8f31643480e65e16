// A prepared workload as the device sees it: resident tensors and the launches that compute them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/backends/opencl/device/session.h"
#include "workloads/backends/opencl/plan/launch_times.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/tensor.h"

namespace pirt::opencl {

/// A tensor on the device. With pad > 0 it is [planes, rows, columns], or several such images of a
/// batch ([images, planes, rows, columns], all planes one after the other), with a border of `pad`
/// zeros around each plane, so that a convolution needs no bounds in its loops.
struct DeviceTensor {
  cl::Buffer buffer;
  TensorSpec spec;
  int pad = 0;
  cl::Buffer rows = {};  ///< i32 [1]: how many it has; only where the spec varies.
  /// Where it is a part of a buffer with others: that, and where in it, in bytes.
  cl::Buffer block = {};
  std::size_t at = 0, rows_at = 0;

  /// In elements: from a row to the next, from a plane to the next, and of the first element. Spec
  /// of 3 dimensions or 4.
  [[nodiscard]] std::int32_t pitch() const;
  [[nodiscard]] std::int32_t plane() const;
  /// Of all images together.
  [[nodiscard]] std::int64_t planes() const;
  [[nodiscard]] std::int32_t offset() const { return pad * pitch() + pad; }
};

/// One launch with its arguments set.
struct Launch {
  cl::Kernel kernel = {};
  cl::NDRange global = {};
  cl::NDRange local = {};
  std::function<void()> enqueues = {};  ///< In place of the kernel: somebody else's commands.
};

/// An argument: memory that the items of a work group share. Launches with such name their group.
struct LocalMemory {
  std::size_t size_bytes = 0;
};

/// Where a buffer is an argument.
struct Use {
  std::size_t step = 0;
  cl_uint index = 0;
  cl_mem buffer = nullptr;
};

struct Plan {
  std::vector<DeviceTensor> inputs;  ///< As the workload's.
  std::vector<DeviceTensor>
      outputs;                ///< As the workload's, unless the host computes the last part; pad 0.
  std::vector<Launch> steps;  ///< In order.
  std::vector<cl::Buffer> held;  ///< All buffers of the steps: a cl_kernel retains no arguments.
  std::vector<Use> uses;         ///< Of all buffers.
  std::vector<DeviceTensor> current, next;  ///< The two sets of the workload's state; pad 0.
  std::size_t size_bytes = 0;               ///< Of all buffers.

  /// Gives the steps another buffer in place of @p resident's, which is freed.
  void replace(DeviceTensor& resident, const cl::Buffer& with);
  /// The two sets of the state change places.
  void swap_state();
};

/// The number of work items of a launch before rounding up to whole work groups; kernels guard the
/// excess in x.
struct Extent {
  std::int64_t x = 1;
  std::int64_t y = 1;
  /// Work items of a group along x; absent: as many as the session wishes and the kernel takes.
  std::optional<std::size_t> group = std::nullopt;
};

/// One of the embedded .cl files, with definitions of its own besides those of the tuning.
struct Source {
  std::string_view file;
  std::string definitions = {};  ///< Build options, each with a blank before it.

  // NOLINTNEXTLINE(google-explicit-constructor): most have none.
  Source(const char* name) : file(name) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  Source(std::string_view name) : file(name) {}
  Source(std::string_view name, std::string options)
      : file(name), definitions(std::move(options)) {}
};

/// Local memory that a group's arguments need.
struct LocalNeed {
  std::size_t per_item = 0;
  std::size_t per_group = 0;  ///< Besides.

  [[nodiscard]] LocalMemory of(std::size_t items) const { return {per_item * items + per_group}; }
};

/// What goes by a pinned stage, and may be parts of one buffer. Dense tensors of more go the
/// driver's way: above it, copying into the stage and out of it takes as long as what the driver
/// does (seen on an H200: 1.2 MB up in 108 us and 130 by the stage).
inline constexpr std::size_t kMostStaged = std::size_t{1} << 20;

/// Kernels count in 32 bits.
/// @throws Error{kEnvironment} if @p what has more numbers than that.
void check_countable(std::string_view what, std::int64_t numbers);

/// Collects a plan: builds programs, allocates buffers, sets arguments. Not kept after
/// `prepare`.
class PlanBuilder {
 public:
  /// @param ours  Of kernels of ours, which count in 32 bits.
  explicit PlanBuilder(const DeviceSession& session, bool ours = true)
      : session_(session), ours_(ours) {}

  [[nodiscard]] const DeviceSession& session() const { return session_; }

  /// Uninitialized if pad is 0, otherwise zeroed for the sake of its border. No rows yet.
  /// @throws Error{kEnvironment} if its kernels cannot count its numbers; residents(), too.
  [[nodiscard]] DeviceTensor resident(const TensorSpec& spec, int pad = 0);
  /// Several that a call moves together, without a border: where they are small and the device has
  /// memory of its own, parts of one buffer, which go by one command.
  /// @param in_parts  Whether they may be: parts of a buffer cannot be divided further.
  [[nodiscard]] std::vector<DeviceTensor> residents(std::span<const TensorSpec> specs,
                                                    bool in_parts = true);
  /// Allocates both sets of a state, which the plan will have.
  void make_state(std::span<const TensorSpec> specs);
  /// For the steps: what a call reads and what it writes.
  [[nodiscard]] const DeviceTensor& current(std::size_t tensor) const {
    return current_.at(tensor);
  }
  [[nodiscard]] const DeviceTensor& next(std::size_t tensor) const { return next_.at(tensor); }
  [[nodiscard]] cl::Buffer scratch(std::int64_t size_bytes);
  /// Zeroed before what is queued next.
  [[nodiscard]] cl::Buffer zeroed(std::size_t size_bytes);
  /// A buffer that kernels only read, filled; complete on return.
  [[nodiscard]] cl::Buffer constant(std::span<const std::byte> bytes);

  /// How many work items a group of the kernel can have along x: as many as the session wishes, or
  /// less where the kernel (its registers) or the local memory that is left take no more; then a
  /// multiple of what the device likes, where it can be. 0 = it cannot have any.
  [[nodiscard]] std::size_t group_items(const Source& source, const char* kernel, LocalNeed need);

  /// Appends the launch of a kernel. Buffers, residents, int32, float and local memory are
  /// arguments.
  /// @throws Error{kEnvironment} if the device takes no group of it.
  template <typename... Arguments>
  void step(const Source& source, const char* kernel, Extent extent,
            const Arguments&... arguments) {
    cl::Kernel built(program(source), kernel);
    cl_uint index = 0;
    (set(built, index++, arguments), ...);
    append(std::move(built), kernel, extent);
  }

  /// The same of somebody else's source.
  /// @param tensor  The resident of that name; null if there is none.
  /// @throws Error{kEnvironment} if it does not build; Error{kBadInput} if its kernel takes other
  /// arguments.
  void own_step(const OpenclSource& source,
                const std::function<const DeviceTensor*(const std::string& name)>& tensor);
  /// Appends what somebody else's function enqueues, without its buffers changing places.
  void own_step(std::function<void()> enqueues) {
    steps_.push_back({.enqueues = std::move(enqueues)});
  }

  /// The plan of all steps so far; the builder is empty afterwards.
  [[nodiscard]] Plan finish(std::vector<DeviceTensor> inputs, std::vector<DeviceTensor> outputs);

 private:
  void set(cl::Kernel& kernel, cl_uint index, const cl::Buffer& buffer) {
    kernel.setArg(index, buffer);
    uses_.push_back({.step = steps_.size(), .index = index, .buffer = buffer()});
  }
  void set(cl::Kernel& kernel, cl_uint index, const DeviceTensor& resident) {
    set(kernel, index, resident.buffer);
  }
  static void set(cl::Kernel& kernel, cl_uint index, std::int32_t value) {
    kernel.setArg(index, static_cast<cl_int>(value));
  }
  static void set(cl::Kernel& kernel, cl_uint index, LocalMemory memory) {
    kernel.setArg(index, cl::Local(memory.size_bytes));
  }
  static void set(cl::Kernel& kernel, cl_uint index, float value) {
    kernel.setArg(index, static_cast<cl_float>(value));
  }

  [[nodiscard]] cl::Program program(const Source& source) const;
  [[nodiscard]] cl::Buffer allocate(cl_mem_flags flags, std::size_t size_bytes);
  void append(cl::Kernel kernel, const char* name, Extent extent);

  const DeviceSession& session_;
  bool ours_;
  std::size_t all_bytes_ = 0;
  std::vector<Launch> steps_;
  std::vector<cl::Buffer> held_;
  std::vector<Use> uses_;
  std::vector<DeviceTensor> current_, next_;
};

/// Enqueues all steps.
void enqueue(const DeviceSession& session, const Plan& plan, Launches& launches);

}  // namespace pirt::opencl
