// The cloud against a real server: robots, workers and server are killed, cut off and restarted.
#include "tests/workloads/backends/nats/nats_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <condition_variable>
#include <future>
#include <random>

#include "tests/support/long.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/backends/nats/worker/process_computer.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"

namespace pirt::cloud::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
constexpr Nanos kLong = 30s;

TEST(CloudProcess, IsAWorker) {
  if (std::getenv("PIRT_TEST_CLOUD") == nullptr) {
    GTEST_SKIP() << "the body of the processes that other tests start and kill";
  }
  run_worker_process();
}

Json json_of(const Bytes& bytes) { return parse_json(text_of(bytes)); }

TEST(CloudProcess, IsASlot) {
  if (std::getenv("PIRT_TEST_SLOT") == nullptr) {
    GTEST_SKIP() << "the body of the processes that compute in another test";
  }
  const Workload small = adding("small", 1000), weighed = adding("weighed", 100, 1'500'000);
  const std::vector<const Workload*> known = {&small, &weighed};
  serve_computer(*make_adding_computer(), known, 1 << 30);
}

class CloudServer : public ::testing::Test {
 protected:
  void SetUp() override {
    if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
    server_ = std::make_unique<NatsServer>();
    ASSERT_TRUE(server_->start()) << server_->log();
    Connection admin({.server = server_->url()}, {});
    ASSERT_TRUE(admin.wait_until_up(kLong));
    set_up(admin, setup_);
  }

  [[nodiscard]] RobotOptions robot_options(const std::string& url) const {
    RobotOptions options;
    options.connection.server = url;
    options.connection.reconnect_wait = 50ms;
    options.limits.confirm = 1s;
    options.limits.silence = 3s;
    options.limits.worker = 2s;
    return options;
  }
  [[nodiscard]] std::unique_ptr<WorkerLink> start_worker(const std::string& url, int slots = 1) {
    WorkerOptions options;
    options.connection.server = url;
    options.connection.reconnect_wait = 50ms;
    options.name = "w" + std::to_string(++workers_);
    options.limits.slots = slots;
    options.limits.progress = 300ms;
    options.limits.confirm = 1s;
    options.hello = 300ms;
    options.make_computer = make_computer_;
    return std::make_unique<WorkerLink>(options, known_);
  }
  static std::future<TaskEnd> submit(RobotLink& robot, Submission submission,
                                     TaskId* id = nullptr) {
    auto end = std::make_shared<std::promise<TaskEnd>>();
    auto future = end->get_future();
    submission.ended = [end](TaskEnd told) { end->set_value(std::move(told)); };
    const TaskId task = robot.submit(std::move(submission));
    if (id != nullptr) *id = task;
    return future;
  }
  std::future<TaskEnd> submit(RobotLink& robot, const AddingTask& task, TaskId* id = nullptr) {
    return submit(robot, make_submission(small_, task), id);
  }
  static TaskEnd end_of(std::future<TaskEnd>& future, Nanos most = kLong) {
    if (future.wait_for(most) != std::future_status::ready) {
      ADD_FAILURE() << "no end";
      return {.how = CallEndKind::kCancelled, .problem = "no end"};
    }
    return future.get();
  }
  /// Messages on a stream.
  std::int64_t messages(const std::string& stream) {
    Connection admin({.server = server_->url()}, {});
    if (!admin.wait_until_up(kLong)) return -1;
    const auto answer = admin.request("$JS.API.STREAM.INFO." + stream, "", 5s);
    return answer.came ? json_of(answer.data).at("state").at("messages").get<std::int64_t>() : -1;
  }
  /// Until there are no messages, or a while is over; how many there are then.
  std::int64_t messages_in_the_end(const std::string& stream) {
    std::int64_t left = 0;
    static_cast<void>(eventually([&] { return (left = messages(stream)) == 0; }));
    return left;
  }
  /// Tasks that workers have taken and not acknowledged.
  int taken() {
    Connection admin({.server = server_->url()}, {});
    if (!admin.wait_until_up(kLong)) return -1;
    const auto info = admin.request("$JS.API.CONSUMER.INFO.PIRT_TASKS.workers", "", 5s);
    return info.came ? json_of(info.data).at("num_ack_pending").get<int>() : -1;
  }

  cloud::Setup setup_{.robots = {"robot"}, .redelivered = 1s};
  Workload small_ = adding("small", 1000), large_ = adding("large", 3'000'000),
           weighed_ = adding("weighed", 100, 1'500'000);
  std::vector<const Workload*> known_ = {&small_, &large_, &weighed_};
  std::unique_ptr<NatsServer> server_;
  std::function<std::unique_ptr<Computer>()> make_computer_ = make_adding_computer;
  int workers_ = 0;
};

