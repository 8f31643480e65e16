// Values of inputs are judged before anything computes with them, whoever submits them.
#include <cmath>
#include <limits>

#include "tests/scheduler/runtime/runtime_support.h"
#include "workloads/catalog/catalog.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

/// Whose specs say no ranges, as a robot's own program makes them.
std::vector<Tensor> plain_inputs(const Workload& workload) {
  std::vector<Tensor> inputs;
  for (TensorSpec spec : workload.inputs) {
    spec.ranges.clear();
    inputs.emplace_back(spec);
    if (spec.varies) inputs.back().set_rows(0);
  }
  return inputs;
}

TEST(RuntimeValues, AreInTheRangesOfTheirWorkload) {
  RuntimeOptions options = options_with({}, kOneUnit);
  options.workloads = {"avoid_obstacles", "pool5"};
  Runtime runtime(std::move(options));
  for (const double speed : {1e300, -101.0, std::nan("")}) {
    auto inputs = plain_inputs(find_workload("avoid_obstacles"));
    inputs[1].as<double>()[2] = 0.05;
    inputs[2].as<double>()[3] = speed;
    const auto task = runtime.submit("avoid_obstacles", {inputs.begin(), inputs.end()});
    EXPECT_EQ(task.wait(), TaskEnd::kFailed);
    EXPECT_THAT(task.problem(), HasSubstr("avoid_obstacles on cpu: robot f64[5]: "));
    EXPECT_THAT(task.problem(), HasSubstr("at 3 is not from -100"));
  }
  auto inputs = plain_inputs(find_workload("pool5"));
  const auto values = inputs[0].as<float>();
  values[values.size() - 1] = -std::numeric_limits<float>::infinity();
  const auto task = runtime.submit("pool5", {inputs[0]});
  EXPECT_EQ(task.wait(), TaskEnd::kFailed);
  EXPECT_THAT(task.problem(), HasSubstr("-inf at 43263 is no number"));
  // The unit is none the worse for it.
  values[values.size() - 1] = std::numeric_limits<float>::max();
  EXPECT_EQ(runtime.submit("pool5", {inputs[0]}).wait(), TaskEnd::kCompleted);
}

// What comes from another task is judged as well; a function of the robot's own takes what it likes
// where it says nothing of it.
TEST(RuntimeValues, OfFunctionsOfOnesOwnAreInTheRangesThatTheySay) {
  const auto same = [](std::span<const Tensor> in, std::span<Tensor> out) {
    out[0].as<double>()[0] = in[0].as<double>()[0];
  };
  OwnWorkload judged = own("judged", 1, same);
  judged.inputs[0].ranges = {{-5, 5}};
  Runtime runtime(options_with({own("same", 1, same), judged}, kOneUnit));
  const auto none = runtime.submit("same", {number(std::nan(""))});
  EXPECT_EQ(none.wait(), TaskEnd::kCompleted);
  const auto after = runtime.submit("judged", {none.output(0)});
  EXPECT_EQ(after.wait(), TaskEnd::kFailed);
  EXPECT_THAT(after.problem(), HasSubstr("number f64[1]: nan at 0 is not from -5"));
  EXPECT_EQ(runtime.submit("judged", {number(5)}).wait(), TaskEnd::kCompleted);
}

}  // namespace
}  // namespace pirt::test
