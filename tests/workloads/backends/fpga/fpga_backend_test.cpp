// Backend fpga as others see it: each workload against its definition, times that repeat exactly
// and come from its model.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/workloads/backends/fpga/fpga_support.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"

namespace pirt {
namespace {

using test::run_and_verify;
using testing::HasSubstr;

/// Of the fully connected layers the smallest: the others take minutes and are it, longer.
std::vector<std::string> supported_names() {
  const auto backend = make_fpga_backend();
  std::vector<std::string> names;
  for (const Workload& workload : catalog()) {
    if (backend->supports(workload).ok) names.push_back(workload.name);
  }
  for (const Workload* layer : workloads_in_variant("int8")) {
    const bool is_long = layer->name == "fc6@int8" || layer->name == "fc7@int8";
    if (!is_long && backend->supports(*layer).ok) names.push_back(layer->name);
  }
  return names;
}

std::string parameter_name(const testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  std::ranges::replace(name, '@', '_');
  return name;
}

struct Times {
  Nanos prepare{0}, upload{0}, execute{0}, download{0}, bound{0};
  friend bool operator==(const Times&, const Times&) = default;
};

Times times_of(Device& device, const Workload& workload) {
  const Data data = test::data_of_seed_1(workload);
  auto outputs = make_tensors(workload.outputs);
  const auto elapsed = [&, last = device.own_clock()->now()]() mutable {
    const Nanos now = device.own_clock()->now();
    return now - std::exchange(last, now);
  };
  auto lap = elapsed;
  Times times;
  const auto kernel = device.prepare(workload, data.parameters);
  kernel->bind(data.inputs, outputs);
  times.prepare = lap();
  kernel->upload();
  times.upload = lap();
  kernel->execute(1);
  times.execute = lap();
  kernel->download();
  times.download = lap();
  times.bound = kernel->bound(Phase::kExecute).value_or(Nanos(0));
  return times;
}

class FpgaCatalog : public testing::TestWithParam<std::string> {};

TEST_P(FpgaCatalog, ComputesWhatTheReferenceComputes) {
  const Verdict verdict = run_and_verify(*test::open_fpga(), find_workload(GetParam()));
  EXPECT_TRUE(verdict.ok) << verdict.detail;
}

TEST_P(FpgaCatalog, CountsTheSameOnEveryDeviceAndNeverBelowItsBound) {
  const Workload& workload = find_workload(GetParam());
  const Times once = times_of(*test::open_fpga(), workload);
  EXPECT_EQ(times_of(*test::open_fpga(), workload), once);
  EXPECT_GT(once.bound.count(), 0);
  EXPECT_GE(once.execute, once.bound);
  EXPECT_GT(once.upload.count(), 0);
  EXPECT_GT(once.download.count(), 0);
}

INSTANTIATE_TEST_SUITE_P(Workloads, FpgaCatalog, testing::ValuesIn(supported_names()),
                         parameter_name);

TEST(FpgaBackend, HasAllVisionWorkloadsOfThePaperAndSaysWhyNotTheRest) {
  const auto backend = make_fpga_backend();
  for (const Workload& workload : catalog()) {
    const Support support = backend->supports(workload);
    EXPECT_EQ(support.ok, support.reason.empty()) << workload.name;
    const bool of_the_paper = workload.has_tag("vision") && workload.has_tag("table1");
    EXPECT_TRUE(support.ok || !of_the_paper) << workload.name << ": " << support.reason;
  }
}

class FpgaImages : public testing::TestWithParam<std::size_t> {};

TEST_P(FpgaImages, ComputesWhatTheReferenceComputesAtAnySize) {
  const auto device = test::open_fpga();
  for (const auto& [width, height] : {std::pair{8, 8}, {31, 8}, {64, 48}, {129, 31}, {640, 21}}) {
    const Workload workload = vision::entries()[GetParam()].make(width, height);
    if (!device->supports(workload).ok) continue;
    for (const Data& data : {test::data_of_seed_1(workload), test::noise_data(workload)}) {
      const Verdict verdict = run_and_verify(*device, workload, data);
      EXPECT_TRUE(verdict.ok) << width << "x" << height << ": " << verdict.detail;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Workloads, FpgaImages,
                         testing::Range(std::size_t{0}, vision::entries().size()),
                         [](const auto& test) {
                           return vision::entries()[test.param].make(8, 8).name;
                         });

// Two pictures in, 8 bytes a pixel out: 10 bytes over 2 bytes a cycle of 143 MHz are 10.74 ms for
// 640x480. Opening rows, turning the bus and refreshing may cost 10 % of that.
TEST(FpgaBackend, MovesTheFlowAtNineTenthsOfTheMemorysRate) {
  const Times times = times_of(*test::open_fpga({{"launch_us", 0}}), find_workload("optical_flow"));
  const Nanos least = from_s(640.0 * 480 * 10 / 2 / 143e6);
  EXPECT_GE(times.execute, least);
  EXPECT_LE(times.execute, scaled(least, 1.1));
  EXPECT_LT(times.bound, from_ms(3.3));
}

// A core that is fed at a hundredth of the rate waits, and its bound does not.
TEST(FpgaBackend, CountsAStarvedCoreAsStarved) {
  const Workload& workload = find_workload("gaussian_blur");
  const Times fed = times_of(*test::open_fpga(), workload);
  const Times starved = times_of(*test::open_fpga({{"sdram_mhz", 1.43}}), workload);
  EXPECT_EQ(starved.bound, fed.bound);
  EXPECT_GT(starved.execute, 50 * fed.execute);
}

TEST(FpgaBackend, TakesItsModelFromTheOptions) {
  const Workload& workload = find_workload("gaussian_blur");
  const Times base = times_of(*test::open_fpga(), workload);
  const Times slow = times_of(*test::open_fpga({{"clock_mhz", 50}}), workload);
  EXPECT_EQ(slow.bound, 2 * base.bound);
  const Times launched = times_of(*test::open_fpga({{"launch_us", 1005}}), workload);
  EXPECT_EQ(launched.execute - base.execute, from_ms(1));
  // 307 200 bytes over 8 bits at 100 MHz, where the SDRAM takes less.
  const Times narrow = times_of(*test::open_fpga({{"bridge_bits", 8}}), workload);
  EXPECT_EQ(narrow.upload, from_ms(3.072));
  // 56 057 632 bits at 100 MB/s.
  const Times configured = times_of(*test::open_fpga({{"configuration_mb_s", 100}}), workload);
  EXPECT_EQ(configured.prepare, from_s(56057632 / 8e8));
}

TEST(FpgaBackend, IsConfiguredOnceForCoresOfOneBitstream) {
  const auto device = test::open_fpga();
  EXPECT_GE(times_of(*device, find_workload("gaussian_blur")).prepare, from_ms(28));
  EXPECT_EQ(times_of(*device, find_workload("sobel")).prepare, Nanos(0));
}

// Weights of 36 MB, twice: the board has 64.
TEST(FpgaBackend, HoldsInItsMemoryAllThatIsPrepared) {
  const Workload layer =
      dnn::in_precision(dnn::make_fully_connected("layer", 9000, 4200, dnn::Activation::kDropout),
                        Precision::kInt8)
          .value();
  const Data data = test::data_of_seed_1(layer);
  const auto device = test::open_fpga();
  auto first = device->prepare(layer, data.parameters);
  try {
    static_cast<void>(device->prepare(layer, data.parameters));
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("for what is prepared already"));
  }
  first.reset();
  EXPECT_NE(device->prepare(layer, data.parameters), nullptr);
}

TEST(FpgaBackend, SaysHowTheTimeOfEachPhaseIsKnown) {
  const auto device = test::open_fpga();
  EXPECT_TRUE(device->is_deterministic());
  EXPECT_NE(device->accounting(Phase::kDeviceInit).unknown, "");
  EXPECT_EQ(device->accounting(Phase::kPrepare).provenance, Provenance::kPublished);
  for (const Phase phase : {Phase::kUpload, Phase::kLaunch, Phase::kExecute, Phase::kDownload}) {
    EXPECT_EQ(device->accounting(phase).provenance, Provenance::kModelled);
    EXPECT_EQ(device->accounting(phase).unknown, "");
  }
}

TEST(FpgaBackend, RefusesPicturesBeyondItsLinesAndSaysHowLarge) {
  const auto backend = make_fpga_backend();
  EXPECT_THAT(backend->supports(vision::make_gaussian_blur(641, 480)).reason,
              HasSubstr("at most 640x2047"));
  EXPECT_THAT(backend->supports(vision::make_optical_flow(25, 48)).reason,
              HasSubstr("at least 26x1"));
}

TEST(FpgaBackend, RefusesWeightsOfMoreThan8Bits) {
  const Workload workload = vision::make_convolution(64, 48);
  Data data = test::data_of_seed_1(workload);
  data.parameters[0].as<std::int16_t>()[3] = 128;
  try {
    static_cast<void>(test::open_fpga()->prepare(workload, data.parameters));
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    EXPECT_THAT(error.what(), HasSubstr("a weight of 128"));
  }
}

}  // namespace
}  // namespace pirt
