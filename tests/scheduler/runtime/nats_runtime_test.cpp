// The library's units elsewhere: what is out of reach is known before the first task, and what
// comes while the runtime is there is taken into service.
#include <list>
#include <thread>
#include <utility>

#include "scheduler/runtime/runtime.h"
#include "tests/scheduler/support.h"
#include "tests/workloads/backends/nats/nats_server.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/nats/service/computer.h"
#include "workloads/backends/registry.h"
#include "workloads/catalog/catalog.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::HasSubstr;
constexpr Nanos kLong = 30s;

RuntimeOptions options_of(const std::string& url) {
  RuntimeOptions options;
  const std::string units = R"(
platform: test
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  cloud: {role: cloud, backend: nats, active_w: 1, server: ")";
  options.platform = parse_platform("test.yaml", units + url + "\"}\n", {}, 2);
  options.workloads = {"pool5"};
  options.mode = "advanced";
  return options;
}

TaskFuture submit(Runtime& runtime, TaskOptions options = {}) {
  const Data data = data_of_seed_1(find_workload("pool5"));
  return runtime.submit("pool5", {data.inputs.begin(), data.inputs.end()}, std::move(options));
}

// Each try there would hold a task up until a call has waited for the way.
TEST(RuntimeElsewhere, GivesNothingToWhatIsOutOfReachFromTheBeginning) {
  Runtime runtime(options_of("nats://127.0.0.1:1"));
  EXPECT_EQ(submit(runtime).wait(), TaskEnd::kCompleted);
  const RuntimeStatistics statistics = runtime.statistics();
  EXPECT_EQ(statistics.completed, 1);
  EXPECT_EQ(statistics.returned, 0) << "it was tried in the cloud first";
}

/// A server and workers that come when the test wants them.
class RuntimeElsewhereLater : public testing::Test {
 protected:
  void SetUp() override {
    if (cloud::test::nats_server_program().empty()) {
      GTEST_SKIP() << "skipped: nats-server is not installed";
    }
  }
  void start_server() {
    ASSERT_TRUE(server_.start()) << server_.log();
    cloud::Connection admin({.server = server_.url()}, {});
    ASSERT_TRUE(admin.wait_until_up(kLong));
    cloud::set_up(admin, {.robots = {"robot"}});
  }
  void start_worker(const std::string& name, const Workload& workload) {
    cloud::WorkerOptions options;
    options.connection.server = server_.url();
    options.name = name;
    options.hello = 100ms;
    options.make_computer = [] {
      return cloud::make_device_computer(
          find_backend("cpu"), {.unit = "cpu", .cores = {}, .device = {}, .script = {}}, 1 << 20);
    };
    known_.push_back(&workload);
    workers_.push_back(std::make_unique<cloud::WorkerLink>(options, std::span(&known_.back(), 1)));
  }
  /// Tasks one after the other, until one is served there. @return  Whether one was.
  static bool comes_into_service(Runtime& runtime) {
    const MachineClock clock;
    for (const Nanos begin = clock.now(); clock.now() - begin < kLong;) {
      const TaskFuture task = submit(runtime);
      EXPECT_EQ(task.wait(), TaskEnd::kCompleted) << task.problem();
      if (task.unit() == "cloud") return true;
      std::this_thread::sleep_for(10ms);
    }
    return false;
  }

  cloud::test::NatsServer server_;
  const Workload other_ = cloud::test::adding("small", 1000);
  std::list<const Workload*> known_;
  std::vector<std::unique_ptr<cloud::WorkerLink>> workers_;
};

TEST_F(RuntimeElsewhereLater, TakesInAServerThatStartsAfterIt) {
  Runtime runtime(options_of(server_.url()));
  EXPECT_EQ(submit(runtime).wait(), TaskEnd::kCompleted);
  start_server();
  start_worker("worker", find_workload("pool5"));
  EXPECT_TRUE(comes_into_service(runtime));
  EXPECT_EQ(runtime.statistics().returned, 0);
}

TEST_F(RuntimeElsewhereLater, TakesInAWorkerThatStartsAfterIt) {
  start_server();
  Runtime runtime(options_of(server_.url()));
  EXPECT_EQ(submit(runtime).wait(), TaskEnd::kCompleted);
  start_worker("worker", find_workload("pool5"));
  EXPECT_TRUE(comes_into_service(runtime));
  EXPECT_EQ(runtime.statistics().returned, 0);
}

// Nothing runs as the server goes, so that nobody has looked when the next task comes.
TEST_F(RuntimeElsewhereLater, GivesNothingToWhatWentWhileNothingRan) {
  start_server();
  start_worker("worker", find_workload("pool5"));
  Runtime runtime(options_of(server_.url()));
  ASSERT_TRUE(comes_into_service(runtime));
  const cloud::Connection beside({.server = server_.url()}, {});
  ASSERT_TRUE(cloud::test::eventually([&] { return beside.is_up(); }));
  server_.kill();
  ASSERT_TRUE(cloud::test::eventually([&] { return !beside.is_up(); }));
  std::this_thread::sleep_for(200ms);  // The runtime's own thread hears of it, too.
  const TaskFuture task = submit(runtime);
  EXPECT_EQ(task.wait_for(10s), TaskEnd::kCompleted);
  EXPECT_EQ(task.unit(), "cpu");
}

// Nobody else may serve it, so that it is not wanted back before its deadline, which is over.
TEST_F(RuntimeElsewhereLater, AWorkerComputesWhatIsLateAndNobodyElseWouldTake) {
  start_server();
  start_worker("worker", find_workload("pool5"));
  Runtime runtime(options_of(server_.url()));
  ASSERT_TRUE(comes_into_service(runtime));
  const TaskFuture late = submit(runtime, {.deadline = 1ns, .eligible = {"cloud"}});
  EXPECT_EQ(late.wait(), TaskEnd::kCompleted) << late.problem();
  EXPECT_EQ(late.unit(), "cloud");
}

// The one that is there as it starts does not know the workload.
TEST_F(RuntimeElsewhereLater, TakesInAWorkerThatKnowsWhatOthersDoNot) {
  start_server();
  start_worker("first", other_);
  Runtime runtime(options_of(server_.url()));
  EXPECT_THAT(runtime.statistics().problems,
              Contains(HasSubstr("cloud: pool5 is not asked for there: worker first")));
  EXPECT_EQ(submit(runtime).wait(), TaskEnd::kCompleted);
  workers_.clear();
  start_worker("second", find_workload("pool5"));
  EXPECT_TRUE(comes_into_service(runtime));
  EXPECT_EQ(runtime.statistics().returned, 0);
}

// The one that comes first does not know it either: it is named, and nothing is tried there.
TEST_F(RuntimeElsewhereLater, NamesWhatAWorkerThatStartsAfterItDoesNotKnow) {
  start_server();
  Runtime runtime(options_of(server_.url()));
  start_worker("first", other_);
  const auto is_named = [&] {
    const RuntimeStatistics statistics = runtime.statistics();
    return testing::Value(statistics.problems, Contains(HasSubstr("pool5 is not asked for there")));
  };
  const MachineClock clock;
  const Nanos begin = clock.now();
  while (!is_named() && clock.now() - begin < kLong) {
    EXPECT_EQ(submit(runtime).wait(), TaskEnd::kCompleted);
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_TRUE(is_named());
  EXPECT_EQ(runtime.statistics().returned, 0);
  workers_.clear();
  start_worker("second", find_workload("pool5"));
  EXPECT_TRUE(comes_into_service(runtime));
}

}  // namespace
}  // namespace pirt::test
