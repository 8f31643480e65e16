// Tasks under seeded faults over loopback: what was submitted ends exactly once.
#include <gtest/gtest.h>

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
  int ends = 0;
  ReplyMessage end;
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
    wait_for_all(robot);
    large.join();
    EXPECT_EQ(robot.counts().submitted, static_cast<std::int64_t>(expected_.size()));
    check();
    for (pid_t& each : workers_) end_process(each);
  }

 private:
  Nanos pause(unsigned most_ms) { return std::chrono::milliseconds(random_() % most_ms); }

  void submit(RobotLink& robot) {
    auto expected = std::make_shared<Expected>();
    expected->task = {.ask = random_() % 8 == 0 ? Ask::kThrow : Ask::kPlain,
                      .tens_of_ms = static_cast<std::uint8_t>(random_() % 15),
                      .value = static_cast<std::uint8_t>(random_())};
    Submission submission = make_submission(small_, expected->task);
    submission.ended = [this, expected](ReplyMessage end) {
      const std::lock_guard lock(mutex_);
      ++expected->ends;
      expected->end = std::move(end);
    };
    robot.submit(robot.next_task(), std::move(submission));
    expected_.push_back(std::move(expected));
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
      if (problem.find("not on the server") != std::string::npos) continue;
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

  void wait_for_all(RobotLink& robot) {
    const auto all_ended = [this] {
      const std::lock_guard lock(mutex_);
      return std::ranges::all_of(expected_, [](const auto& each) { return each->ends > 0; });
    };
    for (int i = 0; i < 1200 && !all_ended(); ++i) std::this_thread::sleep_for(100ms);
    EXPECT_TRUE(all_ended()) << robot.why_down();
  }

  void check() {
    const std::lock_guard lock(mutex_);
    for (const auto& each : expected_) {
      ASSERT_EQ(each->ends, 1);
      if (each->task.ask == Ask::kThrow) {
        EXPECT_TRUE(each->end.problem.starts_with("given up")) << each->end.problem;
        continue;
      }
      // Three workers that die with a task are its three tries.
      if (each->end.problem.find("a worker that was not heard") != std::string::npos) continue;
      ASSERT_EQ(each->end.problem, "");
      EXPECT_EQ(check_outputs(small_, each->task, each->end), "");
    }
  }

  std::mt19937 random_;
  Workload small_ = adding("small", 1000), large_ = adding("large", 3'000'000);
  NatsServer server_;
  std::unique_ptr<Wire> robot_wire_, worker_wire_;
  std::vector<pid_t> workers_ = {-1, -1};
  std::mutex mutex_;  ///< Of what has ended.
  std::vector<std::shared_ptr<Expected>> expected_;
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

}  // namespace
}  // namespace pirt::cloud::test
