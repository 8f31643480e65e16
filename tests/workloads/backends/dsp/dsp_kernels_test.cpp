// Each kernel of the Hexagon program against the definition of its workload: at the catalog's
// sizes, at odd ones, at the smallest; and that what is counted repeats exactly.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>

#include "tests/workloads/backends/dsp/dsp_support.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

using test::run_and_verify;

std::vector<std::string> supported_names() {
  const auto backend = make_dsp_backend();
  std::vector<std::string> names;
  for (const std::string& name : workload_names()) {
    if (backend->supports(find_workload(name)).ok) names.push_back(name);
  }
  for (const Workload* workload : workloads_in_variant("int8")) {
    if (backend->supports(*workload).ok) names.push_back(workload->name);
  }
  return names;
}

std::string parameter_name(const testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  std::ranges::replace(name, '@', '_');
  return name;
}

class DspCatalog : public testing::TestWithParam<std::string> {};

TEST_P(DspCatalog, ComputesWhatTheReferenceComputes) {
  if (const auto why = test::why_no_dsp(); !why.empty()) GTEST_SKIP() << why;
  const auto device = test::open_dsp();
  const Verdict verdict = run_and_verify(*device, find_workload(GetParam()));
  EXPECT_TRUE(verdict.ok) << verdict.detail;
}

TEST_P(DspCatalog, CountsTheSameInEveryProcess) {
  if (const auto why = test::why_no_dsp(); !why.empty()) GTEST_SKIP() << why;
  const Workload& workload = find_workload(GetParam());
  const Data data = test::data_of_seed_1(workload);
  std::vector<Nanos> times;
  for (int process = 0; process < 2; ++process) {
    const auto device = test::open_dsp();
    auto outputs = make_tensors(workload.outputs);
    const auto kernel = device->prepare(workload, data.parameters);
    kernel->bind(data.inputs, outputs);
    kernel->upload();
    for (int call = 0; call < 2; ++call) {
      const Nanos before = device->own_clock()->now();
      kernel->execute(1);
      times.push_back(device->own_clock()->now() - before);
    }
  }
  EXPECT_GT(times[0].count(), 0);
  EXPECT_THAT(times, testing::Each(times[0]));
}

INSTANTIATE_TEST_SUITE_P(Workloads, DspCatalog, testing::ValuesIn(supported_names()),
                         parameter_name);

TEST(DspBackend, SaysHowTheTimeOfEachPhaseIsKnown) {
  if (const auto why = test::why_no_dsp(); !why.empty()) GTEST_SKIP() << why;
  const auto device = test::open_dsp();
  EXPECT_TRUE(device->is_deterministic());
  EXPECT_EQ(device->accounting(Phase::kDeviceInit).provenance, Provenance::kCounted);
  EXPECT_EQ(device->accounting(Phase::kExecute).provenance, Provenance::kModelled);
  for (const Phase phase : {Phase::kPrepare, Phase::kUpload, Phase::kLaunch, Phase::kDownload}) {
    EXPECT_EQ(device->accounting(phase).provenance, Provenance::kPublished);
    EXPECT_EQ(device->accounting(phase).unknown, "");
  }
}

// Packets a microsecond are the bound; lines that the L2 does not hold come on top of it.
TEST(DspBackend, TakesItsModelFromTheOptions) {
  if (const auto why = test::why_no_dsp(); !why.empty()) GTEST_SKIP() << why;
  const Workload& workload = find_workload("gaussian_blur");
  const Data data = test::data_of_seed_1(workload);
  struct Times {
    Nanos execute{0}, bound{0};
  };
  const auto times_of = [&](double clock_mhz, double miss_gb_s) {
    UnitRequest request;
    request.unit = "dsp";
    request.options = {{"clock_mhz", clock_mhz}, {"launch_us", 0}, {"miss_gb_s", miss_gb_s}};
    const auto device = make_dsp_backend()->open(request);
    auto outputs = make_tensors(workload.outputs);
    const auto kernel = device->prepare(workload, data.parameters);
    kernel->bind(data.inputs, outputs);
    kernel->upload();
    const Nanos before = device->own_clock()->now();
    kernel->execute(1);
    return Times{device->own_clock()->now() - before,
                 kernel->bound(Phase::kExecute).value_or(Nanos(0))};
  };
  const Times fast = times_of(500, 8), slow = times_of(1, 8), starved = times_of(500, 4);
  EXPECT_GT(fast.bound.count(), 0);
  EXPECT_EQ(slow.bound, 500 * fast.bound);
  EXPECT_EQ(starved.bound, fast.bound);
  EXPECT_GT(fast.execute, fast.bound);
  EXPECT_EQ(slow.execute - slow.bound, fast.execute - fast.bound);
  EXPECT_EQ(starved.execute - starved.bound, 2 * (fast.execute - fast.bound));
}

