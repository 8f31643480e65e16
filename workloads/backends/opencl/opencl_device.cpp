#include "workloads/backends/opencl/opencl_device.h"

#include <fmt/core.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <optional>

#include "workloads/backends/opencl/device/kernel_cache.h"
#include "workloads/backends/opencl/device/peak_loops.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/backends/opencl/tuning/tuning_file.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/pci.h"
#include "workloads/base/text/text.h"
#include "workloads/model/device_choice.h"

namespace pirt::opencl {
namespace {

bool computes_on_host(const cl::Device& device) {
  return (device.getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_CPU) != 0;
}

/// Whether it is there, compiles, and knows OpenCL 1.2. Asked by number: drivers of 1.0 and 1.1
/// refuse questions of 1.2.
bool is_usable(const cl::Device& device) {
  const auto version = device.getInfo<CL_DEVICE_VERSION>();  // "OpenCL 1.2 vendor's own"
  const auto number = split(version, ' ');
  const bool is_old =
      number.size() < 2 || number[1].starts_with("1.0") || number[1].starts_with("1.1");
  return !is_old && device.getInfo<CL_DEVICE_AVAILABLE>() == CL_TRUE &&
         device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>() == CL_TRUE;
}

/// The compute units that a unit uses of a device of `available` ones.
struct UnitRange {
  std::size_t first = 0;
  std::size_t count = 0;
  std::size_t available = 0;

