// The cloud against a real server: robots, workers and server are killed, cut off and restarted.
#include "tests/workloads/backends/nats/nats_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <random>
#include <thread>

#include "tests/support/long.h"
#include "workloads/backends/nats/service/computer.h"
#include "workloads/backends/nats/wire/wire.h"
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

TEST(CloudProcess, IsARobot) {
  if (std::getenv("PIRT_TEST_ROBOT") == nullptr) {
    GTEST_SKIP() << "the body of the processes that another test starts and kills";
  }
  run_robot_process();
}

TEST(CloudProcess, IsASlot) {
  if (std::getenv("PIRT_TEST_SLOT") == nullptr) {
    GTEST_SKIP() << "the body of the processes that compute in another test";
  }
  const Workload small = adding("small", 1000), weighed = adding("weighed", 100, 1'500'000);
  const std::vector<const Workload*> known = {&small, &weighed};
  serve_computer(*make_adding_computer(), Admission(known, 1 << 30));
}

/// That is up.
struct ReachedRobot : RobotLink {
  explicit ReachedRobot(const std::string& url) : RobotLink(robot_options(url)) {
    EXPECT_TRUE(wait_until_up(kLong)) << why_down();
  }
};

class CloudServer : public ::testing::Test {
 protected:
  void SetUp() override {
    if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
    server_ = std::make_unique<NatsServer>();
    ASSERT_TRUE(server_->start()) << server_->log();
    set_up_robot("robot");
  }
  void set_up_robot(const std::string& name) {
    administer({.server = server_->url()}, {.robots = {name}});
  }
  std::unique_ptr<WorkerLink> start_worker(const std::string& url, int slots = 1) {
    WorkerOptions options = worker_options(url);
    options.name = "w" + std::to_string(++workers_);
    options.limits.slots = slots;
    options.make_computer = make_computer_;
    return std::make_unique<WorkerLink>(options, known_);
  }
  Submitted submit(RobotLink& robot, const AddingTask& task) {
    return {robot, make_message(small_, task)};
  }
  static ReplyMessage end_of(const Submitted& task) {
    ReplyMessage end = task.end(kLong);
    EXPECT_NE(end.problem, "no end");
    return end;
  }
  /// Messages on the robot's stream.
  std::int64_t messages() {
    Connection admin({.server = server_->url()}, {});
    if (!admin.wait_until_up(kLong)) return -1;
    const auto answer = admin.request("$JS.API.STREAM.INFO.PIRT_robot", {});
    if (!answer.came) return -1;
    return parse_json(text_of(answer.data)).at("state").at("messages").get<std::int64_t>();
  }

  Workload small_ = adding("small", 1000), large_ = adding("large", 3'000'000),
           weighed_ = adding("weighed", 100, 1'500'000);
  std::vector<const Workload*> known_ = {&small_, &large_, &weighed_};
  std::unique_ptr<NatsServer> server_;
  std::function<std::unique_ptr<Computer>()> make_computer_ = make_adding_computer;
  int workers_ = 0;
};

TEST_F(CloudServer, ComputesACall) {
  const auto worker = start_worker(server_->url());
  ReachedRobot robot(server_->url());
  const AddingTask task{.tens_of_ms = 2, .value = 9};
  const auto begin = MachineClock().now();
  const ReplyMessage end = end_of(submit(robot, task));
  EXPECT_EQ(end.problem, "");
  EXPECT_EQ(check_outputs(small_, task, end), "");
  EXPECT_EQ(end.worker, "w1");
  EXPECT_GE(end.execute, 20ms);
  EXPECT_GT(MachineClock().now() - begin, end.execute);
  EXPECT_EQ(messages(), 0) << "small messages are stored nowhere";
}

TEST_F(CloudServer, HasAsManyTasksAsSlotsAndLeavesTheRestWithTheRobot) {
  const auto worker = start_worker(server_->url(), 2);
  ReachedRobot robot(server_->url());
  std::vector<Submitted> ends;
  for (int i = 0; i < 20; ++i) {
    ends.push_back(submit(robot, {.tens_of_ms = 5, .value = static_cast<std::uint8_t>(i)}));
  }
  for (int i = 0; i < 20; ++i) {
    const WorkerCounts now = worker->counts();
    EXPECT_LE(now.taken - now.ended(ReplyKind::kDone), 2);
    const ReplyMessage end = end_of(ends[static_cast<std::size_t>(i)]);
    EXPECT_EQ(end.problem, "");
    EXPECT_EQ(check_outputs(small_, {.tens_of_ms = 5, .value = static_cast<std::uint8_t>(i)}, end),
              "");
  }
  EXPECT_EQ(worker->counts().ended(ReplyKind::kDone), 20);
  EXPECT_EQ(robot.ask(&Caller::counts).done, 20);
}

