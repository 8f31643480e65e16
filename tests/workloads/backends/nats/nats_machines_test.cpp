// The caller's and the worker's state machines: exact sequences, and what holds whatever fails.
#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "nats_simulation.h"
#include "tests/support/long.h"

namespace pirt::cloud {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::Simulation;
using test::SimulationOptions;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr TaskId kTask{1, 1};
constexpr std::uint64_t kWorker = 7, kOther = 8;

/// Writes down what is to be done.
class CloudCaller : public ::testing::Test {
 protected:
  Caller make_caller(const CallerLimits& limits) {
    return Caller("r", 1, limits,
                  [this](const std::string& to, const Bytes& message) { hears(to, message); });
  }
  void hears(const std::string& to, const Bytes& message) {
    const std::string last = to.substr(to.rfind('.') + 1);
    if (is_frame_of<TaskMessage>(message)) {
      last_ = decode_as<TaskMessage>(message);
      says(fmt::format("give {} to {}, send {}", last_.task.number, last, last_.send));
    } else if (is_frame_of<OfferMessage>(message)) {
      const auto offer = decode_as<OfferMessage>(message);
      says(last == "r" ? fmt::format("offer {}", offer.waiting) : "nothing for " + last);
    } else {
      says("withdraw");
    }
  }
  void says(std::string what) { said_.push_back(std::move(what)); }
  /// Since it was asked last, and then what became of the task.
  std::vector<std::string> said() {
    if (std::exchange(progress_->missing, false)) says("missing");
    if (progress_->end) {
      problem_ = progress_->end->problem;
      progress_->end.reset();
      says(problem_.empty() ? "done" : problem_.substr(0, problem_.find(" after ")));
    }
    return std::exchange(said_, {});
  }
  void connect(Nanos now = Nanos(0)) {
    caller_.link_up(now);
    caller_.heard({.instance = kWorker}, now);
    said();
  }
  void submit(Nanos now = Nanos(0), std::optional<Nanos> time_left = {}) {
    progress_ = caller_.submit({.task = kTask, .time_left = time_left}, now);
  }
  /// To the worker that is there.
  void submit_and_give() {
    connect();
    submit();
    caller_.claimed({1, kWorker}, Nanos(0));
  }
  void reply(ReplyKind kind, std::uint32_t send, Nanos now) {
    caller_.replied({.task = kTask, .send = send, .kind = kind, .worker = "w", .problem = "boom"},
                    now);
  }
  /// Claimed by the worker as soon as it may be: the wait before that is random.
  Nanos claim_again(std::uint64_t worker, Nanos now) {
    while (last_.send == send_ && now < seconds(3600)) {
      now = std::max(now, caller_.next_wake());
      caller_.wake(now);
      if (!said_.empty() && said_.back().starts_with("offer")) caller_.claimed({1, worker}, now);
    }
    send_ = last_.send;
    return now;
  }

