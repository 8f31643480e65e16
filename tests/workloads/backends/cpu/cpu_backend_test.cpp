// The cpu backend: every workload against its reference, odd shapes, cores, and what it refuses.
#include "workloads/backends/cpu/cpu_backend.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>

#include <functional>
#include <span>
#include <string>
#include <thread>

#include "tests/support/data.h"
#include "tests/support/few_threads.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/catalog/catalog.h"
#include "workloads/dnn/dnn.h"
#include "workloads/dnn/layers.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

UnitRequest request(std::vector<int> cores = {}, std::string device = "") {
  return {"cpu", std::move(cores), std::move(device), ""};
}

std::unique_ptr<Device> open_device() { return make_cpu_backend()->open(request()); }

/// Runs @p workload on @p data and compares with the reference.
Verdict run(Device& device, const Workload& workload, const Data& data, int repeats = 1) {
  const std::span frame(&data, 1);
  Player player(device.prepare(workload, data.parameters), workload, frame);
  player.scribble();
  EXPECT_EQ(player.kernel().execute(repeats), std::nullopt) << "the host has no launch stamps";
  player.called();
  return verify_sequence(workload, player.played(reference_of(workload, frame)));
}

Verdict run(Device& device, const Workload& workload) {
  const auto images = generated_images(1);
  return run(device, workload, workload.make_data({.seed = 1, .images = images.get()}));
}

/// In a thread of its own, since a device binds the thread that opens it.
void in_thread(const std::function<void()>& body) { std::thread(body).join(); }

cpu_set_t affinity() {
  cpu_set_t set;
  CPU_ZERO(&set);
  EXPECT_EQ(sched_getaffinity(0, sizeof set, &set), 0);
  return set;
}

int first_core() {
  const cpu_set_t set = affinity();
  int core = 0;
  while (!CPU_ISSET(core, &set)) ++core;
  return core;
}

TEST(CpuBackend, SaysWhatItIs) {
  const auto backend = make_cpu_backend();
  EXPECT_EQ(backend->name(), "cpu");
  EXPECT_THAT(backend->phases(),
              ElementsAre(Phase::kDeviceInit, Phase::kPrepare, Phase::kExecute, Phase::kCall));
  const auto probe = backend->probe();
  ASSERT_TRUE(probe.available) << probe.reason;
  ASSERT_EQ(probe.devices.size(), 1U);
  EXPECT_TRUE(probe.devices[0].is_cpu);
  EXPECT_FALSE(probe.devices[0].name.empty());
  EXPECT_THAT(probe.devices[0].version, HasSubstr("OpenCV"));
  EXPECT_THAT(probe.devices[0].version, HasSubstr("oneDNN"));
  EXPECT_GE(probe.devices[0].compute_units, 1);
}

TEST(CpuBackend, SupportsTheWholeCatalogAndNamesAKernelThatItHasNot) {
  const auto backend = make_cpu_backend();
  for (const auto& workload : catalog())
    EXPECT_TRUE(backend->supports(workload).ok) << workload.name;
  Workload unknown;
  unknown.name = "ray_tracing";
  unknown.kernel = "trace_rays";
  EXPECT_FALSE(backend->supports(unknown).ok);
  EXPECT_THAT(backend->supports(unknown).reason, HasSubstr("trace_rays"));
  EXPECT_THROW(static_cast<void>(open_device()->prepare(unknown, {})), Error);
}

// A team of OpenMP for which a thread is refused ends the process.
TEST(CpuBackendThreads, SaysThatTheMachineGivesTooFew) {
  const auto cores = current_cores();
  if (cores.size() < 2) GTEST_SKIP() << "skipped: one core needs no other thread";
  for (const int threads : {0, 1}) {
    const auto open = [&] {
      static_cast<void>(make_cpu_backend()->open(request({cores[0], cores[1]})));
    };
    EXPECT_EQ(test::with_threads(threads, open), "cannot start a thread") << threads;
  }
}