TEST_F(CloudServer, SendsWhatIsLargerThanAMessageInChunksAndRemovesThem) {
  const auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto kernel = device->prepare(large_, {});
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(call_and_check(*kernel, large_, {.value = 3}), "");
  }
  EXPECT_TRUE(dynamic_cast<const Remote&>(*device).link().bytes_per_s.has_value());
  EXPECT_TRUE(eventually([&] { return messages() == 0; })) << messages();
}

TEST_F(CloudServer, SendsParametersOnce) {
  const auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto five = device->prepare(weighed_, parameters_of(weighed_, 5));
  const auto six = device->prepare(weighed_, parameters_of(weighed_, 6));
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(call_and_check(*five, weighed_, {.value = 3}, 5), "");
  }
  EXPECT_EQ(worker->counts().ended(ReplyKind::kMissing), 1);
  EXPECT_EQ(messages(), 12) << "1.5 MB in chunks of 128 KiB, which stay for others";
  EXPECT_EQ(call_and_check(*six, weighed_, {.value = 3}, 6), "");
  EXPECT_EQ(worker->counts().ended(ReplyKind::kMissing), 2);
}

TEST_F(CloudServer, GivesATaskOfAKilledWorkerToAnother) {
  pid_t first = start_worker_process(server_->url(), 1);
  ReachedRobot robot(server_->url());
  const AddingTask task{.tens_of_ms = 200, .value = 4};
  const Submitted submitted = submit(robot, task);
  ASSERT_TRUE(submitted.is_taken(kLong));
  end_process(first);
  EXPECT_EQ(submitted.end(0s).problem, "no end") << "it was killed half-way";
  const auto second = start_worker(server_->url());
  const ReplyMessage end = end_of(submitted);
  EXPECT_EQ(end.problem, "");
  EXPECT_EQ(end.worker, "w1");
  EXPECT_EQ(check_outputs(small_, task, end), "");
}

TEST_F(CloudServer, GoesOnWhenTheServerWasKilledAndStartsAgain) {
  const auto worker = start_worker(server_->url());
  ReachedRobot robot(server_->url());
  std::vector<Submitted> ends;
  const auto submit_some = [&] {
    for (int i = 0; i < 5; ++i) ends.push_back(submit(robot, {.tens_of_ms = 10, .value = 8}));
  };
  submit_some();
  std::this_thread::sleep_for(150ms);
  server_->kill();
  submit_some();
  EXPECT_TRUE(eventually([&] { return !robot.is_up(); }));
  EXPECT_THAT(robot.why_down(), HasSubstr("no connection to server"));
  ASSERT_TRUE(server_->start()) << server_->log();
  for (const Submitted& each : ends) {
    const ReplyMessage end = end_of(each);
    EXPECT_EQ(end.problem, "");
    EXPECT_EQ(check_outputs(small_, {.tens_of_ms = 10, .value = 8}, end), "");
  }
  EXPECT_EQ(robot.ask(&Caller::counts).done, 10);
  EXPECT_TRUE(robot.wait_until_up(kLong));
}

TEST_F(CloudServer, WaitsForAServerThatIsNotThereYet) {
  server_->kill();
  RobotLink robot(robot_options(server_->url()));
  const auto worker = start_worker(server_->url());
  const Submitted submitted = submit(robot, {.value = 8});
  EXPECT_FALSE(robot.wait_until_up(300ms));
  ASSERT_TRUE(server_->start()) << server_->log();
  EXPECT_EQ(end_of(submitted).problem, "");
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
  EXPECT_FALSE(robot.is_up());
  const Submitted submitted = submit(robot, {.value = 1});
  set_up_robot("stranger");
  EXPECT_EQ(end_of(submitted).problem, "");
  EXPECT_EQ(robot.why_down(), "");
}

