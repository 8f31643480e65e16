// Each OpenCL kernel against the definition of its workload: at the catalog's sizes, at odd ones,
// at the smallest.
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <ostream>
#include <string_view>

#include "tests/workloads/backends/opencl/opencl_support.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

using test::run_and_verify;

// ------------------------------------------------------------------------------ all of the catalog

class OpenClCatalog : public testing::TestWithParam<std::string> {};

TEST_P(OpenClCatalog, ComputesWhatTheReferenceComputes) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  const Workload& workload = find_workload(GetParam());
  // Sequential, in f64 or over pointers: what the filter, the planners and the solver do; or
  // OpenCV's dnn.
  constexpr std::array<std::string_view, 4> kHostOnly = {"slam", "planning", "mapping",
                                                         "recognition"};
  if (const Support support = device->supports(workload); !support.ok) {
    EXPECT_TRUE(std::ranges::any_of(kHostOnly, [&](auto tag) { return workload.has_tag(tag); }));
    GTEST_SKIP() << "skipped: " << support.reason;
  }
  const Verdict verdict = test::play_and_verify(*device, workload, test::sequence_of(workload));
  EXPECT_TRUE(verdict.ok) << verdict.detail;
}

std::string parameter_name(const testing::TestParamInfo<std::string>& info) { return info.param; }

INSTANTIATE_TEST_SUITE_P(Workloads, OpenClCatalog, testing::ValuesIn(workload_names()),
                         parameter_name);

TEST(OpenClBackend, SupportsTheWholeCatalog) {
  const auto backend = make_opencl_backend();
  for (const Workload& workload : catalog()) {
    const Support support = backend->supports(workload);
    EXPECT_TRUE(support.ok || !workload.has_tag("table1"))
        << workload.name << ": " << support.reason;
    EXPECT_EQ(support.ok, support.reason.empty()) << workload.name;
  }
}

// ----------------------------------------------------------------------------- images of odd sizes

class OpenClImages : public testing::TestWithParam<std::size_t> {};

// A work item has 8 or 16 columns and up to 32 rows: sizes below, at, and just beside multiples of
// that and of the columns that a filter reaches beyond them, and images smaller than the window,
// whose border is reflected more than once.
constexpr std::array<std::pair<int, int>, 20> kSizes = {
    {{1, 1},   {1, 9},   {9, 1},   {2, 2},   {7, 5},    {16, 3},   {17, 4},
     {18, 70}, {19, 33}, {20, 32}, {23, 8},  {31, 34},  {32, 36},  {33, 2},
     {34, 65}, {35, 7},  {36, 31}, {64, 48}, {129, 31}, {641, 479}}};

TEST_P(OpenClImages, ComputesWhatTheReferenceComputesAtAnySize) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  for (const auto& [width, height] : kSizes) {
    const Workload workload = vision::entries()[GetParam()].make(width, height);
    if (!make_opencl_backend()->supports(workload).ok) GTEST_SKIP() << "skipped: not on opencl";
    const Verdict verdict = run_and_verify(*device, workload);
    EXPECT_TRUE(verdict.ok) << width << "x" << height << ": " << verdict.detail;
    const Verdict noisy = run_and_verify(*device, workload, test::noise_data(workload));
    EXPECT_TRUE(noisy.ok) << width << "x" << height << ", noise: " << noisy.detail;
  }
}

INSTANTIATE_TEST_SUITE_P(Workloads, OpenClImages,
                         testing::Range(std::size_t{0}, vision::entries().size()),
                         [](const auto& test) {
                           return vision::entries()[test.param].make(8, 8).name;
                         });

// ---------------------------------------------------------------------------------- mapping

TEST(OpenClMapping, GivesTheSameInTheHostsOwnTensors) {
  const auto backend = make_opencl_backend();
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  int computed = 0;
  for (const Workload* workload : workloads_in_variant("map")) {
    const Support support = backend->supports_on(test::unit_request(), *workload);
    if (!support.ok) {
      EXPECT_NE(support.reason, "") << workload->name;
      continue;
    }
    const Verdict verdict = run_and_verify(*device, *workload, 3);
    EXPECT_TRUE(verdict.ok) << workload->name << ": " << verdict.detail;
    ++computed;
  }
  if (device->info().is_cpu) {
    EXPECT_GE(computed, 9) << "vision without corners, conv1, fc6 to fc8, and what came since";
  }
}