TEST_F(CloudServer, ComputesACall) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  const AddingTask task{.tens_of_ms = 2, .value = 9};
  auto future = submit(robot, task);
  const TaskEnd end = end_of(future);
  EXPECT_EQ(end.how, CallEndKind::kDone) << end.problem;
  EXPECT_EQ(check_outputs(small_, task, end.outputs), "");
  EXPECT_EQ(end.worker, "w1");
  EXPECT_GE(end.execute, 20ms);
  EXPECT_GE(end.held, end.execute);
  EXPECT_GT(end.stored, 0ms);
  EXPECT_GE(end.total, end.arrived);
  EXPECT_EQ(messages_in_the_end(kTaskStream), 0);
  EXPECT_EQ(messages_in_the_end(kReplyStream), 0);
}

TEST_F(CloudServer, HasManyInFlightAndLeavesTheRestInTheStream) {
  const auto worker = start_worker(server_->url(), 2);
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  std::vector<std::future<TaskEnd>> ends;
  for (int i = 0; i < 20; ++i) {
    ends.push_back(submit(robot, {.tens_of_ms = 5, .value = static_cast<std::uint8_t>(i)}));
  }
  std::this_thread::sleep_for(120ms);
  EXPECT_LE(taken(), 2);
  for (int i = 0; i < 20; ++i) {
    const TaskEnd end = end_of(ends[static_cast<std::size_t>(i)]);
    EXPECT_EQ(end.how, CallEndKind::kDone) << end.problem;
    EXPECT_EQ(check_outputs(small_, {.tens_of_ms = 5, .value = static_cast<std::uint8_t>(i)},
                            end.outputs),
              "");
  }
  EXPECT_EQ(worker->counts().tasks.run, 20);
  EXPECT_EQ(robot.counts().done, 20);
}

TEST_F(CloudServer, SendsWhatIsLargerThanAMessageInChunksAndRemovesThem) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  const AddingTask task{.value = 3};
  auto future = submit(robot, make_submission(large_, task));
  const TaskEnd end = end_of(future);
  ASSERT_EQ(end.how, CallEndKind::kDone) << end.problem;
  EXPECT_EQ(check_outputs(large_, task, end.outputs), "");
  EXPECT_TRUE(robot.estimate().bytes_per_s.has_value());
  EXPECT_EQ(messages_in_the_end(kBlobStream), 0);
}

TEST_F(CloudServer, SendsParametersOnce) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  for (int i = 0; i < 3; ++i) {
    auto future = submit(robot, make_submission(weighed_, {.value = 3}, 5));
    const TaskEnd end = end_of(future);
    ASSERT_EQ(end.how, CallEndKind::kDone) << end.problem;
    EXPECT_EQ(check_outputs(weighed_, {.value = 3}, end.outputs, 5), "");
  }
  EXPECT_EQ(worker->counts().missed_parameters, 1);
  EXPECT_EQ(messages(kBlobStream), 6) << "1.5 MB in chunks of 256 KiB, which stay for others";
  auto other = submit(robot, make_submission(weighed_, {.value = 3}, 6));
  EXPECT_EQ(check_outputs(weighed_, {.value = 3}, end_of(other).outputs, 6), "");
  EXPECT_EQ(worker->counts().missed_parameters, 2);
}

TEST_F(CloudServer, GivesATaskOfAKilledWorkerToAnother) {
  pid_t first = start_worker_process(server_->url(), 1);
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  const AddingTask task{.tens_of_ms = 200, .value = 4};
  auto future = submit(robot, task);
  ASSERT_TRUE(eventually([&] { return taken() == 1; }));
  ::kill(first, SIGKILL);
  ::waitpid(first, nullptr, 0);
  EXPECT_EQ(future.wait_for(0s), std::future_status::timeout) << "it was killed half-way";
  const auto second = start_worker(server_->url());
  const TaskEnd end = end_of(future);
  EXPECT_EQ(end.how, CallEndKind::kDone) << end.problem;
  EXPECT_EQ(end.worker, "w1");
  EXPECT_EQ(check_outputs(small_, task, end.outputs), "");
}

