// An OpenCL device for tests that need one but nothing of the backend's inside; also in builds
// without the backend.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "workloads/backends/opencl/opencl_backend.h"
#include "workloads/model/backend.h"

namespace pirt::test {

inline UnitRequest unit_request(std::string unit = "opencl", std::vector<int> cores = {},
                                std::string device = {}) {
  UnitRequest request;
  request.unit = std::move(unit);
  request.cores = std::move(cores);
  request.device = std::move(device);
  return request;
}

/// The first OpenCL device with all its cores, or null where there is none.
inline std::unique_ptr<Device> open_first_device() {
  const auto backend = make_opencl_backend();
  return backend->probe().available ? backend->open(unit_request()) : nullptr;
}

}  // namespace pirt::test