TEST_F(CloudServer, GivesUpAPoisonedTaskAfterThreeTries) {
  const auto worker = start_worker(server_->url());
  ReachedRobot robot(server_->url());
  const ReplyMessage end = end_of(submit(robot, {.ask = Ask::kThrow}));
  EXPECT_EQ(end.problem, "given up after 3 tries; the last one failed on worker w1: boom");
  EXPECT_EQ(worker->counts().ended(ReplyKind::kFailedTry), 3);
  EXPECT_EQ(end_of(submit(robot, {.value = 1})).problem, "");
}

/// Whose slots are processes of their own.
class CloudSlots : public CloudServer {
 protected:
  void SetUp() override {
    CloudServer::SetUp();
    ::setenv("PIRT_TEST_SLOT", "1", 1);
    make_computer_ = [this] {
      return make_process_computer(
          {.command = {"/proc/self/exe", "--gtest_filter=CloudProcess.IsASlot"},
           .call_limit =
               [this](const Workload& each) {
                 const auto own = call_limits_.find(&each);
                 return own != call_limits_.end() ? own->second : call_limit_;
               },
           .end_limit = 300ms});
    };
  }
  void TearDown() override { ::unsetenv("PIRT_TEST_SLOT"); }
  /// Children of this process but for the server.
  [[nodiscard]] std::vector<pid_t> processes() const {
    std::vector<pid_t> all;
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
      std::ifstream list(task.path() / "children");
      for (pid_t id = 0; list >> id;) {
        if (id != server_->process()) all.push_back(id);
      }
    }
    return all;
  }
  Nanos call_limit_ = 20s;
  std::map<const Workload*, Nanos> call_limits_;
};

TEST_F(CloudSlots, GiveUpATaskWhoseProcessDiesThreeTimesAndGoOn) {
  const auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto weighs = device->prepare(weighed_, parameters_of(weighed_, 5));
  const auto kernel = device->prepare(small_, {});
  EXPECT_EQ(call_and_check(*weighs, weighed_, {.value = 4}, 5), "");
  EXPECT_EQ(call_and_check(*kernel, small_, {.ask = Ask::kDie}),
            "given up after 3 tries; the last one failed on worker w1: its process crashed "
            "(SIGKILL)");
  EXPECT_THAT(call_and_check(*kernel, small_, {.ask = Ask::kThrow}), HasSubstr("boom"));
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(call_and_check(*weighs, weighed_, {.value = 4}, 5), "");
  }
}

TEST_F(CloudSlots, ThatDieBetweenCallsCostNoTry) {
  const auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto kernel = device->prepare(small_, {});
  EXPECT_EQ(call_and_check(*kernel, small_, {.value = 4}), "");
  const auto slots = processes();
  ASSERT_EQ(slots.size(), 1U);
  ::kill(slots[0], SIGKILL);
  siginfo_t ended{};
  ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(slots[0]), &ended, WEXITED | WNOWAIT), 0);
  EXPECT_EQ(call_and_check(*kernel, small_, {.value = 4}), "");
  EXPECT_EQ(worker->counts().ended(ReplyKind::kFailedTry), 0);
}

TEST_F(CloudSlots, StartAgainWhereTheirDeviceIsLost) {
  const auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto kernel = device->prepare(small_, {});
  EXPECT_THAT(call_and_check(*kernel, small_, {.ask = Ask::kLoseDevice}),
              HasSubstr("given up after 3 tries; the last one failed on worker w1: its process "));
  EXPECT_EQ(call_and_check(*kernel, small_, {.value = 4}), "");
}

TEST_F(CloudSlots, KillAProcessThatIsOverItsTimeAndCountATry) {
  call_limit_ = 500ms;
  const auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto kernel = device->prepare(small_, {});
  EXPECT_THAT(call_and_check(*kernel, small_, {.tens_of_ms = 250}),
              HasSubstr("given up after 3 tries; the last one failed on worker w1: it was over its "
                        "limit of 0.5 s"));
  EXPECT_EQ(worker->counts().ended(ReplyKind::kFailedTry), 3);
  EXPECT_EQ(call_and_check(*kernel, small_, {.value = 4}), "");
}

