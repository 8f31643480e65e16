// Generated networks: as sure as they are made to be, and OpenCV's answers for pictures that are
// not their own.
#include "workloads/recognition/workloads.h"

#include <gtest/gtest.h>

#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/cpu/cpu_backend.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/recognition/generated_network.h"

namespace pirt::recognition {
namespace {

TEST(GeneratedNetwork, IsSureOfSoManyBoxes) {
  const Tensor picture = generated_images(5)->rgb(0, 640, 480).pixels;
  for (const auto seed : {1U, 2U}) {
    for (const std::size_t count : {1U, 12U}) {
      auto weights = seeded_weights(generated_detector(), seed);
      be_sure_of(count, generated_detector(), picture, 0.5, weights);
      EXPECT_EQ(reference_candidates(generated_detector(), weights, picture, 0.5).size(), count);
    }
  }
}

class Recognition : public testing::TestWithParam<std::string> {};

TEST_P(Recognition, AgreesOnOtherPictures) {
  const Workload& workload = find_workload(GetParam());
  const auto device = make_cpu_backend()->open({"cpu", {}, "", ""});
  const auto images = generated_images(1);
  Data data = workload.make_data({.seed = 1, .images = images.get(), .frame = 0});
  const auto own = workload.reference(data);
  EXPECT_GE(own[0].rows(), 1);
  for (const int index : {1, 2}) {
    data.inputs[0] = images->rgb(index, 640, 480).pixels;
    const Verdict verdict = test::run_and_verify(*device, workload, data);
    EXPECT_TRUE(verdict.ok) << index << ": " << verdict.detail;
  }
  data.inputs[0] = Tensor(workload.inputs[0]);  // Black: nothing but biases.
  const Verdict verdict = test::run_and_verify(*device, workload, data);
  EXPECT_TRUE(verdict.ok) << "black: " << verdict.detail;
}

INSTANTIATE_TEST_SUITE_P(Workloads, Recognition,
                         testing::Values("detect_objects", "describe_scene"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace pirt::recognition
