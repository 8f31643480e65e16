#include "workloads/backends/opencl/plan/plan.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <stdexcept>
#include <utility>

#include "opencl_files.h"
#include "workloads/base/error.h"

namespace pirt::opencl {
namespace {

std::size_t to_size(std::int64_t value) { return static_cast<std::size_t>(value); }

/// Rows and planes of a padded resident, in bytes, as the rectangle commands want them.
struct Rectangle {
  cl::array<cl::size_type, 3> device_origin, host_origin, region;
  std::size_t row_pitch, slice_pitch;
};

Rectangle rectangle(const DeviceTensor& resident) {
  const std::size_t element = size_bytes(resident.spec.element);
  const auto pad = static_cast<std::size_t>(resident.pad);
  const auto& shape = resident.spec.shape;
  return {.device_origin = {pad * element, pad, 0},
          .host_origin = {0, 0, 0},
          .region = {to_size(shape.back()) * element, to_size(shape.end()[-2]),
                     to_size(resident.planes())},
          .row_pitch = static_cast<std::size_t>(resident.pitch()) * element,
          .slice_pitch = static_cast<std::size_t>(resident.plane()) * element};
}

/// The work items of a group of @p kernel: PlanBuilder::group_items.
std::size_t fitting(const DeviceSession& session, const cl::Kernel& kernel, LocalNeed need,
                    std::size_t multiple) {
  const cl::Device& device = session.device;
  std::size_t most = kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(device);
  if (need.per_item > 0) {
    const std::size_t all = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
    const std::size_t taken =
        kernel.getWorkGroupInfo<CL_KERNEL_LOCAL_MEM_SIZE>(device) + need.per_group;
    most = std::min(most, taken < all ? (all - taken) / need.per_item : 0);
  }
  if (most >= session.local_x) return session.local_x / multiple * multiple;
  const std::size_t liked =
      multiple * kernel.getWorkGroupInfo<CL_KERNEL_PREFERRED_WORK_GROUP_SIZE_MULTIPLE>(device);
  return most >= liked ? most / liked * liked : most / multiple * multiple;
}

}  // namespace

std::int32_t DeviceTensor::pitch() const {
  return static_cast<std::int32_t>(spec.shape.back()) + 2 * pad;
}

std::int32_t DeviceTensor::plane() const {
  return (static_cast<std::int32_t>(spec.shape.end()[-2]) + 2 * pad) * pitch();
}

std::int64_t DeviceTensor::planes() const {
  return spec.count() / (spec.shape.back() * spec.shape.end()[-2]);
}

void Plan::replace(DeviceTensor& resident, const cl::Buffer& with) {
  auto* const old = resident.buffer();
  for (Use& use : uses) {
    if (use.buffer != old) continue;
    steps[use.step].kernel.setArg(use.index, with);
    use.buffer = with();
  }
  std::erase_if(held, [old](const cl::Buffer& buffer) { return buffer() == old; });
  held.push_back(with);
  resident.buffer = with;
}

void Plan::swap_state() {
  for (std::size_t i = 0; i < current.size(); ++i) {
    const auto exchange = [this](cl::Buffer& a, cl::Buffer& b) {
      for (Use& use : uses) {
        if (use.buffer != a() && use.buffer != b()) continue;
        const cl::Buffer& other = use.buffer == a() ? b : a;
        steps[use.step].kernel.setArg(use.index, other);
        use.buffer = other();
      }
      std::swap(a, b);
    };
    exchange(current[i].buffer, next[i].buffer);
    if (current[i].spec.varies) exchange(current[i].rows, next[i].rows);
  }
}

DeviceTensor PlanBuilder::resident(const TensorSpec& spec, int pad) {
  DeviceTensor made{.buffer = {}, .spec = spec, .pad = pad};
  if (spec.varies) made.rows = zeroed(sizeof(cl_int));
  if (pad == 0) {
    made.buffer = scratch(spec.size_bytes());
    return made;
  }
  const std::size_t bytes = to_size(made.planes() * made.plane()) * size_bytes(spec.element);
  made.buffer = zeroed(bytes);
  return made;
}

void PlanBuilder::make_state(std::span<const TensorSpec> specs) {
  for (const TensorSpec& spec : specs) {
    current_.push_back(resident(spec));
    next_.push_back(resident(spec));
  }
}

cl::Buffer PlanBuilder::scratch(std::int64_t size_bytes) {
  return allocate(CL_MEM_READ_WRITE, to_size(size_bytes));
}

cl::Buffer PlanBuilder::zeroed(std::size_t size_bytes) {
  cl::Buffer buffer = allocate(CL_MEM_READ_WRITE, size_bytes);
  session_.queue.enqueueFillBuffer(buffer, cl_uchar{0}, 0, size_bytes);
  session_.queue.finish();
  return buffer;
}

cl::Buffer PlanBuilder::constant(std::span<const std::byte> bytes) {
  cl::Buffer buffer = allocate(CL_MEM_READ_ONLY, bytes.size());
  session_.queue.enqueueWriteBuffer(buffer, CL_TRUE, 0, bytes.size(), bytes.data());
  return buffer;
}

const cl::Program& PlanBuilder::program(std::string_view source) {
  const auto found = programs_.find(source);
  if (found != programs_.end()) return found->second;
  const auto text = find_embedded(opencl_files::files(), source);
  if (!text) throw std::logic_error("no embedded file " + std::string(source));
  return programs_.emplace(source, build_program(session_, source, *text)).first->second;
}

cl::Buffer PlanBuilder::allocate(cl_mem_flags flags, std::size_t size_bytes) {
  return held_.emplace_back(session_.context, flags, size_bytes);
}

Plan PlanBuilder::finish(std::vector<DeviceTensor> inputs, std::vector<DeviceTensor> outputs) {
  return {.inputs = std::move(inputs),
          .outputs = std::move(outputs),
          .steps = std::exchange(steps_, {}),
          .held = std::exchange(held_, {}),
          .uses = std::exchange(uses_, {}),
          .current = std::exchange(current_, {}),
          .next = std::exchange(next_, {})};
}

std::size_t PlanBuilder::group_items(std::string_view source, const char* kernel, LocalNeed need,
                                     std::size_t multiple) {
  return fitting(session_, cl::Kernel(program(source), kernel), need, multiple);
}

void PlanBuilder::append(cl::Kernel kernel, const char* name, Extent extent) {
  const std::size_t local = extent.group ? *extent.group : fitting(session_, kernel, {}, 1);
  if (local == 0) {
    throw_environment(
        fmt::format("opencl: \"{}\" has no room for a work group of {}; choose another device",
                    session_.device.getInfo<CL_DEVICE_NAME>(), name));
  }
  const std::size_t groups = (to_size(extent.x) + local - 1) / local;
  steps_.push_back({.kernel = std::move(kernel),
                    .global = cl::NDRange(groups * local, to_size(extent.y)),
                    .local = cl::NDRange(local, 1)});
}

std::int64_t checked_count(std::int64_t count, std::int64_t most, const std::string& of) {
  if (count >= 0 && count <= most) return count;
  throw_environment(
      fmt::format("opencl: the device counts {} {}, of which there are at most {}; its driver is "
                  "broken, choose another device",
                  count, of, most));
}

void write(const DeviceSession& session, const DeviceTensor& to, const Tensor& from) {
  const cl::CommandQueue& queue = session.queue;
  if (to.spec.varies) {
    const auto rows = static_cast<cl_int>(from.rows());
    queue.enqueueWriteBuffer(to.rows, CL_TRUE, 0, sizeof(rows), &rows);
  }
  if (to.pad == 0) {
    const auto bytes = from.used_bytes();
    if (!bytes.empty()) queue.enqueueWriteBuffer(to.buffer, CL_TRUE, 0, bytes.size(), bytes.data());
    return;
  }
  const Rectangle r = rectangle(to);
  queue.enqueueWriteBufferRect(to.buffer, CL_TRUE, r.device_origin, r.host_origin, r.region,
                               r.row_pitch, r.slice_pitch, 0, 0, from.data());
}

void read(const DeviceSession& session, const DeviceTensor& from, Tensor& to) {
  assert(from.pad == 0);
  if (from.spec.varies) {
    cl_int rows = 0;
    session.queue.enqueueReadBuffer(from.rows, CL_TRUE, 0, sizeof(rows), &rows);
    to.set_rows(checked_count(rows, from.spec.shape.front(), "rows of " + from.spec.describe()));
  }
  const auto bytes = to.used_bytes().size();
  if (bytes != 0) session.queue.enqueueReadBuffer(from.buffer, CL_TRUE, 0, bytes, to.data());
}

void enqueue(const DeviceSession& session, const Plan& plan, LaunchTimes& times) {
  for (const Launch& step : plan.steps) {
    cl::Event event;
    session.queue.enqueueNDRangeKernel(step.kernel, cl::NullRange, step.global, step.local, nullptr,
                                       &event);
    times.add(std::move(event));
  }
}

}  // namespace pirt::opencl
