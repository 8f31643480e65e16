// What the tests of the OpenCL backend share.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/workloads/backends/opencl/opencl_device_support.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/opencl/opencl_backend.h"
#include "workloads/backends/opencl/opencl_device.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/model/backend.h"
#include "workloads/model/player.h"

namespace pirt::test {

inline Verdict run_and_verify(const opencl::DeviceSession& session, const Workload& workload) {
  return run_and_verify_prepared(
      workload, data_of_seed_1(workload), 1,
      [&](const auto& parameters) { return opencl::make_kernel(session, workload, parameters); });
}

/// As if the device had local memory of its own: the kernels of GPUs, computed wherever it is.
inline opencl::DeviceSession gpu_session(int local_x) {
  opencl::DeviceSession session = opencl::open_session(unit_request());
  session.is_cpu = false;
  session.tuning = opencl::Tuning(false);
  session.tuning.set(opencl::Parameter::kLocalX, local_x);
  session.local_x = static_cast<std::size_t>(local_x);
  return session;
}

}  // namespace pirt::test
