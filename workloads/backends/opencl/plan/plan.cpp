#include "workloads/backends/opencl/plan/plan.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "opencl_files.h"
#include "workloads/base/error.h"

namespace pirt::opencl {
namespace {

std::size_t to_size(std::int64_t value) { return static_cast<std::size_t>(value); }

void set_number(cl::Kernel& kernel, cl_uint index, const OpenclArgument& argument) {
  switch (argument.element) {
    case Element::kU8:
      kernel.setArg(index, static_cast<cl_uchar>(argument.value));
      return;
    case Element::kI16:
      kernel.setArg(index, static_cast<cl_short>(argument.value));
      return;
    case Element::kI32:
      kernel.setArg(index, static_cast<cl_int>(argument.value));
      return;
    case Element::kF32:
      kernel.setArg(index, static_cast<cl_float>(argument.value));
      return;
    case Element::kF64:
      kernel.setArg(index, static_cast<cl_double>(argument.value));
      return;
  }
}

/// The parameter's type where it is a number, a vector of numbers or a pointer to either, and those
/// are no @p element, signed or not; absent too where the driver does not tell it.
std::optional<std::string> other_type(const cl::Kernel& kernel, cl_uint index, Element element) {
  constexpr auto kWhole = std::to_array<std::pair<std::string_view, std::size_t>>(
      {{"char", 1}, {"uchar", 1}, {"short", 2}, {"ushort", 2}, {"int", 4}, {"uint", 4}});
  constexpr auto kFloats =
      std::to_array<std::pair<std::string_view, std::size_t>>({{"float", 4}, {"double", 8}});
  std::string type;
  try {
    type = kernel.getArgInfo<CL_KERNEL_ARG_TYPE_NAME>(index);
  } catch (const cl::Error&) {
    return std::nullopt;  // CL_KERNEL_ARG_INFO_NOT_AVAILABLE
  }
  std::string_view number = type;
  while (number.ends_with('*') || number.ends_with(' ')) number.remove_suffix(1);
  for (const std::string_view lanes : {"16", "2", "3", "4", "8"}) {
    if (!number.ends_with(lanes)) continue;
    number.remove_suffix(lanes.size());
    break;
  }
  const bool is_float = element == Element::kF32 || element == Element::kF64;
  const auto find = [number](const auto& all) {
    const auto found =
        std::ranges::find(all, number, &std::pair<std::string_view, std::size_t>::first);
    return found == all.end() ? std::size_t{0} : found->second;
  };
  const std::size_t whole = find(kWhole), floats = find(kFloats);
  const bool is_known = whole + floats > 0;
  const bool fits = (is_float ? floats : whole) == size_bytes(element);
  return is_known && !fits ? std::optional(type) : std::nullopt;
}

/// Whether the parameter is a pointer to the device's memory; absent where the driver does not
/// tell.
std::optional<bool> is_pointer(const cl::Kernel& kernel, cl_uint index) {
  try {
    const auto memory = kernel.getArgInfo<CL_KERNEL_ARG_ADDRESS_QUALIFIER>(index);
    return memory == CL_KERNEL_ARG_ADDRESS_GLOBAL || memory == CL_KERNEL_ARG_ADDRESS_CONSTANT;
  } catch (const cl::Error&) {
    return std::nullopt;  // CL_KERNEL_ARG_INFO_NOT_AVAILABLE
  }
}

/// The work items of a group of @p kernel: PlanBuilder::group_items.
std::size_t fitting(const DeviceSession& session, const cl::Kernel& kernel, LocalNeed need) {
  const cl::Device& device = session.device;
  std::size_t most = kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(device);
  if (need.per_item > 0) {
    const std::size_t all = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
    const std::size_t taken =
        kernel.getWorkGroupInfo<CL_KERNEL_LOCAL_MEM_SIZE>(device) + need.per_group;
    most = std::min(most, taken < all ? (all - taken) / need.per_item : 0);
  }
  if (most >= session.local_x) return session.local_x;
  const auto liked = kernel.getWorkGroupInfo<CL_KERNEL_PREFERRED_WORK_GROUP_SIZE_MULTIPLE>(device);
  return most >= liked ? most / liked * liked : most;
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

void check_countable(std::string_view what, std::int64_t numbers) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
  if (numbers <= kMost) return;
  throw_environment(
      fmt::format("opencl: {} has more numbers than the kernels count ({}, and {} at most); choose "
                  "a smaller size or batch",
                  what, numbers, kMost));
}

DeviceTensor PlanBuilder::resident(const TensorSpec& spec, int pad) {
  DeviceTensor made{.buffer = {}, .spec = spec, .pad = pad};
  if (ours_) check_countable(spec.name, spec.count());
  if (spec.varies) made.rows = zeroed(sizeof(cl_int));
  if (pad == 0) {
    made.buffer = scratch(spec.size_bytes());
    return made;
  }
  const std::int64_t padded =
      made.planes() * (spec.shape.end()[-2] + 2 * pad) * (spec.shape.back() + 2 * pad);
  check_countable(spec.name, padded);
  made.buffer = zeroed(to_size(padded) * size_bytes(spec.element));
  return made;
}

std::vector<DeviceTensor> PlanBuilder::residents(std::span<const TensorSpec> specs, bool in_parts) {
  std::vector<DeviceTensor> made;
  const std::size_t align = std::max<std::size_t>(
      Tensor::kAlignment, session_.device.getInfo<CL_DEVICE_MEM_BASE_ADDR_ALIGN>() / 8);
  std::size_t all = 0;
  const auto part_of = [&all, align](std::size_t size_bytes) {
    const std::size_t at = all;
    all += (size_bytes + align - 1) / align * align;
    return at;
  };
  for (const TensorSpec& spec : specs) {
    if (ours_) check_countable(spec.name, spec.count());
    DeviceTensor part{.buffer = {}, .spec = spec};
    part.at = part_of(to_size(spec.size_bytes()));
    if (spec.varies) part.rows_at = part_of(sizeof(cl_int));
    made.push_back(std::move(part));
  }
  const bool several = specs.size() > 1 || (specs.size() == 1 && specs[0].varies);
  if (session_.pinned == nullptr || !several || !in_parts || all > kMostStaged) {
    made.clear();
    for (const TensorSpec& spec : specs) made.push_back(resident(spec));
    return made;
  }
  const cl::Buffer block = zeroed(all);
  const auto part = [&](std::size_t at, std::size_t size_bytes) {
    const cl_buffer_region region{at, size_bytes};
    cl::Buffer whole = block;
    return held_.emplace_back(
        whole.createSubBuffer(CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region));
  };
  for (DeviceTensor& each : made) {
    each.block = block;
    each.buffer = part(each.at, to_size(each.spec.size_bytes()));
    if (each.spec.varies) each.rows = part(each.rows_at, sizeof(cl_int));
  }
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
  return buffer;
}

cl::Buffer PlanBuilder::constant(std::span<const std::byte> bytes) {
  cl::Buffer buffer = allocate(CL_MEM_READ_ONLY, bytes.size());
  session_.queue.enqueueWriteBuffer(buffer, CL_TRUE, 0, bytes.size(), bytes.data());
  return buffer;
}

cl::Program PlanBuilder::program(const Source& source) const {
  const auto text = find_embedded(opencl_files::files(), source.file);
  if (!text) throw std::logic_error("no embedded file " + std::string(source.file));
  return build_program(session_, source.file, *text, source.definitions);
}

cl::Buffer PlanBuilder::allocate(cl_mem_flags flags, std::size_t size_bytes) {
  // Drivers may take the memory when it is used first: what cannot be is refused here.
  all_bytes_ += size_bytes;
  if (all_bytes_ > session_.device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>()) {
    throw cl::Error(CL_MEM_OBJECT_ALLOCATION_FAILURE, "clCreateBuffer");
  }
  if (size_bytes > session_.device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>()) {
    throw cl::Error(CL_INVALID_BUFFER_SIZE, "clCreateBuffer");
  }
  return held_.emplace_back(session_.context, flags, size_bytes);
}

Plan PlanBuilder::finish(std::vector<DeviceTensor> inputs, std::vector<DeviceTensor> outputs) {
  return {.inputs = std::move(inputs),
          .outputs = std::move(outputs),
          .steps = std::exchange(steps_, {}),
          .held = std::exchange(held_, {}),
          .uses = std::exchange(uses_, {}),
          .current = std::exchange(current_, {}),
          .next = std::exchange(next_, {}),
          .size_bytes = std::exchange(all_bytes_, 0)};
}

std::size_t PlanBuilder::group_items(const Source& source, const char* kernel, LocalNeed need) {
  return fitting(session_, cl::Kernel(program(source), kernel), need);
}

void PlanBuilder::own_step(
    const OpenclSource& source,
    const std::function<const DeviceTensor*(const std::string& name)>& tensor) {
  const cl::Program program = build_own_program(session_, source.file, source.text, source.options);
  const auto fail = [&source](const std::string& why) {
    throw_bad_input(fmt::format("{}: kernel '{}' {}", source.file, source.kernel, why));
  };
  cl::Kernel kernel;
  try {
    kernel = cl::Kernel(program, source.kernel.c_str());
  } catch (const cl::Error& error) {
    if (error.err() != CL_INVALID_KERNEL_NAME) throw;
    fail("is not in it");
  }
  if (const auto count = kernel.getInfo<CL_KERNEL_NUM_ARGS>(); count != source.arguments.size()) {
    fail(fmt::format("takes {} arguments, and {} are given", count, source.arguments.size()));
  }
  for (cl_uint i = 0; i < source.arguments.size(); ++i) {
    const OpenclArgument& argument = source.arguments[i];
    const bool is_number = argument.tensor.empty();
    const DeviceTensor* const resident = is_number ? nullptr : tensor(argument.tensor);
    const std::string given =
        is_number ? fmt::format("{{{}: {}}}", to_string(argument.element), argument.value)
                  : "the tensor '" + argument.tensor + "'";
    const auto refuse = [&] {
      fail(
          fmt::format("takes no {} as argument {} (counted from 0): tensors are __global "
                      "pointers, and numbers have the size of its parameter (u8: uchar, i16: "
                      "short, i32: int, f32: float, f64: double)",
                      given, i));
    };
    // Drivers look at the size alone, and a tensor's handle is as large as a double.
    if (is_pointer(kernel, i).value_or(!is_number) == is_number) refuse();
    try {
      if (is_number) {
        set_number(kernel, i, argument);
      } else if (resident != nullptr) {
        set(kernel, i, *resident);
      } else {
        fail("has an argument of no tensor: '" + argument.tensor + "'");
      }
    } catch (const cl::Error& error) {
      if (error.err() == CL_OUT_OF_RESOURCES || error.err() == CL_OUT_OF_HOST_MEMORY) throw;
      refuse();
    }
    const Element element = resident != nullptr ? resident->spec.element : argument.element;
    if (const auto type = other_type(kernel, i, element)) {
      fail(fmt::format("takes {} as argument {} (counted from 0), and {} is of {}", *type, i, given,
                       to_string(element)));
    }
  }
  const auto range = [](const std::array<std::int64_t, 3>& extents) {
    const auto at = [&extents](std::size_t i) {
      return to_size(std::max<std::int64_t>(extents[i], 1));
    };
    return cl::NDRange(at(0), at(1), at(2));
  };
  const bool chosen = std::ranges::any_of(source.local, [](auto extent) { return extent > 0; });
  for (std::size_t i = 0; i < 3; ++i) {
    const auto local = std::max<std::int64_t>(source.local[i], 1);
    if (std::max<std::int64_t>(source.global[i], 1) % local != 0) {
      fail(fmt::format("has a global size of {} that is no multiple of the local {}",
                       source.global[i], local));
    }
  }
  steps_.push_back({.kernel = std::move(kernel),
                    .global = range(source.global),
                    .local = chosen ? range(source.local) : cl::NDRange()});
}

void PlanBuilder::append(cl::Kernel kernel, const char* name, Extent extent) {
  const std::size_t local = extent.group ? *extent.group : fitting(session_, kernel, {});
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

void enqueue(const DeviceSession& session, const Plan& plan, Launches& launches) {
  for (const Launch& step : plan.steps) {
    if (step.enqueues) {
      launches.foreign();
      step.enqueues();
      continue;
    }
    session.queue.enqueueNDRangeKernel(step.kernel, cl::NullRange, step.global, step.local, nullptr,
                                       launches.next());
  }
}

}  // namespace pirt::opencl
