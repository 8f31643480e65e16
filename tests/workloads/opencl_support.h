// What the tests of the OpenCL backend share.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/workloads/workload_support.h"
#include "workloads/backend.h"
#include "workloads/opencl/kernel_table.h"
#include "workloads/opencl/opencl_backend.h"
#include "workloads/player.h"

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

inline Verdict run_and_verify(const opencl::Session& session, const Workload& workload) {
  return run_and_verify_prepared(
      workload, data_of_seed_1(workload), 1,
      [&](const auto& parameters) { return opencl::make_kernel(session, workload, parameters); });
}

}  // namespace pirt::test