  [[nodiscard]] bool is_all() const { return count == available; }
};

/// Those of the cores' own numbers where that is possible, so that two units of a process do not
/// share worker threads; otherwise the first ones.
UnitRange units_for(const std::vector<int>& cores, std::size_t available) {
  if (cores.empty() || cores.size() >= available) {
    return {.first = 0, .count = available, .available = available};
  }
  const auto [low, high] = std::ranges::minmax(cores);
  const bool own_numbers = static_cast<std::size_t>(high - low) + 1 == cores.size() &&
                           static_cast<std::size_t>(high) < available;
  return {.first = own_numbers ? static_cast<std::size_t>(low) : 0,
          .count = cores.size(),
          .available = available};
}

/// Whether the device can be divided in that way, into as many parts.
bool divides(const cl::Device& device, cl_device_partition_property way, std::size_t parts) {
  const auto offered = device.getInfo<CL_DEVICE_PARTITION_PROPERTIES>();
  return std::ranges::find(offered, way) != offered.end() &&
         device.getInfo<CL_DEVICE_PARTITION_MAX_SUB_DEVICES>() >= parts;
}

cl::Device sub_device(cl::Device device, UnitRange units) {
  std::vector<cl_device_partition_property> counts = {CL_DEVICE_PARTITION_BY_COUNTS};
  if (units.first > 0) counts.push_back(static_cast<cl_device_partition_property>(units.first));
  counts.push_back(static_cast<cl_device_partition_property>(units.count));
  counts.insert(counts.end(), {CL_DEVICE_PARTITION_BY_COUNTS_LIST_END, 0});
  std::vector<cl::Device> parts;
  device.createSubDevices(counts.data(), &parts);
  return parts.at(units.first > 0 ? 1 : 0);
}

/// PoCL 3.1's contexts do not retain sub-devices, though its workers still read theirs for a moment
/// after a command was reported complete: released then, they crash in clReleaseEvent. The
/// sub-device of such a driver, about 1 KB, is kept for the rest of the process.
cl::Context context_on(const cl::Device& device) {
  const auto before = device.getInfo<CL_DEVICE_REFERENCE_COUNT>();
  cl::Context context(device);
  const bool is_part = device.getInfo<CL_DEVICE_PARENT_DEVICE>()() != nullptr;
  if (is_part && device.getInfo<CL_DEVICE_REFERENCE_COUNT>() <= before) clRetainDevice(device());
  return context;
}

void CL_CALLBACK take_affinity(void* set) {
  sched_setaffinity(0, sizeof(cpu_set_t), static_cast<const cpu_set_t*>(set));
}

/// Gives the worker thread of each compute unit the calling thread's affinity, by a native kernel
/// on it. Workers that start now inherit it anyway; those that an earlier OpenCL call of this
/// process (a probe, another unit) started do not.
void pin_workers(cl::Device device, UnitRange units) {
  const bool possible =
      (device.getInfo<CL_DEVICE_EXECUTION_CAPABILITIES>() & CL_EXEC_NATIVE_KERNEL) != 0 &&
      (units.available == 1 || divides(device, CL_DEVICE_PARTITION_EQUALLY, units.available));
  cpu_set_t mine;
  if (!possible || sched_getaffinity(0, sizeof(mine), &mine) != 0) return;
  std::vector<cl::Device> single = {device};
  if (units.available > 1) {
    const std::array<cl_device_partition_property, 3> one_each = {CL_DEVICE_PARTITION_EQUALLY, 1,
                                                                  0};
    device.createSubDevices(one_each.data(), &single);
  }
  for (std::size_t i = units.first; i < units.first + units.count; ++i) {
    const cl::CommandQueue queue(context_on(single.at(i)), single[i]);
    // Not null: the C++ header of 2024 asks for their number first.
    const std::vector<cl::Memory> none;
    queue.enqueueNativeKernel(take_affinity, {&mine, sizeof(mine)}, &none);
    queue.finish();
  }
}

/// The device of the session becomes that of the cores that the unit owns, where the driver divides
/// devices; for devices that compute on the host's.
void restrict_to_cores(DeviceSession& session, const UnitRequest& request) {
  const UnitRange units =
      units_for(request.cores, session.device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>());
  pin_workers(session.device, units);
  if (units.is_all()) return;
  if (divides(session.device, CL_DEVICE_PARTITION_BY_COUNTS, 2)) {
    session.device = sub_device(session.device, units);
    return;
  }
  if (request.cores.size() >= static_cast<std::size_t>(::sysconf(_SC_NPROCESSORS_ONLN))) return;
  if (!session.remark.empty()) session.remark += "; ";
  session.remark += fmt::format(
      "its driver does not divide \"{}\": it has all {} compute units of it instead of {}, and may "
      "use the cores of other units as well; leave `cores:` out of the platform file",
      session.device.getInfo<CL_DEVICE_NAME>(), units.available, units.count);
}

/// Whether the stamps of the queue's events are of a clock that goes on: each stamp of a command
/// that was submitted after another had ended is later than the other's. (Those of Mesa 22.3 are
/// 0, 1, 2 and 3 always.)
bool has_clock(const DeviceSession& session) {
  const cl::Buffer words(session.context, CL_MEM_READ_WRITE, sizeof(cl_uint));
  std::array<cl::Event, 2> events;
  for (cl::Event& event : events) {
    session.queue.enqueueFillBuffer(words, cl_uint{0}, 0, sizeof(cl_uint), nullptr, &event);
    event.wait();
  }
  const auto goes_on = [&events](cl_profiling_info stamp) {
    std::array<cl_ulong, 2> times{};
    for (std::size_t i = 0; i < events.size(); ++i) events[i].getProfilingInfo(stamp, &times[i]);
    return times[1] > times[0];
  };
  return goes_on(CL_PROFILING_COMMAND_QUEUED) && goes_on(CL_PROFILING_COMMAND_START) &&
         goes_on(CL_PROFILING_COMMAND_END);
}

/// Its place on the PCI bus, by the extension that the driver has for it; asked by number, since
/// headers of OpenCL 1.2 know neither.
std::string pci_of(const cl::Device& device) {
  constexpr cl_device_info kPciBusInfoKhr = 0x410F;
  constexpr std::array<cl_device_info, 3> kDomainBusSlotNv = {0x400A, 0x4008, 0x4009};
  const auto extensions = split(device.getInfo<CL_DEVICE_EXTENSIONS>(), ' ');
  const auto has = [&](const char* name) {
    return std::ranges::find(extensions, name) != extensions.end();
  };
  const auto ask = [&](cl_device_info what, auto& answer) {
    return clGetDeviceInfo(device(), what, sizeof(answer), &answer, nullptr) == CL_SUCCESS;
  };
  std::array<cl_uint, 4> place{};  // domain, bus, device, function
  if (has("cl_khr_pci_bus_info") && ask(kPciBusInfoKhr, place)) {
    return pci_address(place[0], place[1], place[2], place[3]);
  }
  if (!has("cl_nv_device_attribute_query")) return "";
  std::array<cl_uint, 3> nv{};
  if (!ask(kDomainBusSlotNv[1], nv[1]) || !ask(kDomainBusSlotNv[2], nv[2])) return "";
  static_cast<void>(ask(kDomainBusSlotNv[0], nv[0]));       // Older drivers have domain 0 only.
  return pci_address(nv[0], nv[1], nv[2] >> 3, nv[2] & 7);  // A slot is device and function.
}

class OpenClDevice final : public Device {
 public:
  explicit OpenClDevice(DeviceSession session)
      : session_(std::move(session)), info_(describe(session_.device)) {
    info_.tuning = session_.tuning.describe();
    info_.remark = session_.remark;
  }

