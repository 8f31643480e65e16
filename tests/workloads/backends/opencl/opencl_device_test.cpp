// Finding and opening OpenCL devices, and what the backend says when it cannot.
#include "workloads/backends/opencl/opencl_device.h"

#include <gmock/gmock.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <thread>

#include "tests/workloads/backends/opencl/opencl_support.h"
#include "workloads/backends/opencl/plan/transfers.h"
#include "workloads/base/error.h"
#include "workloads/dnn/dnn.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// The message of the Error{kEnvironment} that @p body throws; fails the test if it throws none.
std::string environment_error(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

TEST(OpenClBackend, HasAllPhases) {
  const auto phases = make_opencl_backend()->phases();
  EXPECT_THAT(phases, testing::ElementsAreArray(kAllPhases));
}

TEST(OpenClBackend, MovesTheCachesOfAllDriversIntoTheFolder) {
  const auto variables = make_opencl_backend()->kernel_cache_environment("/some/folder");
  EXPECT_THAT(variables, Each(testing::Pair(Not(IsEmpty()), "/some/folder")));
  EXPECT_THAT(variables, testing::Contains(testing::Key("POCL_CACHE_DIR")));
}

TEST(OpenClBackend, RefusesAnUnknownKernelAndNamesItsOwn) {
  Workload workload = vision::make_sobel(8, 8);
  workload.kernel = "ray_march";
  const Support support = make_opencl_backend()->supports(workload);
  EXPECT_FALSE(support.ok);
  EXPECT_THAT(support.reason, AllOf(HasSubstr("ray_march"), HasSubstr("gaussian_blur")));
}

TEST(OpenClBackend, RefusesASequenceWithALayerThatItCannotChain) {
  const auto chain = std::make_shared<dnn::Sequence>();
  chain->layers.push_back(vision::make_feature_detect(32, 32));
  Workload workload = dnn::make_alexnet();
  workload.operation = chain;
  const Support support = make_opencl_backend()->supports(workload);
  EXPECT_FALSE(support.ok);
  EXPECT_THAT(support.reason, HasSubstr("feature_detect"));
}

TEST(OpenClDevice, DescribesItself) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  const DeviceInfo info = device->info();
  EXPECT_THAT(info.name, Not(IsEmpty()));
  EXPECT_THAT(info.platform, Not(IsEmpty()));
  EXPECT_THAT(info.version, HasSubstr("driver"));
  EXPECT_GE(info.compute_units, 1);
}

TEST(OpenClDevice, IsChosenByPartOfItsPlatformsNameInAnyCase) {
  const auto backend = make_opencl_backend();
  const Probe probe = backend->probe();
  if (!probe.available) GTEST_SKIP() << "skipped: " << probe.reason;
  std::string upper = probe.devices.back().platform;
  for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  const auto device = backend->open(test::unit_request("opencl", {}, upper.substr(1)));
  EXPECT_EQ(device->info().platform, probe.devices.back().platform);
}

TEST(OpenClDevice, IsChosenByItsNumberAmongThoseOfTheProbe) {
  const auto backend = make_opencl_backend();
  const Probe probe = backend->probe();
  if (!probe.available) GTEST_SKIP() << "skipped: " << probe.reason;
  const auto last = probe.devices.size() - 1;
  const auto device = backend->open(test::unit_request("opencl", {}, std::to_string(last)));
  EXPECT_EQ(device->info().name, probe.devices[last].name);
  const std::string message = environment_error(
      [&] { static_cast<void>(backend->open(test::unit_request("opencl", {}, "99"))); });
  EXPECT_THAT(message, HasSubstr("no device has number 99"));
}

TEST(OpenClDevice, OnTheHostsCoresHasNoMemoryOfItsOwn) {
  const Probe probe = make_opencl_backend()->probe();
  if (!probe.available) GTEST_SKIP() << "skipped: " << probe.reason;
  for (const DeviceInfo& info : probe.devices) {
    EXPECT_FALSE(info.is_cpu && info.own_memory) << info.name;
  }
}

