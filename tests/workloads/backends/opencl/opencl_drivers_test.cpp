// What differs between drivers: limits of work groups, devices that cannot be divided, event stamps
// that are no clock; and each kernel at its smallest sizes, for simulated devices.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/workloads/backends/opencl/opencl_support.h"
#include "workloads/backends/opencl/plan/launch_times.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/dnn/dnn.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

using testing::IsEmpty;

// ------------------------------------------------------------------------------- smallest sizes

struct Case {
  std::string name;
  Workload workload;
};

/// One or more of each kernel, of sizes at which all of its ways are gone and no other work is
/// done: odd ones, beside multiples of the 8 and 16 columns of a work item.
std::vector<Case> smallest_cases() {
  std::vector<Case> cases;
  const auto add = [&cases](std::string name, Workload workload) {
    cases.push_back({std::move(name), std::move(workload)});
  };
  for (const auto& entry : vision::entries()) {
    const Workload narrow = entry.make(7, 5);
    if (!make_opencl_backend()->supports(narrow).ok) continue;
    // Features begin 20 pixels from the border, and its windows reach as far.
    const bool wide = narrow.kernel == "extract_features" || narrow.kernel == "track_features";
    add(narrow.kernel + "_narrow", narrow);
    add(narrow.kernel, wide ? entry.make(49, 45) : entry.make(37, 5));
  }
  add("undistort_column", vision::make_undistort(1, 3));
  const dnn::ConvShape shape{
      .in_c = 3, .in_h = 5, .in_w = 7, .out_c = 17, .k_h = 3, .k_w = 3, .stride = 2, .pad = 1};
  add("conv2d_relu", dnn::make_conv2d_relu("conv", shape));
  add("conv2d_relu_batch", dnn::batched(dnn::make_conv2d_relu("conv", shape), 2));
  add("max_pool", dnn::make_max_pool("pool", 3, 7, 5, 3, 2));
  const auto full = [](dnn::Activation activation) {
    return dnn::make_fully_connected("fc", 37, 19, activation);
  };
  add("fully_connected", full(dnn::Activation::kDropout));
  add("softmax", full(dnn::Activation::kSoftmax));
  add("softmax_batch", dnn::batched(full(dnn::Activation::kSoftmax), 2));
  return cases;
}

class OpenClSmallest : public testing::TestWithParam<Case> {};

TEST_P(OpenClSmallest, ComputesWhatTheReferenceComputes) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  for (const opencl::DeviceSession& session :
       {opencl::open_session(test::unit_request()), test::gpu_session(32)}) {
    const Verdict verdict = test::run_and_verify(session, GetParam().workload);
    EXPECT_TRUE(verdict.ok) << (session.is_cpu ? "of a CPU: " : "of a GPU: ") << verdict.detail;
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, OpenClSmallest, testing::ValuesIn(smallest_cases()),
                         [](const auto& test) { return test.param.name; });

// --------------------------------------------------------------------------------------- limits

/// Ends the process: 0 if the kernels of CPUs and those of GPUs are right on what is left of the
/// device.
[[noreturn]] void exit_if_kernels_fit() {
  try {
    if (opencl::open_session(test::unit_request()).local_x > 4) std::exit(3);
    for (const Case& each : smallest_cases()) {
      for (opencl::DeviceSession session :
           {opencl::open_session(test::unit_request()), test::gpu_session(64)}) {
        const Verdict verdict = test::run_and_verify(session, each.workload);
        if (verdict.ok) continue;
        std::fprintf(stderr, "%s: %s\n", each.name.c_str(), verdict.detail.c_str());
        std::exit(1);
      }
    }
    std::exit(0);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::exit(2);
  }
}