TEST_F(CloudSlots, GiveACallTheTimeOfItsRowWhereItHasOne) {
  call_limits_[&small_] = 500ms;
  const auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto limited = device->prepare(small_, {});
  const auto weighs = device->prepare(weighed_, parameters_of(weighed_, 5));
  EXPECT_THAT(call_and_check(*limited, small_, {.tens_of_ms = 250}),
              HasSubstr("it was over its limit of 0.5 s"));
  EXPECT_EQ(call_and_check(*weighs, weighed_, {.tens_of_ms = 100}, 5), "");
}

TEST_F(CloudSlots, EndWithTheirWorkerWhateverTheyCompute) {
  auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto kernel = device->prepare(small_, {});
  const AddingTask task{.tens_of_ms = 255, .value = 4};
  std::string problem = "no end";
  std::jthread calls([&] { problem = call_and_check(*kernel, small_, task); });
  ASSERT_TRUE(eventually([&] { return worker->counts().taken == 1; }));
  const auto begin = std::chrono::steady_clock::now();
  worker.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s) << "the call takes 2.55 s";
  make_computer_ = make_adding_computer;
  worker = start_worker(server_->url());
  calls.join();
  EXPECT_EQ(problem, "") << "the next worker computes it";
}

TEST_F(CloudSlots, RefuseARobotWhoseCallsEndTheirProcesses) {
  const auto worker = start_worker(server_->url());
  const auto device = open_unit(server_->url());
  const auto kernel = device->prepare(small_, {});
  std::string said;
  for (int i = 0; i < 4; ++i) said = call_and_check(*kernel, small_, {.ask = Ask::kDie});
  EXPECT_THAT(said, HasSubstr("robot robot: 10 of its calls ended a process of this worker"));
  set_up_robot("other");
  const auto another = open_unit(server_->url(), "robot: other");
  EXPECT_EQ(call_and_check(*another->prepare(small_, {}), small_, {.value = 4}), "");
}

TEST_F(CloudServer, RefusesWhatNoWorkerKnows) {
  const auto worker = start_worker(server_->url());
  ReachedRobot robot(server_->url());
  const Workload other = adding("small", 999), unknown = adding("unknown", 10);
  const auto why_not = [&](const Workload& workload) {
    return robot.ask(&Caller::why_not, kind_of(workload));
  };
  EXPECT_THAT(why_not(other), HasSubstr("has another small"));
  EXPECT_THAT(why_not(unknown), HasSubstr("does not know unknown"));
  EXPECT_EQ(why_not(small_), "");
  const ReplyMessage end = end_of({robot, make_message(other, {})});
  EXPECT_THAT(end.problem, HasSubstr("refused by worker w1: small is something else here"));
}

TEST_F(CloudServer, TellsTheWorkerThatNobodyWantsATaskAnyMore) {
  const auto worker = start_worker(server_->url());
  ReachedRobot robot(server_->url());
  const Submitted submitted = submit(robot, {.tens_of_ms = 50});
  ASSERT_TRUE(eventually([&] { return worker->counts().taken == 1; }));
  submitted.cancel();
  EXPECT_EQ(end_of(submitted).problem, "cancelled");
  EXPECT_TRUE(eventually([&] { return worker->counts().cancelled == 1; }));
}

TEST_F(CloudServer, DropsWhatIsPastItsTimeAndSaysSo) {
  const auto worker = start_worker(server_->url());
  ReachedRobot robot(server_->url());
  auto before = submit(robot, {.tens_of_ms = 100, .value = 1});
  TaskMessage late = make_message(small_, {.value = 2});
  late.time_left = 200ms;  // It waits for longer.
  const ReplyMessage end = end_of({robot, std::move(late)});
  EXPECT_EQ(end.problem, "its time was over before a worker began");
  EXPECT_EQ(end_of(before).problem, "");
  EXPECT_EQ(worker->counts().ended(ReplyKind::kExpired), 1);
}

TEST_F(CloudServer, WhatWasCancelledIsNeverComputed) {
  RobotLink robot(robot_options(server_->url()));
  const Submitted submitted = submit(robot, {.value = 2});
  const Submitted kept = submit(robot, {.value = 3});
  submitted.cancel();
  EXPECT_EQ(end_of(submitted).problem, "cancelled");
  const auto worker = start_worker(server_->url());
  EXPECT_EQ(end_of(kept).problem, "");
  EXPECT_EQ(worker->counts().taken, 1);
}