class CpuWorkload : public testing::TestWithParam<std::string> {};

TEST_P(CpuWorkload, AgreesWithTheReference) {
  const auto device = open_device();
  const Workload& workload = find_workload(GetParam());
  const auto verdict = test::play_and_verify(*device, workload, test::sequence_of(workload));
  EXPECT_TRUE(verdict.ok) << verdict.detail;
  RecordProperty("verdict", verdict.detail);
}

INSTANTIATE_TEST_SUITE_P(Catalog, CpuWorkload, testing::ValuesIn(workload_names()),
                         [](const auto& test) { return test.param; });

TEST(CpuBackend, AgreesOnPicturesOfAnySize) {
  const auto device = open_device();
  for (const auto& [width, height] : test::kOddSizes) {
    for (const auto& workload :
         {vision::make_gaussian_blur(width, height), vision::make_convolution(width, height),
          vision::make_sobel(width, height), vision::make_undistort(width, height),
          vision::make_feature_detect(width, height), vision::make_optical_flow(width, height)}) {
      const auto images = generated_images(2);
      Data data = workload.make_data({.seed = 3, .images = images.get()});
      const auto textured = run(*device, workload, data);
      EXPECT_TRUE(textured.ok) << workload.description << ": " << textured.detail;
      for (std::uint64_t seed = 1; auto& input : data.inputs) {
        input = test::noise_picture(width, height, seed++);
      }
      const auto noisy = run(*device, workload, data);
      EXPECT_TRUE(noisy.ok) << workload.description << ", noise: " << noisy.detail;
    }
  }
}

TEST(CpuBackend, AgreesOnConvolutionsOfAnyShape) {
  const auto device = open_device();
  for (const dnn::ConvShape& shape : {dnn::ConvShape{1, 1, 1, 1, 1, 1, 1, 0},
                                      {3, 7, 5, 5, 3, 3, 1, 1},
                                      {5, 9, 11, 13, 3, 2, 2, 0},
                                      {7, 12, 10, 9, 5, 5, 3, 2},
                                      {16, 8, 8, 24, 1, 1, 1, 0},
                                      {17, 6, 31, 33, 3, 3, 1, 1},
                                      {2, 30, 1, 3, 7, 1, 4, 0}}) {
    const auto verdict = run(*device, dnn::make_conv2d_relu("conv", shape));
    EXPECT_TRUE(verdict.ok) << shape.in_c << " to " << shape.out_c << ": " << verdict.detail;
  }
}

TEST(CpuBackend, AgreesOnPoolsAndFullyConnectedLayersOfAnyShape) {
  const auto device = open_device();
  for (const auto& workload :
       {dnn::make_max_pool("pool", 1, 1, 1, 1, 1), dnn::make_max_pool("pool", 5, 9, 7, 3, 2),
        dnn::make_max_pool("pool", 16, 12, 12, 2, 2), dnn::make_max_pool("pool", 3, 8, 11, 3, 3),
        dnn::make_fully_connected("fc", 1, 1, dnn::Activation::kDropout),
        dnn::make_fully_connected("fc", 13, 7, dnn::Activation::kDropout),
        dnn::make_fully_connected("fc", 100, 33, dnn::Activation::kSoftmax)}) {
    const auto verdict = run(*device, workload);
    EXPECT_TRUE(verdict.ok) << workload.description << ": " << verdict.detail;
  }
}