TEST_F(CloudServer, GoesOnWhenTheServerWasKilledAndStartsAgain) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  std::vector<std::future<TaskEnd>> ends;
  const auto submit_some = [&] {
    for (int i = 0; i < 5; ++i) ends.push_back(submit(robot, {.tens_of_ms = 10, .value = 8}));
  };
  submit_some();
  std::this_thread::sleep_for(150ms);
  server_->kill();
  submit_some();
  EXPECT_TRUE(eventually([&] { return robot.availability() == Availability::kDown; }));
  EXPECT_THAT(robot.why_down(), HasSubstr("no connection to server"));
  ASSERT_TRUE(server_->start()) << server_->log();
  for (auto& future : ends) {
    const TaskEnd end = end_of(future);
    EXPECT_EQ(end.how, CallEndKind::kDone) << end.problem;
    EXPECT_EQ(check_outputs(small_, {.tens_of_ms = 10, .value = 8}, end.outputs), "");
  }
  EXPECT_EQ(robot.counts().done, 10);
  EXPECT_TRUE(robot.wait_until_up(kLong));
}

TEST_F(CloudServer, WaitsForAServerThatIsNotThereYet) {
  server_->kill();
  RobotLink robot(robot_options(server_->url()));
  const auto worker = start_worker(server_->url());
  auto future = submit(robot, {.value = 8});
  EXPECT_FALSE(robot.wait_until_up(300ms));
  ASSERT_TRUE(server_->start()) << server_->log();
  EXPECT_EQ(end_of(future).how, CallEndKind::kDone);
}

TEST_F(CloudServer, IsDownForARobotThatItDoesNotKnow) {
  const auto worker = start_worker(server_->url());
  RobotOptions options = robot_options(server_->url());
  options.robot = "stranger";
  RobotLink robot(options);
  const auto is_named = [&] {
    return robot.why_down().find("pirt cloud-admin setup --robots stranger") != std::string::npos;
  };
  EXPECT_TRUE(eventually(is_named)) << robot.why_down();
  EXPECT_EQ(robot.availability(), Availability::kDown);
  auto future = submit(robot, {.value = 1});
  Connection admin({.server = server_->url()}, {});
  ASSERT_TRUE(admin.wait_until_up(kLong));
  set_up(admin, {.robots = {"stranger"}, .redelivered = 1s});
  EXPECT_EQ(end_of(future).how, CallEndKind::kDone);
  EXPECT_EQ(robot.why_down(), "");
}

TEST_F(CloudServer, GivesUpAPoisonedTaskAfterThreeTries) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  auto future = submit(robot, {.ask = Ask::kThrow});
  const TaskEnd end = end_of(future);
  EXPECT_EQ(end.how, CallEndKind::kGivenUp);
  EXPECT_EQ(end.problem, "given up after 3 tries; the last one failed on worker w1: boom");
  EXPECT_EQ(worker->counts().failed, 3);
  EXPECT_EQ(messages_in_the_end(kTaskStream), 0);
  auto next = submit(robot, {.value = 1});
  EXPECT_EQ(end_of(next).how, CallEndKind::kDone);
}

TEST_F(CloudServer, GivesUpATaskWhoseProcessDiesThreeTimesAndGoesOn) {
  ::setenv("PIRT_TEST_SLOT", "1", 1);
  make_computer_ = [] {
    return make_process_computer("/proc/self/exe", {"--gtest_filter=CloudProcess.IsASlot"});
  };
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  const auto computes = [&] {
    for (int i = 0; i < 2; ++i) {
      auto future = submit(robot, make_submission(weighed_, {.value = 4}, 5));
      const TaskEnd end = end_of(future);
      EXPECT_EQ(end.how, CallEndKind::kDone) << end.problem;
      EXPECT_EQ(check_outputs(weighed_, {.value = 4}, end.outputs, 5), "");
    }
  };
  computes();
  auto future = submit(robot, {.ask = Ask::kDie});
  const TaskEnd end = end_of(future);
  EXPECT_EQ(end.how, CallEndKind::kGivenUp);
  EXPECT_EQ(end.problem,
            "given up after 3 tries; the last one failed on worker w1: its process died (SIGKILL)");
  auto thrown = submit(robot, {.ask = Ask::kThrow});
  EXPECT_THAT(end_of(thrown).problem, HasSubstr("boom"));
  computes();
  ::unsetenv("PIRT_TEST_SLOT");
}

TEST_F(CloudServer, RefusesWhatNoWorkerKnows) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  const Workload other = adding("small", 999), unknown = adding("unknown", 10);
  EXPECT_THAT(robot.why_not(other), HasSubstr("has another small"));
  EXPECT_THAT(robot.why_not(unknown), HasSubstr("does not know unknown"));
  EXPECT_EQ(robot.why_not(small_), "");
  auto future = submit(robot, make_submission(other, {}));
  const TaskEnd end = end_of(future);
  EXPECT_EQ(end.how, CallEndKind::kRefused);
  EXPECT_THAT(end.problem, HasSubstr("small is something else here"));
}