  std::vector<std::string> said_;
  std::shared_ptr<Progress> progress_ = std::make_shared<Progress>();
  std::string problem_;
  TaskMessage last_;
  std::uint32_t send_ = 0;
  CallerLimits limits_;
  Caller caller_ = make_caller({});
};

TEST_F(CloudCaller, GivesATaskToWhoClaimsIt) {
  connect();
  submit();
  EXPECT_THAT(said(), ElementsAre("offer 1"));
  caller_.claimed({1, kWorker}, milliseconds(1));
  EXPECT_THAT(said(), ElementsAre("give 1 to 7, send 1"));
  caller_.claimed({1, kOther}, milliseconds(2));
  EXPECT_THAT(said(), ElementsAre("nothing for 8"));
  reply(ReplyKind::kRunning, 1, milliseconds(3));
  reply(ReplyKind::kDone, 1, seconds(1));
  EXPECT_THAT(said(), ElementsAre("done"));
  EXPECT_EQ(caller_.next_wake(), Nanos::max());
}

TEST_F(CloudCaller, TellsAnEndOnceHoweverOftenTheReplyComes) {
  submit_and_give();
  reply(ReplyKind::kDone, 1, seconds(1));
  said();
  reply(ReplyKind::kDone, 1, seconds(2));
  EXPECT_THAT(said(), IsEmpty());
  EXPECT_EQ(caller_.estimate().late_replies, 1);
}

TEST_F(CloudCaller, OffersAgainWhileATaskWaits) {
  connect();
  submit();
  said();
  EXPECT_EQ(caller_.next_wake(), seconds(1));
  caller_.wake(seconds(1));
  EXPECT_THAT(said(), ElementsAre("offer 1"));
  caller_.heard({.instance = kOther}, milliseconds(1500));
  EXPECT_THAT(said(), ElementsAre("offer 1")) << "it has not heard of it";
}

TEST_F(CloudCaller, TakesATaskBackThatNobodyConfirmedAndCountsNoTry) {
  submit_and_give();
  said();
  EXPECT_EQ(caller_.next_wake(), seconds(3));
  caller_.wake(seconds(3));
  EXPECT_THAT(said(), IsEmpty()) << "a little later, at random";
  const Nanos next = caller_.next_wake();
  EXPECT_GE(next, seconds(3) + limits_.again);
  EXPECT_LE(next, seconds(3) + 2 * limits_.again);
  caller_.wake(next);
  EXPECT_THAT(said(), ElementsAre("offer 1"));
}

TEST_F(CloudCaller, GivesATaskUpAfterThreeFailedTriesAndSaysWhoseAndWhy) {
  submit_and_give();
  send_ = 1;
  Nanos now{0};
  for (std::uint32_t send = 1; send <= 3; ++send) {
    reply(ReplyKind::kFailedTry, send, now);
    reply(ReplyKind::kFailedTry, send, now);  // Twice is once.
    if (send < 3) now = claim_again(kWorker, now);
  }
  EXPECT_EQ(said().back(), "given up");
  EXPECT_EQ(problem_, "given up after 3 tries; the last one failed on worker w: boom");
}

TEST_F(CloudCaller, ACallThatItsFunctionSaysFailedIsOver) {
  submit_and_give();
  said();
  reply(ReplyKind::kCallFailed, 1, seconds(1));
  EXPECT_EQ(progress_->end->kind, ReplyKind::kCallFailed);
  EXPECT_THAT(said(), ElementsAre("worker w: boom"));
}

TEST_F(CloudCaller, WhatAWorkerRefusesGoesToAnotherThatKnowsIt) {
  caller_.link_up(Nanos(0));
  for (const std::uint64_t each : {kWorker, kOther}) {
    caller_.heard({.instance = each, .workloads = {{"small", {}}}}, Nanos(0));
  }
  progress_ = caller_.submit({.task = kTask, .kind = {.name = "small"}}, Nanos(0));
  caller_.claimed({1, kWorker}, Nanos(0));
  EXPECT_THAT(said(), ElementsAre("offer 1", "give 1 to 7, send 1"));
  reply(ReplyKind::kRefused, 1, seconds(1));
  EXPECT_THAT(said(), ElementsAre("offer 1"));
  caller_.claimed({1, kWorker}, seconds(1));
  EXPECT_THAT(said(), ElementsAre("nothing for 7"));
  caller_.claimed({1, kOther}, seconds(1));
  EXPECT_THAT(said(), ElementsAre("give 1 to 8, send 2"));
  reply(ReplyKind::kRefused, 2, seconds(2));
  EXPECT_THAT(said(), ElementsAre("refused by worker w: boom")) << "nobody else knows it";
}

TEST_F(CloudCaller, WaitingForParametersOrRoomIsNoTryButEnds) {
  submit_and_give();
  reply(ReplyKind::kMissing, 1, Nanos(0));
  EXPECT_EQ(said().back(), "missing");
  EXPECT_EQ(caller_.next_wake(), Nanos::max()) << "until they are there";
  caller_.ready(kTask, seconds(1));
  EXPECT_THAT(said(), ElementsAre("offer 1"));
  caller_.claimed({1, kWorker}, seconds(1));
  send_ = 2;
  Nanos now = seconds(1);
  for (std::uint32_t send = 2; send < limits_.most_sends; ++send) {
    reply(ReplyKind::kLater, send, now);
    now = claim_again(kWorker, now);
  }
  EXPECT_FALSE(progress_->end) << "no try";
  reply(ReplyKind::kLater, limits_.most_sends, now);
  EXPECT_EQ(said().back(), "given up");
  EXPECT_EQ(problem_, "given up after it was sent 20 times; the last time worker w: boom");
}

TEST_F(CloudCaller, AWorkerThatDiesWithATaskIsATryAndALostReplyIsNone) {
  submit_and_give();
  Nanos now{0};
  for (int death = 1; death <= 3; ++death) {
    reply(ReplyKind::kRunning, last_.send, now);
    send_ = last_.send;
    now += limits_.silence;
    caller_.wake(now);
    if (death < 3) now = claim_again(kWorker, now);
  }
  EXPECT_EQ(said().back(), "given up");
  EXPECT_EQ(problem_.find("given up after 3 tries"), 0U) << problem_;

  submit(now);
  last_ = {}, send_ = 0;
  caller_.claimed({1, kWorker}, now);
  for (int i = 0; i < 5; ++i) {
    reply(ReplyKind::kRunning, last_.send, now);
    send_ = last_.send;
    now += limits_.silence;
    caller_.heard({.instance = kWorker}, now);
    caller_.wake(now);
    now = claim_again(kWorker, now);
  }
  EXPECT_FALSE(progress_->end);
}

TEST_F(CloudCaller, AWorkerThatSaysThatItComputesHasAsLongAsItTakes) {
  submit_and_give();
  said();
  for (int s = 1; s < 3600; ++s) {
    reply(ReplyKind::kRunning, 1, seconds(s));
    if (caller_.next_wake() <= seconds(s)) caller_.wake(seconds(s));
  }
  EXPECT_THAT(said(), IsEmpty());
}

TEST_F(CloudCaller, LostLinksAreNoTries) {
  submit_and_give();
  reply(ReplyKind::kRunning, 1, Nanos(0));
  for (int i = 1; i <= 10; ++i) {
    caller_.link_down();
    EXPECT_EQ(caller_.next_wake(), Nanos::max());
    caller_.link_up(seconds(100 * i));
    caller_.heard({.instance = kWorker}, seconds(100 * i));
  }
  said();
  reply(ReplyKind::kDone, 1, seconds(1001));
  EXPECT_THAT(said(), ElementsAre("done"));
}

TEST_F(CloudCaller, AsksAgainSoonWhereAnAnswerWasLostWithTheLink) {
  submit_and_give();
  reply(ReplyKind::kRunning, 1, Nanos(0));
  caller_.link_down();
  caller_.link_up(seconds(5));
  EXPECT_EQ(caller_.next_wake(), seconds(15)) << "its worker may not be back";
  caller_.heard({.instance = kWorker}, seconds(6));
  EXPECT_EQ(caller_.next_wake(), seconds(9)) << "it would say that it has it";
  said();
  send_ = 1;
  claim_again(kOther, seconds(9));
  EXPECT_EQ(said().back(), "give 1 to 8, send 2");
  for (int i = 0; i < 2; ++i) reply(ReplyKind::kFailedTry, 2, seconds(20));
  EXPECT_FALSE(progress_->end) << "that was no try";
}

// Ctrl-Z, docker pause: what its worker says meanwhile is not yet read.
TEST_F(CloudCaller, NoWorkerFallsSilentWhileTheRobotIsStopped) {
  submit_and_give();
  reply(ReplyKind::kRunning, 1, Nanos(0));
  said();
  caller_.wake(seconds(60));
  EXPECT_THAT(said(), IsEmpty());
  EXPECT_EQ(caller_.next_wake(), seconds(60) + limits_.silence);
  // Also where the wait was nearly over when it was stopped.
  caller_.wake(seconds(60) + limits_.silence + milliseconds(600));
  EXPECT_THAT(said(), IsEmpty());
  EXPECT_EQ(caller_.next_wake(), seconds(60) + 2 * limits_.silence + milliseconds(600));
}

TEST_F(CloudCaller, SaysATimeOfATaskWhateverItIs) {
  connect();
  submit(Nanos(0), Nanos::max());
  caller_.claimed({1, kWorker}, milliseconds(100));
  EXPECT_EQ(last_.time_left, kLongest);
}

TEST_F(CloudCaller, SaysWhatRemainsOfATasksTime) {
  connect();
  submit(Nanos(0), milliseconds(300));
  caller_.claimed({1, kWorker}, milliseconds(100));
  EXPECT_EQ(last_.time_left, milliseconds(200));
  reply(ReplyKind::kExpired, 1, milliseconds(300));
  EXPECT_EQ(said().back(), "its time was over before a worker began");
}

TEST_F(CloudCaller, WithdrawsWhatIsCancelled) {
  submit_and_give();
  said();
  caller_.cancel(kTask);
  EXPECT_THAT(said(), ElementsAre("withdraw", "cancelled"));
  reply(ReplyKind::kDone, 1, seconds(1));
  EXPECT_THAT(said(), IsEmpty());
  EXPECT_EQ(caller_.estimate().late_replies, 1);
}

TEST_F(CloudCaller, IsDownWithoutALinkAndWithoutAWorker) {
  EXPECT_FALSE(caller_.is_up(Nanos(0)));
  caller_.link_up(Nanos(0));
  EXPECT_FALSE(caller_.is_up(Nanos(0))) << "nobody computes";
  caller_.heard({.instance = kWorker}, seconds(1));
  EXPECT_TRUE(caller_.is_up(seconds(10)));
  EXPECT_FALSE(caller_.is_up(seconds(11)));
  caller_.heard({.instance = kWorker}, seconds(12));
  EXPECT_TRUE(caller_.is_up(seconds(12)));
  caller_.link_down();
  EXPECT_FALSE(caller_.is_up(seconds(12)));
}

class CloudHedges : public CloudCaller {
 protected:
  Caller hedging_ = make_caller({.hedge_after = milliseconds(20)});
};

TEST_F(CloudHedges, AskASecondWorkerAndCancelTheLoser) {
  hedging_.link_up(Nanos(0));
  hedging_.heard({.instance = kWorker}, Nanos(0));
  hedging_.heard({.instance = kOther}, Nanos(0));
  progress_ = hedging_.submit({.task = kTask}, Nanos(0));
  hedging_.claimed({1, kWorker}, Nanos(0));
  said();
  EXPECT_EQ(hedging_.next_wake(), milliseconds(20));
  hedging_.wake(milliseconds(20));
  EXPECT_THAT(said(), ElementsAre("offer 1"));
  hedging_.claimed({1, kWorker}, milliseconds(21));
  EXPECT_THAT(said(), ElementsAre("nothing for 7")) << "it has it already";
  hedging_.claimed({1, kOther}, milliseconds(22));
  EXPECT_THAT(said(), ElementsAre("give 1 to 8, send 2"));
  hedging_.replied({.task = kTask, .send = 2, .worker = "x"}, milliseconds(30));
  EXPECT_THAT(said(), ElementsAre("withdraw", "done"));
  EXPECT_EQ(hedging_.counts().hedged, 1);
}

TEST_F(CloudHedges, ARefusalIsNoEndWhileAnotherComputes) {
  hedging_.link_up(Nanos(0));
  hedging_.heard({.instance = kWorker}, Nanos(0));
  progress_ = hedging_.submit({.task = kTask}, Nanos(0));
  hedging_.claimed({1, kWorker}, Nanos(0));
  hedging_.wake(milliseconds(20));
  hedging_.claimed({1, kOther}, milliseconds(21));
  said();
  hedging_.replied({.task = kTask, .send = 2, .kind = ReplyKind::kRefused, .worker = "x"},
                   milliseconds(22));
  EXPECT_THAT(said(), IsEmpty());
  hedging_.replied({.task = kTask, .send = 1, .worker = "w"}, milliseconds(30));
  EXPECT_THAT(said(), ElementsAre("done"));
}

// What a worker misses may take longer to send than the second one is waited for.
TEST_F(CloudHedges, AskNobodyWhileWhatIsMissingIsSent) {
  hedging_.link_up(Nanos(0));
  hedging_.heard({.instance = kWorker}, Nanos(0));
  progress_ = hedging_.submit({.task = kTask}, Nanos(0));
  hedging_.claimed({1, kWorker}, Nanos(0));
  hedging_.replied({.task = kTask, .send = 1, .kind = ReplyKind::kMissing, .worker = "w"},
                   milliseconds(5));
  EXPECT_EQ(said().back(), "missing");
  hedging_.wake(milliseconds(20));
  EXPECT_THAT(said(), IsEmpty());
  hedging_.ready(kTask, seconds(1));
  hedging_.claimed({1, kWorker}, seconds(1));
  EXPECT_THAT(said(), ElementsAre("offer 1", "give 1 to 7, send 2"));
  hedging_.ready(kTask, seconds(2));
  EXPECT_THAT(said(), IsEmpty()) << "a worker has it";
}

// Calls that were hedged are as long as they were: without them the 95th of 100 falls and falls.
TEST_F(CloudHedges, AfterTheP95StayFew) {
  Caller caller = make_caller({.hedge_p95 = true});
  caller.link_up(Nanos(0));
  std::minstd_rand random(1);
  const auto takes = [&] { return milliseconds(1 + random() % 100); };
  Nanos now{0};
  for (std::uint64_t i = 1; i <= 3000; ++i) {
    const TaskId task{1, i};
    caller.submit({.task = task}, now);
    caller.claimed({1, kWorker}, now);
    Nanos done = now + takes();
    std::uint32_t send = 1;
    if (const Nanos wake = caller.next_wake(); wake < done) {
      caller.wake(wake);
      caller.claimed({1, kOther}, wake);
      const Nanos second = wake + takes();
      if (second < done) done = second, send = 2;
    }
    caller.replied({.task = task, .send = send, .worker = "w"}, done);
    now = done + milliseconds(1);
  }
  EXPECT_GE(caller.counts().hedged, 60);
  EXPECT_LE(caller.counts().hedged, 300);
}

class CloudDesk : public ::testing::Test {
 protected:
  /// Whom it asks, "" = nobody.
  std::string claims(Nanos now) {
    const auto claim = desk_.claim(now);
    return claim ? claim->robot : "";
  }
  /// A call of whoever is asked now.
  Desk::Claim serve(const std::function<Nanos(const std::string& robot)>& takes,
                    const std::string& fails = "nobody", Nanos until_given = Nanos(0)) {
    Desk::Claim claim = desk_.claim(now_).value();
    now_ += until_given;
    EXPECT_TRUE(desk_.take(claim.robot, claim.run, 100, now_));
    const Nanos time = takes(claim.robot);
    now_ += time;
    desk_.finished(claim.robot, time, claim.robot == fails, now_);
    return claim;
  }
  static Nanos tenth(const std::string&) { return milliseconds(100); }