TEST_F(CloudServer, TellsTwoRobotsOfOneNameApart) {
  const auto worker = start_worker(server_->url());
  RobotLink first(robot_options(server_->url())), second(robot_options(server_->url()));
  std::vector<Submitted> ends;
  for (int i = 0; i < 10; ++i) {
    for (RobotLink* robot : {&first, &second}) {
      const auto value = static_cast<std::uint8_t>(i + (robot == &first ? 0 : 100));
      ends.push_back(submit(*robot, {.value = value}));
    }
  }
  for (int i = 0; i < 20; ++i) {
    const ReplyMessage end = end_of(ends[static_cast<std::size_t>(i)]);
    ASSERT_EQ(end.problem, "");
    const auto value = static_cast<std::uint8_t>(i / 2 + (i % 2 == 0 ? 0 : 100));
    EXPECT_EQ(check_outputs(small_, {.value = value}, end), "");
  }
}

TEST_F(CloudServer, ServesARobotThatIsStartedAgain) {
  const auto worker = start_worker(server_->url());
  for (int i = 0; i < 3; ++i) {
    RobotLink robot(robot_options(server_->url()));
    static_cast<void>(submit(robot, {.tens_of_ms = 30, .value = 1}));
    EXPECT_EQ(end_of(submit(robot, {.value = 2})).problem, "");
    static_cast<void>(submit(robot, {.tens_of_ms = 30, .value = 1}));
  }
}

// Wherever it was, its worker is free again, and it goes on under its name.
TEST_F(CloudServer, FreesWhatAKilledRobotHeldAndServesItWhenItIsStartedAgain) {
  set_up_robot("other");
  const auto worker = start_worker(server_->url(), 2);
  const auto running = [&] {
    const WorkerCounts counts = worker->counts();
    return counts.taken - counts.cancelled -
           std::accumulate(counts.ended_as.begin(), counts.ended_as.end(), std::int64_t{0});
  };
  std::mt19937 random(4);
  const int kills = pirt::test::repeats(10, 60);
  for (int i = 0; i < kills; ++i) {
    const std::int64_t before = worker->counts().ended(ReplyKind::kDone);
    pid_t robot = start_robot_process(server_->url());
    // From its first message on; mostly once it is served.
    if (i % 4 != 0) {
      ASSERT_TRUE(eventually([&] { return worker->counts().ended(ReplyKind::kDone) > before; }));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(random() % 300));
    end_process(robot);
  }
  EXPECT_TRUE(eventually([&] { return running() == 0; })) << "calls end, claims run out";
  // Both slots are another's, and what it has left on its stream is no end of its room.
  const auto device = open_unit(server_->url(), "robot: other"), again = open_unit(server_->url());
  for (Device* each : {device.get(), again.get()}) {
    const auto kernel = each->prepare(large_, {});
    EXPECT_EQ(call_and_check(*kernel, large_, {.value = 7}), "");
  }
  EXPECT_EQ(worker->counts().ended(ReplyKind::kFailedTry), 0);
}

// With what lies on the stream that they share.
TEST_F(CloudServer, TellsLargeCallsOfTwoRobotsOfOneNameApart) {
  const auto worker = start_worker(server_->url(), 2);
  std::vector<std::jthread> robots;
  for (const std::uint8_t parameter : {std::uint8_t{3}, std::uint8_t{4}}) {
    robots.emplace_back([this, parameter] {
      const auto device = open_unit(server_->url());
      const auto large = device->prepare(large_, {});
      const auto weighed = device->prepare(weighed_, parameters_of(weighed_, parameter));
      for (std::uint8_t i = 0; i < 4; ++i) {
        const auto value = static_cast<std::uint8_t>(20 * parameter + i);
        EXPECT_EQ(call_and_check(*large, large_, {.value = value}), "");
        EXPECT_EQ(call_and_check(*weighed, weighed_, {.value = value}, parameter), "");
      }
    });
  }
}

// The first of two workers is stopped with the task; the second one answers.
TEST_F(CloudServer, AsksASecondWorkerWhereTheFirstIsSlow) {
  RobotOptions options = robot_options(server_->url());
  options.limits.hedge_after = 100ms;
  RobotLink robot(options);
  pid_t slow = start_worker_process(server_->url(), 1);
  ASSERT_TRUE(robot.wait_until_up(kLong)) << robot.why_down();
  const Submitted submitted = submit(robot, {.tens_of_ms = 20, .value = 2});
  ASSERT_TRUE(submitted.is_taken(kLong));
  ::kill(slow, SIGSTOP);
  const auto fast = start_worker(server_->url());
  const ReplyMessage end = end_of(submitted);
  EXPECT_EQ(end.problem, "");
  EXPECT_EQ(end.worker, "w1");
  EXPECT_EQ(robot.ask(&Caller::counts).hedged, 1);
  end_process(slow);
}

