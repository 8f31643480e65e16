// What the tests of the OpenCL backend share.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "workloads/backend.h"
#include "workloads/images.h"
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

/// Has @p workload prepared, runs it @p repeats times on @p data, and compares with its reference.
/// @param prepare  Takes the parameters, gives the kernel.
template <typename Prepare>
Verdict run_and_verify_prepared(const Workload& workload, const Data& data, int repeats,
                                const Prepare& prepare) {
  const std::span frame(&data, 1);
  Player player(prepare(data.parameters), workload, frame);
  player.scribble();
  player.kernel().upload();
  player.kernel().execute(repeats);
  player.kernel().download();
  player.called();
  return verify_sequence(workload, player.played(reference_of(workload, frame)));
}

inline Data data_of_seed_1(const Workload& workload) {
  const auto images = generated_images(1);
  return workload.make_data({.seed = 1, .images = images.get()});
}

inline Verdict run_and_verify(Device& device, const Workload& workload, const Data& data,
                              int repeats = 1) {
  return run_and_verify_prepared(workload, data, repeats, [&](const auto& parameters) {
    return device.prepare(workload, parameters);
  });
}

/// The same on data of seed 1.
inline Verdict run_and_verify(Device& device, const Workload& workload, int repeats = 1) {
  return run_and_verify(device, workload, data_of_seed_1(workload), repeats);
}

inline Verdict run_and_verify(const opencl::Session& session, const Workload& workload) {
  return run_and_verify_prepared(
      workload, data_of_seed_1(workload), 1,
      [&](const auto& parameters) { return opencl::make_kernel(session, workload, parameters); });
}

}  // namespace pirt::test