  Desk desk_{DeskLimits{.slots = 1}};
  Nanos now_{0};
};

TEST_F(CloudDesk, AsksForAsManyTasksAsSlotsAreFree) {
  EXPECT_EQ(claims(Nanos(0)), "") << "nobody has one";
  desk_.offered("a", 1, 5, Nanos(0));
  EXPECT_EQ(claims(Nanos(0)), "a");
  EXPECT_EQ(claims(Nanos(0)), "");
  EXPECT_TRUE(desk_.take("a", 1, 4, Nanos(0)));
  EXPECT_EQ(claims(Nanos(0)), "");
  EXPECT_FALSE(desk_.expects("b"));
  EXPECT_FALSE(desk_.take("b", 1, 0, Nanos(0))) << "nobody asked";
  desk_.finished("a", seconds(1), false, seconds(1));
  EXPECT_EQ(claims(seconds(1)), "a");
}

TEST_F(CloudDesk, GivesEachRobotItsShareOfTheTime) {
  std::map<std::string, Nanos> used;
  // The greedy one's calls take ten times as long.
  const auto takes = [&](const std::string& robot) {
    const Nanos time = milliseconds(robot == "greedy" ? 100 : 10);
    used[robot] += time;
    return time;
  };
  for (int i = 0; i < 400; ++i) {
    for (const char* robot : {"b", "c", "d"}) desk_.offered(robot, 1, 2, now_);
    desk_.offered("greedy", 1, 1'000'000, now_);
    serve(takes);
  }
  for (const char* robot : {"b", "c", "d"}) {
    EXPECT_NEAR(to_ms(used[robot]), to_ms(used["greedy"]), 101) << robot;
  }
}

TEST_F(CloudDesk, NobodySavesUpTime) {
  desk_.offered("a", 1, 100, now_);
  for (int i = 0; i < 100; ++i) serve(tenth);
  desk_.offered("late", 1, 100, now_);
  std::map<std::string, int> served;
  for (int i = 0; i < 10; ++i) ++served[serve(tenth).robot];
  EXPECT_NEAR(served["a"], 5, 1);
}

TEST_F(CloudDesk, ACallThatEndsItsProcessCostsItsRobotTenTimes) {
  std::map<std::string, int> served;
  for (int i = 0; i < 110; ++i) {
    for (const char* robot : {"bad", "good"}) desk_.offered(robot, 1, 9, now_);
    ++served[serve(tenth, "bad").robot];
  }
  EXPECT_NEAR(served["bad"], 10, 1);
}

// Tasks that are refused at once take no time, and their claims do.
TEST_F(CloudDesk, AClaimThatIsAnsweredIsItsRobotsTime) {
  std::map<std::string, Nanos> held;
  const auto takes = [](const std::string& robot) {
    return milliseconds(robot == "honest" ? 10 : 0);
  };
  for (int i = 0; i < 400; ++i) {
    for (const char* robot : {"quick", "honest"}) desk_.offered(robot, 1, 9, now_);
    const Nanos begin = now_;
    const std::string robot = serve(takes, "nobody", milliseconds(1)).robot;
    held[robot] += now_ - begin;
  }
  EXPECT_NEAR(to_ms(held["quick"]), to_ms(held["honest"]), 15);
}

TEST_F(CloudDesk, ATaskThatNobodyAskedForTakesNoFreeSlot) {
  desk_.offered("a", 1, 1, Nanos(0));
  EXPECT_FALSE(desk_.expects("a"));
  EXPECT_FALSE(desk_.take("a", 1, 1, Nanos(0)));
  EXPECT_EQ(claims(Nanos(0)), "a");
  EXPECT_TRUE(desk_.expects("a"));
  EXPECT_FALSE(desk_.take("a", 2, 1, Nanos(0))) << "another run of its program";
  EXPECT_TRUE(desk_.take("a", 1, 1, Nanos(0)));
  EXPECT_FALSE(desk_.take("a", 1, 1, Nanos(0))) << "one was asked for";
}

TEST_F(CloudDesk, AClaimThatRunsOutIsItsRobotsTime) {
  desk_.offered("mute", 1, 9, Nanos(0));
  EXPECT_EQ(claims(Nanos(0)), "mute");
  desk_.offered("a", 1, 9, seconds(1));
  EXPECT_EQ(desk_.next_wake(), seconds(2));
  desk_.offered("mute", 1, 9, seconds(2));
  EXPECT_EQ(claims(seconds(2)), "a");
}

// Over a slow link it takes longer than a claim holds.
TEST_F(CloudDesk, ALateTaskIsTakenOnceWhereASlotIsFree) {
  desk_.offered("a", 1, 9, Nanos(0));
  EXPECT_EQ(claims(Nanos(0)), "a");
  desk_.offered("b", 1, 9, seconds(2));
  EXPECT_EQ(claims(seconds(2)), "b");
  EXPECT_FALSE(desk_.expects("a")) << "nor read";
  EXPECT_FALSE(desk_.take("a", 1, 0, seconds(3))) << "the slot is asked for";
  EXPECT_TRUE(desk_.take("b", 1, 0, seconds(3)));
  EXPECT_FALSE(desk_.expects("a")) << "it is b's";
  desk_.finished("b", seconds(1), false, seconds(4));
  EXPECT_TRUE(desk_.expects("a"));
  EXPECT_TRUE(desk_.take("a", 1, 0, seconds(4)));
  desk_.finished("a", seconds(1), false, seconds(5));
  EXPECT_FALSE(desk_.take("a", 1, 0, seconds(5))) << "once";
}

// As two robots that both have the default's name.
TEST_F(CloudDesk, AsksTheRunsOfARobotInTurns) {
  std::map<std::uint64_t, int> served;
  for (int i = 0; i < 10; ++i) {
    for (const std::uint64_t run : {1U, 2U}) desk_.offered("a", run, 100, now_);
    ++served[serve(tenth).run];
  }
  EXPECT_EQ(served[1], 5);
  EXPECT_EQ(served[2], 5);
}

TEST_F(CloudDesk, ATaskIsNoAnswerToAnotherClaim) {
  Desk desk(DeskLimits{.slots = 2});
  desk.offered("a", 1, 2, Nanos(0));
  EXPECT_TRUE(desk.claim(Nanos(0)));
  EXPECT_TRUE(desk.claim(Nanos(0)));
  EXPECT_TRUE(desk.take("a", 1, 0, milliseconds(1))) << "nothing more waits now,";
  EXPECT_TRUE(desk.take("a", 1, 0, milliseconds(2))) << "and something else is asked for";
}

TEST_F(CloudDesk, LeavesSlotsForOthersThatAreThere) {
  Desk desk(DeskLimits{.slots = 4});
  desk.offered("a", 1, 9, Nanos(0));
  desk.offered("b", 1, 0, Nanos(0));
  int claims = 0;
  while (desk.claim(Nanos(0))) ++claims;
  EXPECT_EQ(claims, 2) << "b was heard just now";
  while (desk.claim(seconds(6))) ++claims;
  EXPECT_EQ(claims, 2) << "a's offer is too old";
  desk.offered("a", 1, 9, seconds(6));
  while (desk.claim(seconds(6))) ++claims;
  EXPECT_EQ(claims, 6) << "those before ran out";
}

TEST_F(CloudDesk, HoldsLittleOfWhoeverSaysWhatever) {
  Desk desk(DeskLimits{.most_robots = 10, .most_runs = 2});
  for (std::uint64_t i = 0; i < 1000; ++i) {
    desk.offered("r" + std::to_string(i % 100), i, 1, Nanos(static_cast<std::int64_t>(i)));
  }
  const auto claim = desk.claim(Nanos(1000));
  ASSERT_TRUE(claim);
  EXPECT_GE(claim->run, 900U) << "the older ones are forgotten";
}

TEST_F(CloudDesk, RefusesWhoseCallsEndProcessesUntilTheyAreOld) {
  desk_.offered("a", 1, 100, Nanos(0));
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(desk_.why_refused("a", Nanos(0)), "");
    EXPECT_EQ(claims(Nanos(0)), "a");
    ASSERT_TRUE(desk_.take("a", 1, 1, Nanos(0)));
    desk_.finished("a", Nanos(1), true, Nanos(0));
  }
  EXPECT_EQ(desk_.why_refused("a", seconds(1)).find("robot a: 10 of its calls"), 0U);
  EXPECT_EQ(desk_.why_refused("b", seconds(1)), "");
  EXPECT_EQ(desk_.why_refused("a", seconds(60)), "");
}

