// An OpenCL device for tests that need one but nothing of the backend's inside; also in builds
// without the backend.
#pragma once

#include <cstdlib>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "workloads/backends/opencl/opencl_backend.h"
#include "workloads/model/backend.h"

namespace pirt::test {

/// The device that tests compute on, as choose_device() takes it: what PIRT_TEST_DEVICE says, so
/// that they serve for each driver that is there; empty = the first.
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

/// The tested device, or the first one, with all its cores; null where there is none at all.
/// @throws Error if the one that PIRT_TEST_DEVICE names is not among those that are there.
inline std::unique_ptr<Device> open_first_device() {
  const auto backend = make_opencl_backend();
  return backend->probe().devices.empty() ? nullptr : backend->open(unit_request());
}

}  // namespace pirt::test