TEST_F(CloudServer, DropsAndCountsWhatIsNoMessage) {
  const auto worker = start_worker(server_->url());
  ReachedRobot robot(server_->url());
  Connection other({.server = server_->url()}, {});
  ASSERT_TRUE(other.wait_until_up(kLong));
  std::mt19937 random(1);
  const Bytes right = encode(ReplyMessage{.task = {1, 2}, .worker = "w"});
  for (int i = 0; i < 100; ++i) {
    Bytes bytes = right;
    bytes.resize(random() % (bytes.size() + 1));
    for (std::byte& each : bytes) each = static_cast<std::byte>(random());
    for (const char* to : {"pirt.offer.robot", "pirt.cancel.robot", "pirt.claim.robot",
                           "pirt.answer.robot", "pirt.hello"}) {
      other.publish(to, bytes);
    }
  }
  EXPECT_EQ(end_of(submit(robot, {.value = 1})).problem, "");
  EXPECT_TRUE(eventually([&] { return worker->counts().malformed >= 200; }));
  EXPECT_EQ(worker->counts().ended(ReplyKind::kDone), 1);
}

TEST_F(CloudServer, NamesAPeerOfAnotherProtocol) {
  const auto worker = start_worker(server_->url());
  RobotLink robot(robot_options(server_->url()));
  Connection other({.server = server_->url()}, {});
  ASSERT_TRUE(other.wait_until_up(kLong));
  Bytes offer = encode(OfferMessage{1, 1});
  offer[4] = std::byte{1};
  const std::string why = "protocol 1, and this pirt speaks 2: give robots and workers the same";
  EXPECT_TRUE(eventually([&] {
    other.publish("pirt.offer.old", offer);
    return worker->connection().problem().find("robot old: " + why) != std::string::npos;
  })) << worker->connection().problem();
}

/// What an administrator gave too little of is named, with the remedy.
class CloudLimits : public ::testing::Test {
 protected:
  void SetUp() override {
    if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
  }
  static std::string why_down(NatsServer& server, const std::string& part) {
    EXPECT_TRUE(server.start()) << server.log();
    RobotLink robot(robot_options(server.url()));
    static_cast<void>(eventually([&] { return robot.why_down().find(part) != std::string::npos; }));
    return robot.why_down();
  }
};

TEST_F(CloudLimits, OfTheServerAreNamedWithTheirRemedies) {
  NatsServer full("max_connections: 1\n");
  ASSERT_TRUE(full.start()) << full.log();
  Connection only({.server = full.url()}, {});
  ASSERT_TRUE(only.wait_until_up(kLong));
  RobotLink robot(robot_options(full.url()));
  EXPECT_TRUE(eventually([&] {
    return robot.why_down().find("raise max_connections there") != std::string::npos;
  })) << robot.why_down();

  NatsServer small("max_payload: 4096\n");
  EXPECT_THAT(why_down(small, "max_payload"),
              HasSubstr("max_payload of the server is 4096 bytes; give it 65536 or more"));
  NatsServer none("", false);
  EXPECT_THAT(why_down(none, "JetStream"),
              HasSubstr("the server has no JetStream; start it with -js"));
  NatsServer account("accounts: { A: { users: [ {user: u, password: p} ] } }\nno_auth_user: u\n");
  EXPECT_THAT(why_down(account, "JetStream"), HasSubstr("enable it there (accounts: { NAME"));
}