// What the host writes between a download and the next upload is what the device computes on, and
// other tensors can be bound at any time.
TEST(OpenClMapping, TensorsChangeHandsWithEachCall) {
  const auto device = test::open_first_device();
  if (!device || !device->info().is_cpu) GTEST_SKIP() << "skipped: no OpenCL device of the host";
  const Workload& workload = find_workload("gaussian_blur@map");
  const auto images = generated_images(1);
  Data data = workload.make_data({.seed = 1, .images = images.get()});
  std::vector<Tensor> outputs = make_tensors(workload.outputs);
  const auto kernel = device->prepare(workload, data.parameters);
  kernel->bind(data.inputs, outputs);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Tensor noise = test::noise_picture(640, 480, seed);
    std::ranges::copy(noise.bytes(), data.inputs[0].data());
    kernel->upload();
    kernel->execute(2);
    kernel->download();
    EXPECT_TRUE(workload.verify(outputs, workload.reference(data)).ok) << seed;
  }
  Data other = workload.make_data({.seed = 7, .images = images.get()});
  std::vector<Tensor> there = make_tensors(workload.outputs);
  kernel->bind(other.inputs, there);
  kernel->upload();
  kernel->execute(1);
  kernel->download();
  EXPECT_TRUE(workload.verify(there, workload.reference(other)).ok);
}

TEST(OpenClMapping, SaysWhatItCannotMap) {
  const auto backend = make_opencl_backend();
  EXPECT_THAT(backend->supports(find_workload("conv2@map")).reason, testing::HasSubstr("border"));
  // What moves only the rows that it has, and a state, which is the device's.
  for (const char* name : {"feature_detect@map", "track_features@map", "background_model@map"}) {
    EXPECT_EQ(try_find_workload(name), nullptr) << name;
  }
}

// ---------------------------------------------------------------------------------- layers

TEST(OpenClConvolution, ComputesAnyShape) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  // A work item has 16 channels and 6 pixels: fewer, more, and just as many of each.
  const std::array shapes = {
      dnn::ConvShape{},
      dnn::ConvShape{.in_c = 3, .in_h = 7, .in_w = 5, .out_c = 5, .k_h = 3, .k_w = 3},
      dnn::ConvShape{.in_c = 2, .in_h = 9, .in_w = 8, .out_c = 16, .k_h = 3, .k_w = 3, .pad = 1},
      dnn::ConvShape{.in_c = 5,
                     .in_h = 13,
                     .in_w = 11,
                     .out_c = 17,
                     .k_h = 5,
                     .k_w = 3,
                     .stride = 2,
                     .pad = 2},
      dnn::ConvShape{.in_c = 1, .in_h = 2, .in_w = 3, .out_c = 33, .k_h = 2, .k_w = 1, .stride = 3},
      dnn::ConvShape{.in_c = 3,
                     .in_h = 31,
                     .in_w = 29,
                     .out_c = 7,
                     .k_h = 11,
                     .k_w = 11,
                     .stride = 4,
                     .pad = 3},
      dnn::ConvShape{.in_c = 4, .in_h = 1, .in_w = 1, .out_c = 3, .k_h = 3, .k_w = 3, .pad = 1},
  };
  for (const dnn::ConvShape& s : shapes) {
    const Verdict verdict = run_and_verify(*device, dnn::make_conv2d_relu("conv", s));
    EXPECT_TRUE(verdict.ok) << s.in_c << "x" << s.in_h << "x" << s.in_w << " -> " << s.out_c << ": "
                            << verdict.detail;
  }
}

TEST(OpenClMaxPool, ComputesAnyShape) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  for (const auto& [channels, h, w, size, stride] : {std::array{1, 1, 1, 1, 1},
                                                     {3, 7, 5, 3, 2},
                                                     {5, 8, 9, 2, 2},
                                                     {2, 11, 17, 3, 1},
                                                     {4, 3, 40, 3, 4}}) {
    const Verdict verdict =
        run_and_verify(*device, dnn::make_max_pool("pool", channels, h, w, size, stride));
    EXPECT_TRUE(verdict.ok) << channels << "x" << h << "x" << w << ": " << verdict.detail;
  }
}