void expect_nothing_lost(const test::SimulationResult& result) {
  EXPECT_EQ(result.never_ended, 0);
  EXPECT_EQ(result.ended_twice, 0);
  EXPECT_EQ(result.ended_wrongly, 0);
  EXPECT_EQ(result.over_slots, 0);
  EXPECT_EQ(result.left_at_workers, 0U);
  EXPECT_EQ(result.submitted, result.done + result.given_up + result.returned + result.withdrawn);
  EXPECT_GT(result.done, 0);
}

TEST(CloudInVirtualTime, LosesNothingAndDeliversOnceWhateverFails) {
  const auto seeds = static_cast<std::uint64_t>(pirt::test::repeats(5, 50));
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const auto result = Simulation({.seed = seed, .faults = 2000, .hedges = seed % 2 == 0}).run();
    expect_nothing_lost(result);
    // The faults reach what is there against them.
    EXPECT_GT(result.sent_again, 0);
    EXPECT_GT(result.late, 0);
    EXPECT_GT(result.given_up, 0);
    EXPECT_GT(result.returned, 0);
    EXPECT_GT(result.withdrawn, 0);
    EXPECT_EQ(result.hedged > 0, seed % 2 == 0);
    EXPECT_EQ(result.faults.size(), 5U);
  }
}

TEST(CloudInVirtualTime, GivesTheSameAnswersForTheSameSeed) {
  const SimulationOptions options{.seed = 3, .faults = 300};
  const auto a = Simulation(options).run(), b = Simulation(options).run();
  EXPECT_EQ(a.submitted, b.submitted);
  EXPECT_EQ(a.sent_again, b.sent_again);
  EXPECT_EQ(a.late, b.late);
}

}  // namespace
}  // namespace pirt::cloud
