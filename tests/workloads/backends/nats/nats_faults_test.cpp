// Tasks under seeded faults over loopback: what was submitted ends exactly once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <random>
#include <thread>

#include "tests/support/long.h"
#include "tests/workloads/backends/nats/nats_server.h"
#include "workloads/base/time.h"

namespace pirt::cloud::test {
namespace {

using namespace std::chrono_literals;
constexpr Nanos kLong = 30s;

struct Expected {
  AddingTask task;
  Submitted submitted;
};

class Faults {
 public:
  explicit Faults(unsigned seed) : random_(seed) {}

  void run(int faults) {
    ASSERT_TRUE(server_.start()) << server_.log();
    administer({.server = server_.url()}, {.robots = {"robot", "other"}});
    robot_wire_ = std::make_unique<Wire>(server_.port());
    worker_wire_ = std::make_unique<Wire>(server_.port());
    for (pid_t& each : workers_) each = start_worker_process(worker_wire_->url(), 2);
    RobotLink robot(robot_options(robot_wire_->url()));
    ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
    std::atomic<bool> over = false;
    std::jthread large([&] { call_large(over); });
    for (int i = 0; i < faults; ++i) {
      for (int task = 0; task < 3; ++task) submit(robot);
      std::this_thread::sleep_for(pause(200));
      fault();
    }
    over = true;
    check(robot);
    large.join();
    for (pid_t& each : workers_) end_process(each);
  }

 private:
  Nanos pause(unsigned most_ms) { return std::chrono::milliseconds(random_() % most_ms); }

  void submit(RobotLink& robot) {
    const AddingTask task{.ask = random_() % 8 == 0 ? Ask::kThrow : Ask::kPlain,
                          .tens_of_ms = static_cast<std::uint8_t>(random_() % 15),
                          .value = static_cast<std::uint8_t>(random_())};
    expected_.push_back({task, {robot, make_message(small_, task)}});
  }

  /// What is larger than a message, by another robot, one after the other.
  void call_large(const std::atomic<bool>& over) {
    const auto device = open_unit(robot_wire_->url(), "robot: other");
    std::unique_ptr<Kernel> kernel;
    for (std::uint8_t value = 1; !over; ++value) {
      try {
        if (kernel == nullptr) kernel = device->prepare(large_, {});
      } catch (const std::exception&) {
        continue;  // Out of reach just now.
      }
      const std::string problem = call_and_check(*kernel, large_, {.value = value});
      // Its outputs were read while the server was gone, and lie in its memory no more.
      if (problem.find("no longer on the server") != std::string::npos) continue;
      EXPECT_EQ(problem, "");
    }
  }

  void fault() {
    switch (random_() % 6) {
      case 0:
        server_.kill();
        std::this_thread::sleep_for(pause(300));
        ASSERT_TRUE(server_.start()) << server_.log();
        break;
      case 1: {
        pid_t& worker = workers_[random_() % workers_.size()];
        end_process(worker);
        std::this_thread::sleep_for(pause(300));
        worker = start_worker_process(worker_wire_->url(), 2);
        break;
      }
      case 2:
        cut(*robot_wire_);
        break;
      case 3:
        cut(*worker_wire_);
        break;
      case 4: {
        Wire& wire = random_() % 2 == 0 ? *robot_wire_ : *worker_wire_;
        wire.hold(true);
        std::this_thread::sleep_for(pause(400));
        wire.hold(false);
        break;
      }
      default:
        std::this_thread::sleep_for(pause(300));
    }
  }

  void cut(Wire& wire) {
    wire.cut(true);
    std::this_thread::sleep_for(pause(300));
    wire.cut(false);
  }

  void check(const RobotLink& robot) {
    for (const auto& [task, submitted] : expected_) {
      const ReplyMessage end = submitted.end(120s);
      ASSERT_NE(end.problem, "no end") << robot.why_down();
      if (task.ask == Ask::kThrow) {
        EXPECT_TRUE(end.problem.starts_with("given up")) << end.problem;
        continue;
      }
      // Three workers that die with a task are its three tries.
      if (end.problem.find("a worker that was not heard") != std::string::npos) continue;
      ASSERT_EQ(end.problem, "");
      EXPECT_EQ(check_outputs(small_, task, end), "");
    }
  }

  std::mt19937 random_;
  Workload small_ = adding("small", 1000), large_ = adding("large", 3'000'000);
  NatsServer server_;
  std::unique_ptr<Wire> robot_wire_, worker_wire_;
  std::vector<pid_t> workers_ = {-1, -1};
  std::vector<Expected> expected_;
};

/// Twenty faults a seed: ten seeds in the long tests.
TEST(CloudFaults, EndEachTaskOnceAtItsCaller) {
  if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
  const auto seeds = pirt::test::repetitions(1, 10);
  const int faults = pirt::test::long_tests() ? 20 : 10;
  for (int i = 0; i < seeds.count; ++i) {
    const auto seed = static_cast<unsigned>(seeds.first + i + 1);
    SCOPED_TRACE(seed);
    Faults(seed).run(faults);
  }
}

class CloudWorker : public ::testing::Test {
 protected:
  void SetUp() override {
    if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
    ASSERT_TRUE(server_.start()) << server_.log();
    administer({.server = server_.url()}, {});
    options_ = worker_options(server_.url());
  }
  [[nodiscard]] std::string call(const Workload& workload, const AddingTask& task) const {
    const auto device = open_unit(server_.url(), "", 3);
    std::string problem;
    return error_of(
               [&] { problem = call_and_check(*device->prepare(workload, {}), workload, task); }) +
           problem;
  }
  NatsServer server_;
  WorkerOptions options_;
  const Workload small_ = adding("small", 1000), large_ = adding("large", 1'000'000);
  const std::vector<const Workload*> known_ = {&small_, &large_};
};

TEST_F(CloudWorker, ReadsWhatIsLargeForAsLongAsItsBytesMayTake) {
  options_.fetch = Nanos(0);
  const WorkerLink worker(options_, known_);
  EXPECT_EQ(call(large_, {.value = 3}), "");
}

TEST_F(CloudWorker, SaysAtTheEndWhatBecameOfAllThatItTook) {
  std::atomic<bool> began = false;
  options_.make_computer = [&] {
    began = true;
    return make_adding_computer();
  };
  std::string last;
  std::jthread worker([&] {
    serve(
        options_, known_, [&] { return began.load(); },
        [&](const std::string& line) { last = line; });
  });
  static_cast<void>(call(small_, {.tens_of_ms = 50, .value = 3}));
  began = true;  // Whether or not it was taken.
  worker.join();
  EXPECT_THAT(last, ::testing::AnyOf(::testing::HasSubstr("1 taken, 1 done"),
                                     ::testing::HasSubstr("1 returned")));
}

}  // namespace
}  // namespace pirt::cloud::test
