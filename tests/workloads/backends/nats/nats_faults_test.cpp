// Tasks under seeded faults over loopback: what was submitted ends exactly once.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <random>
#include <sstream>

#include "tests/support/long.h"
#include "tests/workloads/backends/nats/nats_server.h"
#include "workloads/backends/nats/wire/subjects.h"

namespace pirt::cloud::test {
namespace {

using namespace std::chrono_literals;
constexpr Nanos kLong = 30s;

struct Expected {
  AddingTask task;
  bool large = false;
  int ends = 0;
  TaskEnd end;
};

class Faults {
 public:
  explicit Faults(unsigned seed) : random_(seed) {}

  void run(int faults) {
    ASSERT_TRUE(server_.start()) << server_.log();
    {
      Connection admin({.server = server_.url()}, {});
      ASSERT_TRUE(admin.wait_until_up(kLong));
      set_up(admin, {.robots = {"robot"}, .redelivered = 1s});
    }
    robot_wire_ = std::make_unique<Wire>(server_.port());
    worker_wire_ = std::make_unique<Wire>(server_.port());
    for (pid_t& each : workers_) each = start_worker_process(worker_wire_->url(), 2);
    RobotOptions options;
    options.connection.server = robot_wire_->url();
    options.connection.reconnect_wait = 50ms;
    options.outbox = server_.folder() / "outbox.db";
    options.limits.confirm = 1s;
    options.limits.silence = 3s;
    options.limits.worker = 2s;
    {
      RobotLink robot(options);
      ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
      for (int i = 0; i < faults; ++i) {
        for (int task = 0; task < 3; ++task) submit(robot);
        std::this_thread::sleep_for(pause(200));
        fault();
      }
      wait_for_all(robot);
      EXPECT_EQ(robot.counts().submitted, static_cast<std::int64_t>(expected_.size()));
      sent_again_ = robot.counts().sent_again;
    }
    EXPECT_TRUE(open_outbox(options.outbox, "robot", options.outbox_bytes)->all().empty());
    check();
    for (pid_t& each : workers_) end(each);
  }

 private:
  Nanos pause(unsigned most_ms) { return std::chrono::milliseconds(random_() % most_ms); }

  static void end(pid_t& worker) {
    ::kill(worker, SIGKILL);
    ::waitpid(worker, nullptr, 0);
  }

  void submit(RobotLink& robot) {
    auto expected = std::make_shared<Expected>();
    expected->large = random_() % 8 == 0;
    expected->task = {.ask = random_() % 8 == 0 ? Ask::kThrow : Ask::kPlain,
                      .tens_of_ms = static_cast<std::uint8_t>(random_() % 15),
                      .value = static_cast<std::uint8_t>(random_())};
    Submission submission = make_submission(expected->large ? large_ : small_, expected->task);
    body_ = submission.body;
    submission.ended = [this, expected](TaskEnd end) {
      const std::lock_guard lock(mutex_);
      ++expected->ends;
      expected->end = std::move(end);
    };
    last_ = robot.submit(std::move(submission));
    last_is_large_ = expected->large;
    expected_.push_back(std::move(expected));
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
        end(worker);
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
        publish_again();
    }
  }

  void cut(Wire& wire) {
    wire.cut(true);
    std::this_thread::sleep_for(pause(300));
    wire.cut(false);
  }

  /// The last task once more, past the server's window.
  void publish_again() {
    if (last_is_large_) return;
    Connection other({.server = server_.url()}, {});
    if (!other.wait_until_up(kLong)) return;
    const Bytes frame = encode(TaskMessage{.task = last_, .send = 1, .body = *body_});
    static_cast<void>(other.request(task_subject("robot"), frame, 5s));
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
        EXPECT_EQ(each->end.how, CallEndKind::kGivenUp) << each->end.problem;
        continue;
      }
      ASSERT_EQ(each->end.how, CallEndKind::kDone) << each->end.problem;
      EXPECT_EQ(check_outputs(each->large ? large_ : small_, each->task, each->end.outputs), "");
    }
  }

  std::mt19937 random_;
  Workload small_ = adding("small", 1000), large_ = adding("large", 3'000'000);
  NatsServer server_;
  std::unique_ptr<Wire> robot_wire_, worker_wire_;
  std::vector<pid_t> workers_ = {-1, -1};
  std::mutex mutex_;  ///< Of what has ended.
  std::vector<std::shared_ptr<Expected>> expected_;
  TaskId last_;
  bool last_is_large_ = false;
  std::shared_ptr<const Bytes> body_;
  std::int64_t sent_again_ = 0;
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
