// Bundle adjustment as a workload: what a robot's own problem becomes, and what is refused.
#include <gmock/gmock.h>

#include <array>
#include <vector>

#include "tests/support/errors.h"
#include "workloads/backends/cpu/cpu_backend.h"
#include "workloads/catalog/catalog.h"
#include "workloads/mapping/generate_bal.h"
#include "workloads/mapping/workloads.h"
#include "workloads/model/backend.h"

namespace pirt::mapping {
namespace {

using testing::HasSubstr;

class BundleAdjustOnCpu : public testing::Test {
 protected:
  std::span<const Tensor> call(const std::vector<Tensor>& inputs) {
    kernel_->bind(inputs, outputs_);
    kernel_->execute(1);
    return outputs_;
  }

  const Workload& workload_ = find_workload("bundle_adjust");
  std::unique_ptr<Device> device_ = make_cpu_backend()->open({"cpu", {}, "", ""});
  std::unique_ptr<Kernel> kernel_ = device_->prepare(workload_, {});
  std::vector<Tensor> outputs_ = make_tensors(workload_.outputs);
};

// The list's other rows hold what was there before: a smaller problem after a larger one.
TEST_F(BundleAdjustOnCpu, GivesWhatTheFunctionGives) {
  for (const int images : {12, 8}) {
    const GeneratedBal made = generate_bal({.images = images, .points = 60, .seed = 3});
    BalProblem expected = made.problem;
    BundleOptions options{.loss = Loss::kCauchy, .loss_px = 1, .fixed_intrinsics = true};
    options.fixed_cameras = {2};
    // Of each camera but the fourth, from the second call on.
    if (images == 8) {
      for (const std::int32_t camera : {0, 1, 2, 4, 5, 6, 7}) {
        options.priors.push_back({camera, {0.1 * camera, 5, 0}, 2});
      }
      options.relative = {{1, 2, {0.1, 0.2, 0}, {0.3, 0, 0}, 5, 7}, {4, 0, {}, {0, 1, 0}, 2, 3}};
    }
    static_cast<void>(bundle_adjust(expected, options));
    BalProblem got = made.problem;
    take_outputs(call(bundle_inputs(got, options.fixed_cameras, options.priors, options.relative)),
                 got);
    EXPECT_EQ(got.cameras, expected.cameras);
    EXPECT_EQ(got.points, expected.points);
    EXPECT_NE(got.points, made.problem.points);
  }
}

TEST_F(BundleAdjustOnCpu, RefusesWhatDoesNotFit) {
  GeneratedBal made = generate_bal({.images = 8, .points = 20});
  auto inputs = bundle_inputs(made.problem, {});
  inputs[0].as<std::int32_t>()[1] = 20;
  EXPECT_THAT(test::bad_input([&] { call(inputs); }), HasSubstr("point 20 does not exist"));
  inputs = bundle_inputs(made.problem, {});
  inputs[4].set_rows(7);
  EXPECT_THAT(test::bad_input([&] { call(inputs); }), HasSubstr("8 cameras with 7 of fixed"));
  EXPECT_THAT(
      test::bad_input([&] { static_cast<void>(bundle_inputs(made.problem, std::array{8})); }),
      HasSubstr("camera 8 cannot be fixed"));
  const std::array priors = {PosePrior{.camera = 8}};
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(bundle_inputs(made.problem, {}, priors)); }),
              HasSubstr("camera 8 cannot be expected"));
  inputs = bundle_inputs(made.problem, {});
  inputs[5].set_rows(7);
  EXPECT_THAT(test::bad_input([&] { call(inputs); }), HasSubstr("7 priors"));
  inputs = bundle_inputs(made.problem, {});
  inputs[6].set_rows(2);
  EXPECT_THAT(test::bad_input([&] { call(inputs); }), HasSubstr("2 pairs with 0 relative"));
  made.problem.points.resize(3 * (kRoomForPoints + 1));
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(bundle_inputs(made.problem, {})); }),
              HasSubstr("5001 points"));
}

// Points that were moved together with nothing else are not where they were seen from there.
TEST(BundleAdjustWorkload, JudgesByTheObservations) {
  const Workload& workload = find_workload("bundle_adjust");
  const Data data = workload.make_data({.seed = 1, .images = nullptr, .frame = 0});
  auto outputs = workload.reference(data);
  const auto judge = [&] {
    const PlayedFrame frame{.data = &data, .outputs = outputs, .expected = outputs};
    return workload.judge({&frame, 1});
  };
  EXPECT_TRUE(judge().ok) << judge().detail;
  for (double& coordinate : outputs[1].used<double>()) coordinate += 0.01;
  EXPECT_FALSE(judge().ok) << judge().detail;
}

}  // namespace
}  // namespace pirt::mapping