TEST(OpenClDevice, ThatNobodyHasIsAnErrorThatNamesThoseThereAre) {
  const auto backend = make_opencl_backend();
  const Probe probe = backend->probe();
  if (!probe.available) GTEST_SKIP() << "skipped: " << probe.reason;
  const std::string message = environment_error(
      [&] { static_cast<void>(backend->open(test::unit_request("gpu", {}, "no such device"))); });
  EXPECT_THAT(message, AllOf(HasSubstr("no such device"), HasSubstr(probe.devices[0].name)));
}

TEST(OpenClDevice, OfTheTestsIsTheOneThatTheirVariableNamesOrTheyFail) {
  if (!make_opencl_backend()->probe().available) GTEST_SKIP() << "skipped: no OpenCL device";
  const std::string named = test::tested_device();
  ::setenv("PIRT_TEST_DEVICE", "0", 1);
  EXPECT_NE(test::open_first_device(), nullptr);
  ::setenv("PIRT_TEST_DEVICE", "no such device", 1);
  EXPECT_THAT(environment_error([] { static_cast<void>(test::open_first_device()); }),
              HasSubstr("no such device"));
  ::setenv("PIRT_TEST_DEVICE", named.c_str(), 1);
}

TEST(OpenClDevice, RefusesTensorsBeyondItsMemory) {
  if (!test::open_first_device()) GTEST_SKIP() << "skipped: no OpenCL device";
  const opencl::DeviceSession session = opencl::open_session(test::unit_request());
  opencl::PlanBuilder builder(session);
  const std::string message = environment_error([&] {
    // Beyond what any device allocates at once.
    opencl::translated("preparing huge",
                       [&] { static_cast<void>(builder.scratch(std::int64_t{1} << 47)); });
  });
  EXPECT_THAT(message, AllOf(HasSubstr("preparing huge"), HasSubstr("clCreateBuffer")));
}

TEST(OpenClDevice, RefusesTensorsOfMoreNumbersThanKernelsCount) {
  const auto device = test::open_first_device();
  if (!device) GTEST_SKIP() << "skipped: no OpenCL device";
  const auto expect_refused = [](const char* what, const std::function<void()>& body) {
    EXPECT_THAT(environment_error(body),
                AllOf(HasSubstr(what), HasSubstr("more numbers than the kernels count")));
  };
  const Workload pool = dnn::make_max_pool("huge", 1 << 9, 1 << 11, 1 << 11, 2, 2);
  expect_refused(pool.inputs[0].name.c_str(),
                 [&] { static_cast<void>(device->prepare(pool, {})); });
  const opencl::DeviceSession session = opencl::open_session(test::unit_request());
  opencl::PlanBuilder builder(session);
  // 2^31 with its border alone.
  const TensorSpec wide{.name = "wide", .element = Element::kU8, .shape = {1, 1 << 15, 65'530}};
  expect_refused("wide", [&] { static_cast<void>(builder.resident(wide, 3)); });
  const std::vector<opencl::DeviceTensor> none(2);
  expect_refused("optical_flow's sums", [&] {
    opencl::find_kernel("optical_flow")
        .append(builder, vision::make_optical_flow(24'000, 24'000), {}, none, none);
  });
}

TEST(OpenClDevice, KeepsPinnedMemoryOnlyWhileThereIsRoomForOtherSizes) {
  if (!test::open_first_device()) GTEST_SKIP() << "skipped: no OpenCL device";
  const opencl::DeviceSession session = opencl::open_session(test::unit_request());
  const auto pool = std::make_shared<opencl::PinnedPool>(session.queue);
  constexpr std::size_t kPiece = std::size_t{4} << 20, kSmall = std::size_t{1} << 20;
  std::vector<std::shared_ptr<std::byte>> pieces(opencl::PinnedPool::kMost / kPiece);
  for (auto& piece : pieces) piece = pool->take(kPiece);
  if (!pieces.back()) GTEST_SKIP() << "skipped: the device pins less";
  EXPECT_EQ(pool->take(kSmall), nullptr) << "all of it is in use";
  pieces.clear();
  EXPECT_NE(pool->take(kSmall), nullptr);
  pieces.assign(opencl::PinnedPool::kMost / kPiece - 1, nullptr);
  for (auto& piece : pieces) piece = pool->take(kPiece);
  EXPECT_TRUE(std::ranges::all_of(pieces, [](const auto& piece) { return piece != nullptr; }))
      << "the others are kept";
}

// Pinning waits for all that the device does.
TEST(OpenClDevice, ListsThatGrowLittleByLittleGoByOneStage) {
  if (!test::open_first_device()) GTEST_SKIP() << "skipped: no OpenCL device";
  opencl::DeviceSession session = opencl::open_session(test::unit_request());
  session.pinned = std::make_shared<opencl::PinnedPool>(session.queue);
  opencl::Transfers transfers(session);
  constexpr std::size_t kEntry = 16;
  constexpr cl_int kMost = 8000;
  const opencl::Transfers::Counted list{
      .count = cl::Buffer(session.context, CL_MEM_READ_WRITE, sizeof(cl_int)),
      .list = cl::Buffer(session.context, CL_MEM_READ_WRITE, kMost * kEntry),
      .entry_bytes = kEntry,
      .most = kMost};
  std::set<const std::byte*> stages;
  std::vector<std::vector<std::byte>> between;  // So that none is freed and made in its place.
  for (cl_int count = 4200; count <= kMost; count += 200) {  // Of 65,536 B and above.
    session.queue.enqueueWriteBuffer(list.count, CL_TRUE, 0, sizeof(count), &count);
    stages.insert(transfers.read(list).data());
    between.emplace_back(kMost * kEntry);
  }
  EXPECT_EQ(stages.size(), 1U);
}

// ------------------------------------------------------------------------------------------ cores

std::vector<int> cores_of_this_thread() {
  cpu_set_t set;
  CPU_ZERO(&set);
  EXPECT_EQ(sched_getaffinity(0, sizeof(set), &set), 0);
  std::vector<int> cores;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(static_cast<std::size_t>(core), &set)) cores.push_back(core);
  }
  return cores;
}