TEST(OpenClFullyConnected, ComputesAnyShape) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  // A work item has 8 rows on a CPU and takes 16 inputs at a time; softmax is that of its last one.
  for (const auto& [in, out] : {std::pair{1, 1}, {7, 3}, {8, 4}, {9, 5}, {130, 67}, {1001, 9}}) {
    for (const auto activation : {dnn::Activation::kDropout, dnn::Activation::kSoftmax}) {
      const Verdict verdict =
          run_and_verify(*device, dnn::make_fully_connected("fc", in, out, activation));
      EXPECT_TRUE(verdict.ok) << in << " -> " << out << ": " << verdict.detail;
    }
  }
}

// ------------------------------------------------------------------------------------- the calls

TEST(OpenClKernel, GivesTheSameOutputAfterManyRepeats) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  // 300 repeats are more than the events that are kept alive; 2 of feature_detect see a peak and a
  // count from before.
  const Verdict blur = run_and_verify(*device, vision::make_gaussian_blur(33, 21), 300);
  EXPECT_TRUE(blur.ok) << blur.detail;
  const Verdict corners = run_and_verify(*device, vision::make_feature_detect(160, 120), 2);
  EXPECT_TRUE(corners.ok) << corners.detail;
}

TEST(OpenClKernel, FollowsNewInputsAndRebinding) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  const Workload blur = vision::make_gaussian_blur(20, 10);
  const auto images = generated_images(1);
  const Data first = blur.make_data({.seed = 1, .images = images.get()});
  const Data second = blur.make_data({.seed = 2, .images = images.get()});
  std::vector<Tensor> first_out = make_tensors(blur.outputs);
  std::vector<Tensor> second_out = make_tensors(blur.outputs);
  const auto kernel = device->prepare(blur, first.parameters);
  const auto call = [&](const Data& data, std::vector<Tensor>& out) {
    kernel->bind(data.inputs, out);
    kernel->upload();
    kernel->execute(1);
    kernel->download();
  };
  call(first, first_out);
  call(second, second_out);
  EXPECT_TRUE(blur.verify(first_out, blur.reference(first)).ok);
  EXPECT_TRUE(blur.verify(second_out, blur.reference(second)).ok);
  EXPECT_FALSE(blur.verify(second_out, blur.reference(first)).ok) << "the two inputs are the same";
}

TEST(OpenClKernel, TellsWhatLaunchingTakesWhereItIsAsked) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  const Workload blur = vision::make_gaussian_blur(64, 48);
  const auto images = generated_images(1);
  const Data data = blur.make_data({.seed = 1, .images = images.get()});
  std::vector<Tensor> outputs = make_tensors(blur.outputs);
  const auto kernel = device->prepare(blur, data.parameters);
  kernel->bind(data.inputs, outputs);
  kernel->upload();
  EXPECT_EQ(kernel->execute(3), std::nullopt) << "asking takes time";
  const auto launch = kernel->stamped_launch();
  ASSERT_TRUE(launch.has_value());
  EXPECT_GT(*launch, Nanos{0});  // No device starts a command at the instant of its submission.
}

TEST(OpenClKernel, OutlivesItsDevice) {
  const auto backend = make_opencl_backend();
  if (!backend->probe().available) GTEST_SKIP() << "skipped: no OpenCL device";
  const Workload sobel = vision::make_sobel(40, 30);
  const auto images = generated_images(1);
  const Data data = sobel.make_data({.seed = 1, .images = images.get()});
  std::vector<Tensor> outputs = make_tensors(sobel.outputs);
  auto device = backend->open(test::unit_request());
  const auto kernel = device->prepare(sobel, data.parameters);
  device.reset();
  kernel->bind(data.inputs, outputs);
  kernel->upload();
  kernel->execute(1);
  kernel->download();
  EXPECT_TRUE(sobel.verify(outputs, sobel.reference(data)).ok);
}

}  // namespace
}  // namespace pirt