// Odd channels make padded blocks between the layers; the flattening before "d" has to leave the
// padding out.
TEST(CpuBackend, AgreesOnChainsOfOddLayers) {
  std::vector<Workload> layers;
  layers.push_back(dnn::make_conv2d_relu("a", {3, 23, 19, 13, 5, 5, 2, 1}));  // to 13x11x9
  layers.push_back(dnn::make_max_pool("b", 13, 11, 9, 3, 2));                 // to 13x5x4
  layers.push_back(dnn::make_conv2d_relu("c", {13, 5, 4, 7, 3, 3, 1, 1}));
  layers.push_back(dnn::make_fully_connected("d", 7 * 5 * 4, 21, dnn::Activation::kDropout));
  layers.push_back(dnn::make_fully_connected("e", 21, 10, dnn::Activation::kSoftmax));
  const auto device = open_device();
  const auto verdict = run(*device, dnn::make_sequence("chain", "", layers, 1e-4));
  EXPECT_TRUE(verdict.ok) << verdict.detail;
  layers.resize(2);
  const auto pooled = run(*device, dnn::make_sequence("chain", "", layers, 1e-5));
  EXPECT_TRUE(pooled.ok) << pooled.detail;
}

TEST(CpuBackend, RepeatsAndNewBindingsGiveTheSame) {
  const auto device = open_device();
  const auto images = generated_images(1);
  for (const std::string name : {"optical_flow", "feature_detect", "conv3", "fc8"}) {
    const auto& workload = find_workload(name);
    const auto first = workload.make_data({.seed = 1, .images = images.get()});
    Data second = workload.make_data({.seed = 1, .images = images.get()});
    second.inputs = workload.make_data({.seed = 9, .images = images.get()}).inputs;
    const auto kernel = device->prepare(workload, first.parameters);
    for (const Data* data : std::initializer_list<const Data*>{&first, &second, &first}) {
      auto outputs = make_tensors(workload.outputs);
      kernel->bind(data->inputs, outputs);
      kernel->execute(3);
      const auto verdict = workload.verify(outputs, workload.reference(*data));
      EXPECT_TRUE(verdict.ok) << name << ": " << verdict.detail;
    }
  }
}

TEST(CpuBackend, ParametersNeedNotOutlivePrepare) {
  const auto device = open_device();
  const auto images = generated_images(1);
  for (const std::string name : {"convolution", "conv5", "fc8"}) {
    const auto& workload = find_workload(name);
    Data data = workload.make_data({.seed = 1, .images = images.get()});
    const auto expected = workload.reference(data);
    const auto kernel = device->prepare(workload, data.parameters);
    for (auto& parameter : data.parameters) {
      std::fill_n(parameter.data(), parameter.spec().size_bytes(), std::byte{0x55});
    }
    auto outputs = make_tensors(workload.outputs);
    kernel->bind(data.inputs, outputs);
    kernel->execute(1);
    const auto verdict = workload.verify(outputs, expected);
    EXPECT_TRUE(verdict.ok) << name << ": " << verdict.detail;
  }
}

TEST(CpuBackend, BindsTheOpeningThreadToTheUnitsCores) {
  const int core = first_core();
  in_thread([&] {
    const auto device = make_cpu_backend()->open(request({core}));
    EXPECT_EQ(device->info().compute_units, 1);
    const cpu_set_t set = affinity();
    EXPECT_EQ(CPU_COUNT(&set), 1);
    EXPECT_TRUE(CPU_ISSET(core, &set));
    const auto verdict = run(*device, find_workload("conv1"));
    EXPECT_TRUE(verdict.ok) << verdict.detail;
  });
}

// OpenCV has one pool a process and one size for it; each device has as many threads as cores.
TEST(CpuBackend, DevicesOfOneProcessComputeAtOnce) {
  const int core = first_core();
  const auto images = generated_images(1);
  const auto compute = [&](const std::vector<int>& cores) {
    const auto device = make_cpu_backend()->open(request(cores));
    for (const std::string name : {"gaussian_blur", "convolution", "sobel", "undistort",
                                   "feature_detect", "optical_flow", "conv5"}) {
      const Workload& workload = find_workload(name);
      const Data data = workload.make_data({.seed = 1, .images = images.get()});
      const Verdict verdict = run(*device, workload, data, 5);
      EXPECT_TRUE(verdict.ok) << name << " on " << cores.size() << ": " << verdict.detail;
    }
  };
  std::thread one(compute, std::vector{core});
  std::thread all(compute, std::vector<int>{});
  one.join();
  all.join();
}