// Each within its time, and none is told to start a server that is there.
TEST_F(CloudLimits, OfWhoIsLetInAreNamedWithTheirRemedies) {
  NatsServer server("authorization { user: u, password: p }\n");
  ASSERT_TRUE(server.start()) << server.log();
  const auto why = [](const std::string& url) {
    Connection connection({.server = url}, {});
    EXPECT_TRUE(eventually([&] { return !connection.why_down().starts_with("start one"); }));
    return connection.why_down();
  };
  const std::string at = "127.0.0.1:" + std::to_string(server.port());
  EXPECT_THAT(why("nats://u:wrong@" + at), HasSubstr("check its password, NKey or certificate"));
  EXPECT_THAT(why("nats://" + at), HasSubstr("check its password, NKey or certificate"));
  EXPECT_THAT(why("tls://" + at), HasSubstr("it speaks no TLS; ask for nats://"));
  EXPECT_THAT(why("tls://nowhere.invalid:4222"), HasSubstr("or name another"));
  ::kill(server.process(), SIGSTOP);
  ::waitpid(server.process(), nullptr, WUNTRACED);  // Until all of its threads have stopped.
  EXPECT_THAT(why("nats://u:p@" + at), HasSubstr("it does not answer; is it stopped"));
  ::kill(server.process(), SIGCONT);
}

TEST_F(CloudLimits, OfTheStoreAreNamedWithTheirRemedies) {
  NatsServer server("", true, "max_file_store: 20MB\nmax_memory_store: 1MB\n");
  ASSERT_TRUE(server.start()) << server.log();
  const std::string why = error_of([&] { administer({.server = server.url()}, {}); });
  EXPECT_THAT(why, HasSubstr("max_file_store")) << "512 MB of 20";
  EXPECT_THAT(why, HasSubstr("pirt cloud-admin setup --robot-mb"));
  administer({.server = server.url()}, {.robot_bytes = 4 << 20});
  const Workload weighed = adding("weighed", 100, 5'000'000);
  const std::vector<const Workload*> known = {&weighed};
  const WorkerLink worker(worker_options(server.url()), known);
  const auto device = open_unit(server.url());
  const auto kernel = device->prepare(weighed, parameters_of(weighed, 1));
  EXPECT_THAT(call_and_check(*kernel, weighed, {}, 1),
              HasSubstr("robot robot may have 4 MB on the server"));
}

// 64 KiB is the least: what is larger goes in smaller chunks.
TEST_F(CloudLimits, AServerOfSmallMessagesServes) {
  NatsServer server("max_payload: 65536\n");
  ASSERT_TRUE(server.start()) << server.log();
  administer({.server = server.url()}, {});
  const Workload large = adding("large", 1'000'000);
  const std::vector<const Workload*> known = {&large};
  const WorkerLink worker(worker_options(server.url()), known);
  const auto device = open_unit(server.url());
  EXPECT_EQ(call_and_check(*device->prepare(large, {}), large, {.value = 1}), "");
  // Without patience what is there serves all the same.
  const auto hasty = open_unit(server.url(), "", 0);
  EXPECT_EQ(call_and_check(*hasty->prepare(large, {}), large, {.value = 2}), "");
}

// A server that comes meanwhile takes larger ones.
TEST_F(CloudLimits, WhatIsMissingIsPutInTheChunksThatItsMessageNames) {
  NatsServer server("max_payload: $PIRT_TEST_PAYLOAD\n");
  ASSERT_TRUE(server.start({"PIRT_TEST_PAYLOAD=65536"})) << server.log();
  std::atomic<bool> waits = false;
  Connection admin({.server = server.url()}, {});
  ASSERT_TRUE(admin.wait_until_up(kLong));
  set_up(admin, {});
  admin.subscribe("pirt.offer.robot", [&](const Incoming&) { waits = true; });
  const Workload weighed = adding("weighed", 100, 1'500'000);
  const std::vector<const Workload*> known = {&weighed};
  auto worker = std::make_unique<WorkerLink>(worker_options(server.url()), known);
  const auto device = open_unit(server.url());
  const auto kernel = device->prepare(weighed, parameters_of(weighed, 5));
  worker.reset();  // Nobody claims what is submitted.
  std::string problem = "no end";
  std::jthread call([&] { problem = call_and_check(*kernel, weighed, {.value = 3}, 5); });
  ASSERT_TRUE(eventually([&] { return waits.load(); }));
  server.kill();
  ASSERT_TRUE(server.start({"PIRT_TEST_PAYLOAD=1048576"})) << server.log();
  worker = std::make_unique<WorkerLink>(worker_options(server.url()), known);
  call.join();
  EXPECT_EQ(problem, "");
  EXPECT_EQ(worker->counts().ended(ReplyKind::kMissing), 1);
}

}  // namespace
}  // namespace pirt::cloud::test