  [[nodiscard]] DeviceInfo info() const override { return info_; }

  [[nodiscard]] Support supports(const Workload& workload) const override {
    return support_of(workload, session_.device);
  }

  [[nodiscard]] bool is_lost() const override { return opencl::is_lost(session_); }

  [[nodiscard]] std::shared_ptr<TensorMemory> output_memory() const override {
    return session_.pinned;
  }

  [[nodiscard]] PeakLoops peak_loops() override {
    return translated(fmt::format("preparing peak loops on \"{}\"", info_.name),
                      [&] { return make_peak_loops(session_); });
  }

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload& workload,
                                                    std::span<const Tensor> parameters) override {
    return translated(fmt::format("preparing {} on \"{}\"", workload.name, info_.name),
                      [&] { return opencl::make_kernel(session_, workload, parameters); });
  }

  DeviceSession session_;
  DeviceInfo info_;
};

}  // namespace

std::vector<cl::Device> all_devices() {
  std::vector<cl::Platform> platforms;
  cl::Platform::get(&platforms);
  std::vector<cl::Device> devices;
  std::optional<cl::Error> failure;
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> found;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &found);
      std::erase_if(found, [](const cl::Device& device) { return !is_usable(device); });
    } catch (const cl::Error& error) {
      found.clear();
      // A driver without its hardware, or a broken one beside others.
      if (error.err() != CL_DEVICE_NOT_FOUND) failure = error;
    }
    devices.insert(devices.end(), found.begin(), found.end());
  }
  if (devices.empty() && failure) throw cl::Error(*failure);
  // Not std::ranges: clang 14 does not compile its subrange with libstdc++ 12.
  std::stable_partition(devices.begin(), devices.end(),
                        [](const cl::Device& d) { return !computes_on_host(d); });
  return devices;
}

DeviceInfo describe(const cl::Device& device) {
  const auto platform = platform_of(device);
  return {.name = device.getInfo<CL_DEVICE_NAME>(),
          .platform = platform.getInfo<CL_PLATFORM_NAME>(),
          .version = fmt::format("{}, driver {}", platform.getInfo<CL_PLATFORM_VERSION>(),
                                 device.getInfo<CL_DRIVER_VERSION>()),
          .compute_units = static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>()),
          .is_cpu = computes_on_host(device),
          .cache_bytes = cache_bytes(device, computes_on_host(device)),
          .pci = pci_of(device),
          .own_memory = !computes_on_host(device) && !shares_memory(device)};
}

ChosenDevice find_device(const std::string& wanted) {
  const std::vector<cl::Device> devices = all_devices();
  if (devices.empty()) throw_environment("opencl: " + why_no_device());
  std::vector<DeviceInfo> infos;
  for (const cl::Device& device : devices) infos.push_back(describe(device));
  DeviceChoice choice = choose_device(infos, wanted);
  return {devices[choice.index], std::move(choice.remark)};
}

DeviceSession open_session(const UnitRequest& request) {
  bind_to_cores(request.cores, request.unit);
  return translated(fmt::format("opening unit {}", request.unit), [&] {
    DeviceSession session;
    ChosenDevice chosen = find_device(request.device);
    session.device = std::move(chosen.device);
    session.remark = std::move(chosen.remark);
    session.is_cpu = computes_on_host(session.device);
    session.lanes = static_cast<int>(session.device.getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>());
    session.tuning = tuning_for(describe(session.device));
    session.local_x = std::min(static_cast<std::size_t>(session.tuning[Parameter::kLocalX]),
                               most_items(session.device));
    if (session.is_cpu) restrict_to_cores(session, request);
    session.context = context_on(session.device);
    session.queue = cl::CommandQueue(session.context, session.device, CL_QUEUE_PROFILING_ENABLE);
    session.has_clock = has_clock(session);
    if (!shares_memory(session.device)) {
      // A queue of its own: who wants memory does not wait for what the unit computes.
      session.pinned =
          std::make_shared<PinnedPool>(cl::CommandQueue(session.context, session.device));
    }
    return session;
  });
}

std::unique_ptr<Device> open_device(const UnitRequest& request) {
  DeviceSession session = open_session(request);
  return translated(fmt::format("opening unit {}", request.unit),
                    [&] { return std::make_unique<OpenClDevice>(std::move(session)); });
}

}  // namespace pirt::opencl