/// Drivers read their environment when they are loaded: that of a process to be started.
class Environment {
 public:
  Environment(std::initializer_list<std::pair<const char*, const char*>> set) : set_(set) {
    for (const auto& [name, value] : set_) setenv(name, value, 1);
  }
  ~Environment() {
    for (const auto& [name, value] : set_) unsetenv(name);
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  std::vector<std::pair<const char*, const char*>> set_;
};

TEST(OpenClLimitsDeathTest, GroupsAreAsSmallAsTheKernelsTake) {
  const auto device = test::open_first_device();
  if (!device || !device->info().name.starts_with("pthread")) GTEST_SKIP() << "skipped: no PoCL";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const Environment small({{"POCL_MAX_WORK_GROUP_SIZE", "4"}});
  EXPECT_EXIT(exit_if_kernels_fit(), testing::ExitedWithCode(0), "");
}

TEST(OpenClLimits, LocalMemoryBoundsTheGroup) {
  if (!test::open_first_device()) GTEST_SKIP() << "skipped: no OpenCL device";
  const opencl::DeviceSession session = test::gpu_session(64);
  const std::size_t all = session.device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
  opencl::PlanBuilder builder(session);
  const auto items = [&](opencl::LocalNeed need) {
    return builder.group_items("tiles.cl", "fully_connected_group", need);
  };
  EXPECT_EQ(items({}), 64U);
  // Room for 27 items, not for 28, or for 26 where the driver takes some for itself; a device that
  // likes 8 or 16 gets 24 or 16.
  EXPECT_THAT(items({.per_item = all / 27}), testing::AnyOf(16U, 24U, 26U, 27U));
  EXPECT_EQ(items({.per_item = 1, .per_group = all}), 0U) << "no room at all";
}

TEST(OpenClLimits, ABufferThatIsLargerThanTheDeviceMakesIsNoLackOfMemory) {
  if (!test::open_first_device()) GTEST_SKIP() << "skipped: no OpenCL device";
  const opencl::DeviceSession session = opencl::open_session(test::unit_request());
  const auto most = session.device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  if (most >= session.device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>()) {
    GTEST_SKIP() << "skipped: one buffer may take all memory";
  }
  opencl::PlanBuilder builder(session);
  try {
    static_cast<void>(builder.scratch(static_cast<std::int64_t>(most + 1)));
    FAIL() << "no error";
  } catch (const cl::Error& error) {
    EXPECT_EQ(error.err(), CL_INVALID_BUFFER_SIZE);
  }
}

// -------------------------------------------------------------------------------- other drivers

/// Ends the context by a kernel that writes beyond all memory.
/// @return  Whether it was well before, and is known to be lost then.
bool knows_a_lost_context() {
  const opencl::DeviceSession lost = opencl::open_session(test::unit_request());
  if (opencl::is_lost(lost)) return false;
  try {
    cl::Program wild = opencl::build_program(
        lost, "wild.cl", "__kernel void wild(__global int* p) { p[(size_t)1 << 44] = 1; }");
    cl::Kernel kernel(wild, "wild");
    const cl::Buffer buffer(lost.context, CL_MEM_READ_WRITE, 64);  // kernels hold none
    kernel.setArg(0, buffer);
    lost.queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(1));
    lost.queue.finish();
    return false;
  } catch (const cl::Error&) {
    return opencl::is_lost(lost);
  }
}

/// A driver may have one context a process, and nothing after it (NVIDIA's: error -9999): then it
/// says so.
[[noreturn]] void lose_the_context() {
  bool ok = knows_a_lost_context();
  try {
    const opencl::DeviceSession again = opencl::open_session(test::unit_request());
    ok = ok && test::run_and_verify(again, vision::make_gaussian_blur(33, 21)).ok;
    std::fprintf(stderr, "computes again\n");
  } catch (const Error& error) {
    ok = ok && error.code() == ErrorCode::kEnvironment;
    std::fprintf(stderr, "is lost: %s\n", error.what());
  }
  std::_Exit(ok ? 0 : 1);
}

TEST(OpenClLostDeathTest, AContextThatIsLostIsKnownAndSoIsWhatComesAfterIt) {
  const auto device = test::open_first_device();
  if (!device || device->info().is_cpu) GTEST_SKIP() << "skipped: no device of its own";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(lose_the_context(), testing::ExitedWithCode(0), "computes again|is lost");
}

TEST(OpenClLaunches, AreUnknownWithoutAClock) {
  if (!test::open_first_device()) GTEST_SKIP() << "skipped: no OpenCL device";
  opencl::DeviceSession session = opencl::open_session(test::unit_request());
  session.has_clock = false;
  const Workload workload = vision::make_gaussian_blur(33, 21);
  const auto data = test::data_of_seed_1(workload);
  std::vector<Tensor> outputs = make_tensors(workload.outputs);
  const auto kernel = opencl::make_kernel(session, workload, data.parameters);
  kernel->bind(data.inputs, outputs);
  kernel->upload();
  EXPECT_EQ(kernel->stamped_launch(), std::nullopt);
}

/// Also of a driver without devices.
bool has_platform(const std::string& name) {
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    return false;
  }
  return std::ranges::any_of(platforms, [&](const cl::Platform& platform) {
    return platform.getInfo<CL_PLATFORM_NAME>().find(name) != std::string::npos;
  });
}

