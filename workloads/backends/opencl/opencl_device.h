// Finding OpenCL devices and opening one as a unit.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "workloads/backends/opencl/device/session.h"
#include "workloads/model/backend.h"

namespace pirt::opencl {

/// All devices of all platforms: GPUs and accelerators first, then those that compute on the host's
/// cores.
/// @throws cl::Error, with CL_PLATFORM_NOT_FOUND_KHR where no driver is installed.
[[nodiscard]] std::vector<cl::Device> all_devices();

[[nodiscard]] DeviceInfo describe(const cl::Device& device);

struct ChosenDevice {
  cl::Device device;
  std::string remark;
};

/// Of all devices, as pirt::choose_device() does.
/// @throws Error{kEnvironment} naming the devices that there are, or how to get one.
[[nodiscard]] ChosenDevice find_device(const std::string& wanted);

/// Opens a unit: pins the calling thread to the unit's cores and, on a device that computes on the
/// host's cores, the driver's worker threads as well, on a sub-device with as many compute units as
/// the unit has cores. Without cores the workers get whatever the calling thread may use. What was
/// pinned stays so until a unit is opened again.
/// @throws Error{kEnvironment} with the remedy.
[[nodiscard]] std::unique_ptr<Device> open_device(const UnitRequest& request);

/// The session that open_device() makes, for tests of what is below a Device.
[[nodiscard]] DeviceSession open_session(const UnitRequest& request);

}  // namespace pirt::opencl