TEST(CpuBackend, DevicesOfOneThreadTakeTurns) {
  in_thread([] {
    const auto backend = make_cpu_backend();
    const auto all = backend->open(request());
    const auto one = backend->open(request({first_core()}));
    EXPECT_GE(all->info().compute_units, one->info().compute_units);
    for (int turn = 0; turn < 2; ++turn) {
      for (Device* device : {all.get(), one.get()}) {
        for (const char* name : {"gaussian_blur", "sobel", "fc8"}) {
          const Verdict verdict = run(*device, find_workload(name));
          EXPECT_TRUE(verdict.ok) << name << ": " << verdict.detail;
        }
      }
    }
  });
}

// Odd sizes, whose bands are of unlike heights and as low as one row.
TEST(CpuBackend, SplitsPicturesOfAnySize) {
  const auto device = open_device();
  for (const auto& [width, height] : test::kOddSizes) {
    for (const auto& workload :
         {vision::make_gaussian_blur(width, height), vision::make_sobel(width, height),
          vision::make_undistort(width, height), vision::make_optical_flow(width, height)}) {
      const Verdict verdict = run(*device, workload);
      EXPECT_TRUE(verdict.ok) << workload.name << " " << width << "x" << height << ": "
                              << verdict.detail;
    }
  }
}

TEST(CpuBackend, CoresThatDoNotExistAreAnErrorAndChangeNothing) {
  const int core = first_core();
  for (const std::vector<int>& cores : {std::vector{core, 1023}, {-1}, {1'000'000}}) {
    in_thread([&] {
      const cpu_set_t before = affinity();
      try {
        static_cast<void>(make_cpu_backend()->open(request(cores)));
        ADD_FAILURE() << "opened on " << cores.back();
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
        EXPECT_THAT(error.what(), HasSubstr(std::to_string(cores.back())));
      }
      const cpu_set_t after = affinity();
      EXPECT_TRUE(CPU_EQUAL(&before, &after));
    });
  }
}

TEST(CpuBackend, PicksByPartOfTheNameInAnyCase) {
  EXPECT_NO_THROW(static_cast<void>(make_cpu_backend()->open(request({}, "onednn"))));
  try {
    static_cast<void>(make_cpu_backend()->open(request({}, "Adreno")));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    EXPECT_THAT(error.what(), HasSubstr("Adreno"));
  }
}

// remap refuses pictures of 32767 columns or more: its complaint arrives as ours.
TEST(CpuBackend, ErrorsOfTheLibrariesBecomeErrors) {
  const auto device = open_device();
  const auto workload = vision::make_undistort(40'000, 1);
  Data data;
  data.inputs.push_back(test::noise_picture(40'000, 1, 1));
  const auto kernel = device->prepare(workload, {});
  auto outputs = make_tensors(workload.outputs);
  kernel->bind(data.inputs, outputs);
  try {
    kernel->execute(1);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    EXPECT_THAT(error.what(), HasSubstr("undistort"));
    EXPECT_THAT(error.what(), HasSubstr("OpenCV"));
  }
}

TEST(CpuBackend, AgreesOnTheUsersPictures) {
  PIRT_DATA_OR_SKIP(data, "tum-fr3-office-640x480");
  const auto images = images_from(data);
  const auto device = open_device();
  for (const auto& workload : catalog()) {
    if (!workload.has_tag("image") || workload.name == "alexnet") continue;
    const auto input = workload.make_data({.seed = 2, .images = images.get()});
    const auto size = std::span(workload.inputs[0].shape).last(2);
    const bool fits = size[0] == 480 && size[1] == 640;
    EXPECT_EQ(input.notes.empty(), fits) << workload.name;
    const auto verdict = run(*device, workload, input);
    EXPECT_TRUE(verdict.ok) << workload.name << ": " << verdict.detail;
  }
}

}  // namespace
}  // namespace pirt
