// An OpenCL device for tests that need one but nothing of the backend's inside; also in builds
// without the backend.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "workloads/backends/opencl/opencl_backend.h"
#include "workloads/model/backend.h"

namespace pirt::test {

/// Part of the name of the device that tests compute on: what PIRT_TEST_DEVICE says, so that they
/// serve for each driver that is there; empty = the first.
inline std::string tested_device() {
  const char* name = std::getenv("PIRT_TEST_DEVICE");
  return name == nullptr ? "" : name;
}

inline UnitRequest unit_request(std::string unit = "opencl", std::vector<int> cores = {},
                                std::string device = tested_device()) {
  UnitRequest request;
  request.unit = std::move(unit);
  request.cores = std::move(cores);
  request.device = std::move(device);
  return request;
}

/// The tested device, or the first one, with all its cores; null where there is none.
inline std::unique_ptr<Device> open_first_device() {
  const auto backend = make_opencl_backend();
  const Probe probe = backend->probe();
  const std::string wanted = tested_device();
  const bool is_there = std::ranges::any_of(probe.devices, [&](const DeviceInfo& info) {
    return info.name.find(wanted) != std::string::npos;
  });
  return is_there ? backend->open(unit_request()) : nullptr;
}

}  // namespace pirt::test