/// Ends the process: 0 if a unit with one core opens on Mesa's driver, says that it has more, tells
/// no launch times and computes.
[[noreturn]] void exit_if_an_undivided_device_opens() {
  const bool is_one_of_many = current_cores().size() > 1;
  try {
    const auto device =
        make_opencl_backend()->open(test::unit_request("half", {current_cores().back()}));
    const std::string remark = device->info().remark;
    if (is_one_of_many && remark.find("does not divide") == std::string::npos) std::exit(1);
    const Workload sobel = vision::make_sobel(37, 5);
    if (!test::run_and_verify(*device, sobel).ok) std::exit(2);
    const Data data = test::data_of_seed_1(sobel);
    std::vector<Tensor> outputs = make_tensors(sobel.outputs);
    const auto kernel = device->prepare(sobel, data.parameters);
    kernel->bind(data.inputs, outputs);
    kernel->upload();
    const auto launch = kernel->execute(1);
    // Of that driver's later versions the stamps may be times.
    std::exit(!launch || *launch >= Nanos(100) ? 0 : 3);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::exit(4);
  }
}

TEST(OpenClDriversDeathTest, ADeviceThatCannotBeDividedIsUsedAsAWhole) {
  if (!has_platform("rusticl")) GTEST_SKIP() << "skipped: no rusticl (mesa-opencl-icd)";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const Environment mesa({{"RUSTICL_ENABLE", "llvmpipe"}, {"PIRT_TEST_DEVICE", "llvmpipe"}});
  EXPECT_EXIT(exit_if_an_undivided_device_opens(), testing::ExitedWithCode(0), "");
}

/// Ends the process: 0 if the host's cores are there by Mesa's driver and another, the first is
/// taken with a remark, and a number chooses the other.
[[noreturn]] void exit_if_two_drivers_are_told_apart() {
  try {
    const auto devices = make_opencl_backend()->probe().devices;
    if (devices.size() != 2 || !devices[0].is_cpu || !devices[1].is_cpu) std::exit(0);
    const auto open = [](const std::string& device) {
      return make_opencl_backend()->open(test::unit_request("opencl", {}, device))->info();
    };
    if (open("").remark.find("1: \"" + devices[1].name) == std::string::npos) std::exit(1);
    std::exit(open("1").name == devices[1].name && open("1").remark.empty() ? 0 : 2);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::exit(3);
  }
}

TEST(OpenClDriversDeathTest, TwoDriversOfTheHostsCoresAreToldApart) {
  if (!has_platform("rusticl")) GTEST_SKIP() << "skipped: no rusticl (mesa-opencl-icd)";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const Environment mesa({{"RUSTICL_ENABLE", "llvmpipe"}});
  EXPECT_EXIT(exit_if_two_drivers_are_told_apart(), testing::ExitedWithCode(0), "");
}

/// Ends the process: 0 if what Mesa's driver does not build is not put on PoCL's kernel cache.
[[noreturn]] void exit_if_a_failed_build_is_the_drivers_own() {
  setenv("POCL_CACHE_DIR", "/proc/nope", 1);
  try {
    const opencl::DeviceSession session = opencl::open_session(test::unit_request());
    static_cast<void>(
        opencl::build_program(session, "broken.cl", "__kernel void k() { undeclared_name; }"));
    std::exit(1);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::exit(std::string(error.what()).find("PoCL") == std::string::npos ? 0 : 2);
  }
}

TEST(OpenClDriversDeathTest, AFailedBuildIsNotPutOnTheCacheOfAnother) {
  if (!has_platform("rusticl")) GTEST_SKIP() << "skipped: no rusticl (mesa-opencl-icd)";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const Environment mesa({{"RUSTICL_ENABLE", "llvmpipe"}, {"PIRT_TEST_DEVICE", "llvmpipe"}});
  EXPECT_EXIT(exit_if_a_failed_build_is_the_drivers_own(), testing::ExitedWithCode(0), "");
}

TEST(OpenClDevice, OnAllCoresHasNoRemark) {
  if (!test::open_first_device()) GTEST_SKIP() << "skipped: no OpenCL device";
  const std::string named = test::tested_device().empty() ? "0" : test::tested_device();
  const auto device = make_opencl_backend()->open(test::unit_request("opencl", {}, named));
  EXPECT_THAT(device->info().remark, IsEmpty());
}

}  // namespace
}  // namespace pirt