TEST(DspBackend, SaysWhyItDoesNotSupportTheRest) {
  const auto backend = make_dsp_backend();
  for (const Workload& workload : catalog()) {
    const Support support = backend->supports(workload);
    EXPECT_EQ(support.ok, support.reason.empty()) << workload.name;
    const bool of_the_paper = workload.has_tag("vision") && workload.has_tag("table1");
    EXPECT_TRUE(support.ok || !of_the_paper) << workload.name;
  }
}

class DspImages : public testing::TestWithParam<std::size_t> {};

// Vectors have 128 columns: sizes below, at and beside multiples of that, with a last strip of
// which as little as one column is the picture's, and the smallest that there are.
constexpr std::array<std::pair<int, int>, 12> kSizes = {{{8, 8},
                                                         {9, 70},
                                                         {31, 8},
                                                         {64, 48},
                                                         {126, 9},
                                                         {127, 10},
                                                         {128, 11},
                                                         {129, 31},
                                                         {130, 13},
                                                         {256, 12},
                                                         {257, 60},
                                                         {641, 79}}};

TEST_P(DspImages, ComputesWhatTheReferenceComputesAtAnySize) {
  if (const auto why = test::why_no_dsp(); !why.empty()) GTEST_SKIP() << why;
  const auto device = test::open_dsp();
  for (const auto& [width, height] : kSizes) {
    const Workload workload = vision::entries()[GetParam()].make(width, height);
    if (const auto support = make_dsp_backend()->supports(workload); !support.ok) {
      GTEST_SKIP() << "skipped: " << support.reason;
    }
    const Verdict verdict = run_and_verify(*device, workload);
    EXPECT_TRUE(verdict.ok) << width << "x" << height << ": " << verdict.detail;
    const Verdict noisy = run_and_verify(*device, workload, test::noise_data(workload));
    EXPECT_TRUE(noisy.ok) << width << "x" << height << ", noise: " << noisy.detail;
  }
}

INSTANTIATE_TEST_SUITE_P(Workloads, DspImages,
                         testing::Range(std::size_t{0}, vision::entries().size()),
                         [](const auto& test) {
                           return vision::entries()[test.param].make(8, 8).name;
                         });

TEST(DspBackend, RefusesPicturesThatAreTooSmallAndSaysHowSmall) {
  const auto support = make_dsp_backend()->supports(vision::make_gaussian_blur(2, 5));
  EXPECT_FALSE(support.ok);
  EXPECT_THAT(support.reason, testing::HasSubstr("at least 8x8"));
}

/// PATH for as long as it lives.
class Path {
 public:
  explicit Path(const std::string& value) { ::setenv("PATH", value.c_str(), 1); }
  ~Path() { ::setenv("PATH", before_.c_str(), 1); }
  Path(const Path&) = delete;
  Path& operator=(const Path&) = delete;

 private:
  std::string before_ = std::getenv("PATH");
};

TEST(DspBackend, RefusesMoreProductsThanASumHolds) {
  const auto support_of = [](int in) {
    return make_dsp_backend()->supports(
        dnn::in_precision(dnn::make_fully_connected("layer", in, 1, dnn::Activation::kDropout),
                          Precision::kInt8)
            .value());
  };
  EXPECT_TRUE(support_of(115'591).ok);  // 128 * 127 of them are below 2^31 - 2^28
  EXPECT_THAT(support_of(115'592).reason, testing::HasSubstr("at most 115591 products"));
}

TEST(DspBackend, SaysWhatToInstallWhereSomethingIsMissing) {
  const Path nowhere("/nowhere");
  const auto backend = make_dsp_backend();
  const Probe probe = backend->probe();
  EXPECT_FALSE(probe.available);
  EXPECT_THAT(probe.reason, testing::HasSubstr("install "));
  try {
    static_cast<void>(test::open_dsp());
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    EXPECT_THAT(error.what(), testing::HasSubstr("backend dsp is unavailable: " + probe.reason));
  }
}

}  // namespace
}  // namespace pirt