TEST_F(CloudServer, GivesATaskBackInTimeAndDropsTheLateReply) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  Submission submission = make_submission(small_, {.tens_of_ms = 200});
  submission.time_left = 250ms;
  submission.give_back_after = 200ms;
  auto future = submit(robot, std::move(submission));
  const TaskEnd end = end_of(future);
  EXPECT_EQ(end.how, CallEndKind::kReturned);
  EXPECT_GE(end.total, 200ms);
  EXPECT_TRUE(eventually([&] { return robot.counts().late == 1; }));
  EXPECT_EQ(messages_in_the_end(kReplyStream), 0);
}

TEST_F(CloudServer, DropsWhatIsPastItsTimeAndSaysSo) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  auto before = submit(robot, {.tens_of_ms = 200, .value = 1});
  Submission submission = make_submission(small_, {.value = 2});
  submission.time_left = 200ms;  // It lies on the stream for longer.
  submission.give_back_after = kLong;
  auto future = submit(robot, std::move(submission));
  const TaskEnd end = end_of(future);
  EXPECT_EQ(end.how, CallEndKind::kReturned);
  EXPECT_EQ(end.problem, "its time was over before a worker began");
  EXPECT_EQ(end_of(before).how, CallEndKind::kDone);
  EXPECT_EQ(worker->counts().expired, 1);
  EXPECT_EQ(messages_in_the_end(kTaskStream), 0);
}

TEST_F(CloudServer, CancellingWithdrawsTheMessage) {
  RobotLink robot(robot_options(server_->url()));
  TaskId id;
  auto future = submit(robot, {.value = 2}, &id);
  auto kept = submit(robot, {.value = 3});
  ASSERT_TRUE(eventually([&] { return messages(kTaskStream) == 2; }));
  robot.cancel(id);
  EXPECT_EQ(end_of(future).how, CallEndKind::kCancelled);
  const auto worker = start_worker(server_->url());
  EXPECT_EQ(end_of(kept).how, CallEndKind::kDone);
  EXPECT_EQ(messages_in_the_end(kTaskStream), 0);
  EXPECT_EQ(messages_in_the_end(kWithdrawStream), 0);
  EXPECT_EQ(worker->counts().withdrawn, 1);
}

TEST_F(CloudServer, AKeySurvivesTheRobot) {
  RobotOptions options = robot_options(server_->url());
  options.outbox = server_->folder() / "outbox.db";
  const AddingTask task{.value = 77};
  {
    RobotLink robot(options);
    Submission submission = make_submission(small_, task);
    submission.key = "map of the cellar";
    static_cast<void>(submit(robot, std::move(submission)));
    static_cast<void>(submit(robot, {.value = 3}));
    ASSERT_TRUE(eventually([&] { return messages(kTaskStream) == 2; }));
  }
  const auto worker = start_worker(server_->url());
  RobotLink robot(options);
  Submission submission = make_submission(small_, task);
  submission.key = "map of the cellar";
  auto future = submit(robot, std::move(submission));
  const TaskEnd end = end_of(future);
  EXPECT_EQ(end.how, CallEndKind::kDone) << end.problem;
  EXPECT_EQ(check_outputs(small_, task, end.outputs), "");
  EXPECT_EQ(messages_in_the_end(kTaskStream), 0);
}

TEST_F(CloudServer, DropsAndCountsWhatIsNoMessage) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  Connection other({.server = server_->url()}, {});
  ASSERT_TRUE(other.wait_until_up(kLong));
  std::mt19937 random(1);
  const Bytes right = encode(ReplyMessage{.task = {1, 2}, .worker = "w"});
  for (int i = 0; i < 100; ++i) {
    Bytes bytes = right;
    bytes.resize(random() % (bytes.size() + 1));
    for (std::byte& each : bytes) each = static_cast<std::byte>(random());
    other.publish(task_subject("robot"), bytes);
    other.publish(reply_subject("robot"), bytes);
    other.publish(withdraw_subject("robot"), bytes);
    other.publish(kHelloSubject, bytes);
  }
  auto future = submit(robot, {.value = 1});
  EXPECT_EQ(end_of(future).how, CallEndKind::kDone);
  EXPECT_EQ(messages_in_the_end(kTaskStream), 0);
  EXPECT_EQ(messages_in_the_end(kReplyStream), 0);
  EXPECT_EQ(messages_in_the_end(kWithdrawStream), 0);
  EXPECT_GE(worker->counts().malformed, 100);
  EXPECT_GE(robot.malformed(), 100);
  EXPECT_EQ(worker->counts().tasks.run, 1);
}

}  // namespace
}  // namespace pirt::cloud::test
