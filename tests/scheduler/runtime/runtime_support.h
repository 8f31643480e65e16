// What the tests of the runtime library share: two units or one, tasks of numbers.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "scheduler/runtime/runtime.h"
#include "tests/scheduler/support.h"
#include "tests/support/errors.h"

namespace pirt::test {

inline constexpr const char* kTwoUnits = R"(
platform: two
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)";

inline constexpr const char* kOneUnit = R"(
platform: one
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)";

inline const TensorSpec kNumber{.name = "number", .element = Element::kF64, .shape = {1}};

inline Tensor number(double value) {
  Tensor tensor(kNumber);
  tensor.as<double>()[0] = value;
  return tensor;
}
inline double value_of(std::span<const Tensor> tensors) { return tensors[0].as<double>()[0]; }

using Function = std::function<void(std::span<const Tensor>, std::span<Tensor>)>;

/// Of numbers, on both units.
inline OwnWorkload own(const std::string& name, int inputs, Function function) {
  return {.name = name,
          .inputs = std::vector<TensorSpec>(static_cast<std::size_t>(inputs), kNumber),
          .outputs = {kNumber},
          .kernels = {{"cpu", std::move(function)}}};  // The backend of both.
}
inline OwnWorkload adding() {
  return own("add", 2, [](std::span<const Tensor> in, std::span<Tensor> out) {
    out[0].as<double>()[0] = in[0].as<double>()[0] + in[1].as<double>()[0];
  });
}

inline RuntimeOptions options_with(std::vector<ServedWorkload> served,
                                   const char* platform = kTwoUnits) {
  RuntimeOptions options;
  options.platform = parse_platform("test.yaml", platform, {}, 2);
  options.workloads = std::move(served);
  return options;
}

inline void expect_balance(const RuntimeStatistics& statistics) {
  EXPECT_EQ(statistics.submitted, statistics.completed + statistics.failed + statistics.dropped +
                                      statistics.expired + statistics.cancelled + statistics.live);
}

inline std::string refusal(RuntimeOptions options) {
  return bad_input([&] { const Runtime runtime(std::move(options)); });
}

}  // namespace pirt::test