/// Pinning is for good, so that it happens on a thread of its own.
void on_own_thread(const std::function<void()>& body) { std::thread(body).join(); }

TEST(OpenClDevice, OnOneCoreHasOneComputeUnitAndPinsTheThread) {
  on_own_thread([] {
    const auto backend = make_opencl_backend();
    if (!backend->probe().available) GTEST_SKIP() << "skipped: no OpenCL device";
    const int core = cores_of_this_thread().back();
    const auto device = backend->open(test::unit_request("half", {core}));
    EXPECT_THAT(cores_of_this_thread(), testing::ElementsAre(core));
    if (!device->info().is_cpu) return;
    EXPECT_EQ(device->info().compute_units, 1);
    const Verdict verdict = test::run_and_verify(*device, vision::make_sobel(100, 40));
    EXPECT_TRUE(verdict.ok) << verdict.detail;
  });
}

// With PoCL 3.1 this crashed before its sub-devices were kept: workers touch them after the last
// command.
TEST(OpenClDevice, OnOneCoreIsOpenedAndClosedManyTimes) {
  on_own_thread([] {
    const auto backend = make_opencl_backend();
    if (!backend->probe().available) GTEST_SKIP() << "skipped: no OpenCL device";
    const int core = cores_of_this_thread().back();
    for (int i = 0; i < 50; ++i) {
      const auto device = backend->open(test::unit_request("half", {core}));
      const Verdict verdict = test::run_and_verify(*device, vision::make_sobel(20, 10));
      ASSERT_TRUE(verdict.ok) << verdict.detail;
      if (!device->info().is_cpu) return;
    }
  });
}

TEST(OpenClDevice, RefusesCoresThatAreNotThereAndLeavesTheThreadAsItWas) {
  on_own_thread([] {
    const auto before = cores_of_this_thread();
    for (const std::vector<int>& cores : {std::vector{0, 1023}, {-1}, {1 << 20}}) {
      const std::string message = environment_error([&] {
        static_cast<void>(make_opencl_backend()->open(test::unit_request("half", cores)));
      });
      EXPECT_THAT(message, AllOf(HasSubstr("half"), HasSubstr(std::to_string(cores.back()))));
      EXPECT_EQ(cores_of_this_thread(), before);
    }
  });
}

/// Core list of each other thread of this process, as the kernel prints it: "1" or "0-1".
std::vector<std::string> core_lists_of_other_threads() {
  std::vector<std::string> lists;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    if (task.path().filename() == std::to_string(gettid())) continue;
    std::ifstream status(task.path() / "status");
    const std::string key = "Cpus_allowed_list:\t";
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with(key)) lists.push_back(line.substr(key.size()));
    }
  }
  return lists;
}

/// Ends the process: 0 if a unit on the last core has one worker there, although the driver had
/// started its workers before, and if a unit without cores has all of them again.
[[noreturn]] void exit_if_workers_follow_the_unit() {
  const auto backend = make_opencl_backend();
  const int core = cores_of_this_thread().back();
  const auto workers_on_the_core = [core] {
    return std::ranges::count(core_lists_of_other_threads(), std::to_string(core));
  };
  try {
    const DeviceInfo whole = backend->open(test::unit_request())->info();
    if (!whole.is_cpu || whole.compute_units < 2) std::exit(0);
    if (workers_on_the_core() != 0) std::exit(1);
    std::thread([&] {
      const auto device = backend->open(test::unit_request("half", {core}));
      const Verdict verdict = test::run_and_verify(*device, vision::make_sobel(320, 200));
      if (!verdict.ok || workers_on_the_core() != 1) std::exit(2);
    }).join();
    const auto again = backend->open(test::unit_request());
    std::exit(workers_on_the_core() == 0 ? 0 : 3);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::exit(4);
  }
}

// In a process of its own there are no threads but the driver's and this test's.
TEST(OpenClDeviceDeathTest, KeepsTheWorkersOfACpuDriverOnTheUnitsCores) {
  if (!make_opencl_backend()->probe().available) GTEST_SKIP() << "skipped: no OpenCL device";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(exit_if_workers_follow_the_unit(), testing::ExitedWithCode(0), "");
}

// ------------------------------------------------------------------------ a machine without
// drivers

/// The ICD loader looks for drivers once a process, so each of these is a process of its own.
class OpenClWithoutDriver : public testing::Test {
 protected:
  void SetUp() override {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    folder_ = std::filesystem::temp_directory_path() / "pirt_no_opencl_drivers";
    std::filesystem::create_directories(folder_);
  }
  void hide_drivers() const {
    setenv("OCL_ICD_VENDORS", folder_.c_str(), 1);     // ocl-icd
    setenv("OPENCL_VENDOR_PATH", folder_.c_str(), 1);  // Khronos and old loaders
  }

 private:
  std::filesystem::path folder_;
};

/// Ends the process: 0 if the text holds all parts, otherwise 1.
[[noreturn]] void exit_if_holds(const std::string& text, std::initializer_list<const char*> parts) {
  for (const char* part : parts) {
    if (text.find(part) == std::string::npos) {
      std::fprintf(stderr, "'%s' lacks '%s'\n", text.c_str(), part);
      std::exit(1);
    }
  }
  std::exit(0);
}

TEST_F(OpenClWithoutDriver, ProbeSaysWhatToInstall) {
  EXPECT_EXIT(
      {
        hide_drivers();
        const Probe probe = make_opencl_backend()->probe();
        if (probe.available || !probe.devices.empty()) std::exit(2);
        exit_if_holds(probe.reason, {"install", "pocl-opencl-icd"});
      },
      testing::ExitedWithCode(0), "");
}

TEST_F(OpenClWithoutDriver, OpenIsAnEnvironmentErrorThatSaysWhatToInstall) {
  EXPECT_EXIT(
      {
        hide_drivers();
        try {
          static_cast<void>(make_opencl_backend()->open(test::unit_request("gpu")));
        } catch (const Error& error) {
          if (error.code() != ErrorCode::kEnvironment) std::exit(3);
          exit_if_holds(error.what(), {"gpu", "install", "pocl-opencl-icd"});
        }
        std::exit(2);
      },
      testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace pirt
