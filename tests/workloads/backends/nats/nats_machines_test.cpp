// The caller's and the worker's state machines: exact sequences, and what holds whatever fails.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "nats_simulation.h"
#include "tests/support/long.h"
#include "workloads/backends/nats/worker/stream_age.h"

namespace pirt::cloud {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::Simulation;
using test::SimulationOptions;

const Bytes kBody{std::byte{7}, std::byte{8}};
constexpr TaskId kTask{1, 1};

template <typename T, typename Actions>
std::vector<T> of(const Actions& actions) {
  std::vector<T> found;
  for (const auto& action : actions) {
    if (const auto* each = std::get_if<T>(&action)) found.push_back(*each);
  }
  return found;
}

class CloudCaller : public ::testing::Test {
 protected:
  void connect() {
    caller_.link_up(Nanos(0), out_);
    caller_.worker_heard(Nanos(0), out_);
  }
  void submit(const std::string& key = "", std::optional<Nanos> give_back = {}) {
    ASSERT_EQ(caller_.submit(kTask, key, kBody, give_back, give_back, Nanos(0), out_),
              Caller::Submission::kTaken);
  }
  /// What was done since it was asked last.
  CallerActions actions() { return std::exchange(out_, {}); }
  void reply(ReplyKind kind, std::uint32_t send, Nanos now) {
    caller_.replied({.task = kTask, .send = send, .kind = kind, .worker = "w", .problem = "boom"},
                    now, out_);
  }

  std::unique_ptr<Outbox> outbox_ = make_memory_outbox(100);
  CallerActions out_;
  Caller caller_{*outbox_, CallerLimits{}, Nanos(0), out_};
};

TEST_F(CloudCaller, KeepsATaskUntilItsReplyIsThere) {
  connect();
  submit();
  const auto published = of<Publish>(actions());
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].send, 1U);
  EXPECT_EQ(outbox_->body(kTask), kBody);
  caller_.confirmed(kTask, 1, 42, seconds(1), out_);
  EXPECT_EQ(outbox_->all().size(), 1U);
  reply(ReplyKind::kDone, 1, seconds(2));
  const auto ends = of<TellEnd>(actions());
  ASSERT_EQ(ends.size(), 1U);
  EXPECT_EQ(ends[0].how, CallEndKind::kDone);
  EXPECT_TRUE(outbox_->all().empty());
  EXPECT_EQ(caller_.next_wake(), seconds(12)) << "only the worker's silence is left";
}

TEST_F(CloudCaller, TellsAnEndOnceHoweverOftenTheReplyComes) {
  connect();
  submit();
  reply(ReplyKind::kDone, 1, seconds(1));
  reply(ReplyKind::kDone, 1, seconds(2));
  EXPECT_EQ(of<TellEnd>(actions()).size(), 1U);
  EXPECT_EQ(caller_.counts().late, 1);
}

TEST_F(CloudCaller, SendsAnUnconfirmedTaskAgainUnderTheSameNumber) {
  connect();
  submit();
  actions();
  EXPECT_EQ(caller_.next_wake(), seconds(5));
  caller_.wake(seconds(5), out_);
  const auto published = of<Publish>(actions());
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].send, 1U) << "the server may have it: the same message id";
}

TEST_F(CloudCaller, SendsATaskThatNothingIsHeardOfUnderTheNextNumberAndWaitsLongerThen) {
  connect();
  submit();
  caller_.confirmed(kTask, 1, 42, seconds(0), out_);
  actions();
  // 60 s of silence; the worker's own announcements go on.
  caller_.worker_heard(seconds(59), out_);
  caller_.wake(seconds(60), out_);
  auto published = of<Publish>(actions());
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].send, 2U);
  caller_.confirmed(kTask, 2, 43, seconds(60), out_);
  caller_.worker_heard(seconds(179), out_);
  caller_.wake(seconds(179), out_);
  EXPECT_TRUE(of<Publish>(actions()).empty()) << "120 s from 60 s on";
  reply(ReplyKind::kRunning, 2, seconds(179));
  caller_.wake(seconds(298), out_);
  EXPECT_TRUE(of<Publish>(actions()).empty()) << "a worker computes it";
  caller_.wake(seconds(299), out_);
  published = of<Publish>(actions());
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].send, 3U);
}

TEST_F(CloudCaller, WaitsForTheLinkAsLongAsItTakes) {
  submit();
  EXPECT_TRUE(of<Publish>(actions()).empty());
  EXPECT_EQ(caller_.next_wake(), Nanos::max());
  EXPECT_EQ(caller_.availability(), Availability::kDown);
  caller_.link_up(std::chrono::hours(5), out_);
  EXPECT_EQ(of<Publish>(actions()).size(), 1U);
}

TEST_F(CloudCaller, GivesATaskUpAfterThreeFailedTriesAndSaysWhoseAndWhy) {
  connect();
  submit();
  for (std::uint32_t send = 1; send <= 3; ++send) {
    actions();
    reply(ReplyKind::kFailedTry, send, seconds(send));
    reply(ReplyKind::kFailedTry, send, seconds(send));  // Twice is once.
  }
  const auto ends = of<TellEnd>(actions());
  ASSERT_EQ(ends.size(), 1U);
  EXPECT_EQ(ends[0].how, CallEndKind::kGivenUp);
  EXPECT_EQ(ends[0].problem, "given up after 3 tries; the last one failed on worker w: boom");
  EXPECT_TRUE(outbox_->all().empty());
}

TEST_F(CloudCaller, LostLinksAndServersAreNoTries) {
  connect();
  submit();
  for (int i = 1; i <= 10; ++i) {
    caller_.link_down(seconds(i), out_);
    caller_.link_up(seconds(i), out_);
  }
  EXPECT_EQ(caller_.counts().given_up, 0);
  reply(ReplyKind::kDone, 1, seconds(11));
  EXPECT_EQ(of<TellEnd>(actions()).size(), 1U);
}

TEST_F(CloudCaller, GivesATaskBackAtItsLatestMomentAndWithdrawsIt) {
  connect();
  submit("", milliseconds(300));
  caller_.confirmed(kTask, 1, 42, milliseconds(1), out_);
  actions();
  EXPECT_EQ(caller_.next_wake(), milliseconds(300));
  caller_.wake(milliseconds(300), out_);
  const auto done = actions();
  ASSERT_EQ(of<TellEnd>(done).size(), 1U);
  EXPECT_EQ(of<TellEnd>(done)[0].how, CallEndKind::kReturned);
  ASSERT_EQ(of<Withdraw>(done).size(), 1U);
  EXPECT_EQ(of<Withdraw>(done)[0].sequence, 42U);
  reply(ReplyKind::kDone, 1, seconds(1));
  EXPECT_TRUE(of<TellEnd>(actions()).empty());
  EXPECT_EQ(caller_.counts().late, 1);
}

TEST_F(CloudCaller, WithdrawsWhatWasCancelledBeforeTheServerConfirmedIt) {
  connect();
  submit();
  caller_.cancel(kTask, milliseconds(1), out_);
  actions();
  caller_.confirmed(kTask, 1, 42, milliseconds(2), out_);
  const auto withdrawn = of<Withdraw>(actions());
  ASSERT_EQ(withdrawn.size(), 1U);
  EXPECT_EQ(withdrawn[0].sequence, 42U);
}

TEST_F(CloudCaller, DrainsWhileTheOutboxIsFullAndCountsWhatItTurnsAway) {
  connect();
  actions();
  const Bytes large(60);
  EXPECT_EQ(caller_.submit({1, 1}, "", large, {}, {}, Nanos(0), out_), Caller::Submission::kTaken);
  EXPECT_EQ(caller_.submit({1, 2}, "", large, {}, {}, Nanos(0), out_),
            Caller::Submission::kOutboxFull);
  EXPECT_EQ(caller_.availability(), Availability::kDraining);
  EXPECT_EQ(caller_.counts().outbox_full, 1);
  reply(ReplyKind::kDone, 1, seconds(1));
  EXPECT_EQ(caller_.availability(), Availability::kUp);
}

TEST_F(CloudCaller, IsDownWithoutALinkAndWithoutAWorker) {
  EXPECT_EQ(caller_.availability(), Availability::kDown);
  caller_.link_up(Nanos(0), out_);
  EXPECT_EQ(caller_.availability(), Availability::kDown) << "nobody computes";
  caller_.worker_heard(seconds(1), out_);
  EXPECT_EQ(caller_.availability(), Availability::kUp);
  EXPECT_EQ(caller_.next_wake(), seconds(11));
  caller_.wake(seconds(11), out_);
  EXPECT_EQ(caller_.availability(), Availability::kDown);
  caller_.worker_heard(seconds(12), out_);
  EXPECT_EQ(caller_.availability(), Availability::kUp);
}

TEST_F(CloudCaller, AKeySurvivesTheProgramAndGetsItsReply) {
  connect();
  submit("map of the cellar");
  CallerActions out;
  Caller next(*outbox_, CallerLimits{}, Nanos(0), out);
  EXPECT_TRUE(of<Withdraw>(out).empty());
  next.link_up(Nanos(0), out);
  const auto published = of<Publish>(out);
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].send, 2U) << "what the first run sent may be there, and its reply gone";
  next.replied({.task = kTask, .send = 1, .worker = "w"}, seconds(1), out);
  EXPECT_TRUE(of<TellEnd>(out).empty()) << "nobody has asked yet";
  const Bytes other{std::byte{9}};
  EXPECT_EQ(next.submit({2, 2}, "map of the cellar", other, {}, {}, seconds(2), out),
            Caller::Submission::kOtherBody);
  EXPECT_EQ(next.submit(kTask, "map of the cellar", kBody, {}, {}, seconds(2), out),
            Caller::Submission::kTaken);
  const auto ends = of<TellEnd>(out);
  ASSERT_EQ(ends.size(), 1U);
  EXPECT_EQ(ends[0].reply->worker, "w");
  EXPECT_TRUE(outbox_->all().empty());
}

TEST_F(CloudCaller, AKeyThatIsSubmittedAnewIsSentAboveWhatWorkersMayRemember) {
  connect();
  EXPECT_EQ(caller_.submit(kTask, "cellar", kBody, {}, {}, Nanos(0), out_, 1000),
            Caller::Submission::kTaken);
  const auto published = of<Publish>(actions());
  ASSERT_EQ(published.size(), 1U);
  EXPECT_EQ(published[0].send, 1000U);
  EXPECT_EQ(outbox_->all().at(0).sends, 1000U);
}

TEST_F(CloudCaller, WithdrawsAnEarlierRunsTasksThatHaveNoKey) {
  submit();
  CallerActions out;
  const Caller next(*outbox_, CallerLimits{}, Nanos(0), out);
  EXPECT_EQ(of<Withdraw>(out).size(), 1U);
  EXPECT_TRUE(outbox_->all().empty());
}

class CloudAttendant : public ::testing::Test {
 protected:
  static constexpr Nanos kNow{0};
  const TaskKey key_{"r", kTask};
  AttendantActions actions() { return std::exchange(out_, {}); }
  void finish(ReplyKind kind = ReplyKind::kDone) {
    attendant_.finished(key_, {.task = kTask, .kind = kind}, kNow, out_);
  }
  AttendantActions out_;
  Attendant attendant_{AttendantLimits{.slots = 2}};
};

TEST_F(CloudAttendant, AcknowledgesOnlyWhenTheReplyIsStored) {
  attendant_.delivered(key_, 1, 10, kNow, out_);
  EXPECT_EQ(of<Compute>(out_).size(), 1U);
  finish();
  EXPECT_EQ(of<PublishReply>(out_).size(), 1U);
  EXPECT_TRUE(of<Acknowledge>(actions()).empty());
  attendant_.stored(key_, 1, kNow, out_);
  const auto acknowledged = of<Acknowledge>(actions());
  ASSERT_EQ(acknowledged.size(), 1U);
  EXPECT_EQ(acknowledged[0].delivery, 10U);
}

TEST_F(CloudAttendant, PublishesAReplyAgainUntilTheServerHasIt) {
  attendant_.delivered(key_, 1, 10, kNow, out_);
  finish();
  actions();
  EXPECT_EQ(attendant_.next_wake(), seconds(5));
  attendant_.wake(seconds(5), out_);
  EXPECT_EQ(of<PublishReply>(actions()).size(), 1U);
}

TEST_F(CloudAttendant, PublishesAReplyAgainAtOnceWhenALinkIsBack) {
  attendant_.delivered(key_, 1, 10, kNow, out_);
  attendant_.link_up(kNow, out_);
  EXPECT_TRUE(of<PublishReply>(actions()).empty()) << "it is computed";
  finish();
  actions();
  attendant_.link_up(seconds(1), out_);
  EXPECT_EQ(of<PublishReply>(actions()).size(), 1U);
}

TEST(CloudStreamAge, IsNeverMoreThanItWas) {
  StreamAge ages;
  const auto ack = [](Nanos stored) {
    return "$JS.ACK.PIRT_TASKS.workers.1.7.3." + std::to_string(stored.count()) + ".0";
  };
  const Nanos server = seconds(1000);  // Another clock.
  EXPECT_EQ(ages.at_least(ack(server), seconds(5)), seconds(0)) << "nothing is known yet";
  EXPECT_EQ(ages.at_least(ack(server + seconds(1)), seconds(9)), seconds(3));
  EXPECT_EQ(ages.at_least(ack(server + seconds(6)), seconds(10)), seconds(0))
      << "it was faster than any before";
  EXPECT_EQ(ages.at_least(ack(server + seconds(6)), seconds(12)), seconds(2));
  EXPECT_EQ(
      ages.at_least("$JS.ACK.hub.acc.PIRT_TASKS.workers.1.7.3.1006000000000.0.x", seconds(12)),
      seconds(2));
  for (const char* other : {"", "x", "$JS.ACK.1.2", "$JS.ACK.a.b.1.2.3.soon.0", "........"}) {
    EXPECT_EQ(ages.at_least(other, seconds(50)), seconds(0)) << other;
  }
}

TEST_F(CloudAttendant, ComputesWhatComesTwiceOnce) {
  attendant_.delivered(key_, 1, 10, kNow, out_);
  attendant_.delivered(key_, 1, 11, kNow, out_);
  finish();
  attendant_.stored(key_, 1, kNow, out_);
  EXPECT_EQ(of<Compute>(out_).size(), 1U);
  EXPECT_EQ(of<Acknowledge>(actions()).size(), 2U);
  attendant_.delivered(key_, 1, 12, kNow, out_);
  const auto again = actions();
  EXPECT_TRUE(of<Compute>(again).empty());
  EXPECT_EQ(of<Acknowledge>(again).size(), 1U);
}

TEST_F(CloudAttendant, RepeatsTheReplyToATaskThatIsSentAgain) {
  attendant_.delivered(key_, 1, 10, kNow, out_);
  finish();
  attendant_.stored(key_, 1, kNow, out_);
  actions();
  attendant_.delivered(key_, 2, 11, kNow, out_);
  const auto again = actions();
  EXPECT_TRUE(of<Compute>(again).empty());
  ASSERT_EQ(of<PublishReply>(again).size(), 1U);
  EXPECT_EQ(of<PublishReply>(again)[0].send, 2U);
}

TEST_F(CloudAttendant, TriesAFailedTaskAgainOnlyWhenTheRobotSaysSo) {
  attendant_.delivered(key_, 1, 10, kNow, out_);
  finish(ReplyKind::kFailedTry);
  actions();
  // The robot's next try is faster than the word that the reply is stored.
  attendant_.delivered(key_, 2, 11, kNow, out_);
  EXPECT_EQ(of<LeaveForLater>(actions()).size(), 1U);
  attendant_.stored(key_, 1, kNow, out_);
  const auto stored = actions();
  EXPECT_EQ(of<Acknowledge>(stored).size(), 1U);
  EXPECT_TRUE(of<PublishReply>(stored).empty());
  attendant_.delivered(key_, 2, 12, kNow, out_);
  EXPECT_EQ(of<Compute>(actions()).size(), 1U);
}

TEST_F(CloudAttendant, SaysThatItComputes) {
  attendant_.delivered(key_, 1, 10, kNow, out_);
  actions();
  EXPECT_EQ(attendant_.next_wake(), seconds(10));
  attendant_.wake(seconds(10), out_);
  const auto said = actions();
  EXPECT_EQ(of<SayProgress>(said).size(), 1U);
  EXPECT_EQ(of<SayRunning>(said).size(), 1U);
}

TEST_F(CloudAttendant, HoldsNoMoreThanItsSlots) {
  EXPECT_EQ(attendant_.free_slots(), 2);
  attendant_.delivered(key_, 1, 10, kNow, out_);
  EXPECT_EQ(attendant_.free_slots(), 1);
  attendant_.postponed(key_, out_);
  EXPECT_EQ(attendant_.free_slots(), 2);
  EXPECT_EQ(of<LeaveForLater>(actions()).size(), 1U);
}

TEST(CloudAttendantMemory, ForgetsTheOldestRepliesBeyondItsLimit) {
  Attendant attendant({.slots = 1, .remembered = 2});
  AttendantActions out;
  for (std::uint64_t number = 1; number <= 3; ++number) {
    const TaskKey key{"r", {1, number}};
    attendant.delivered(key, 1, number, Nanos(0), out);
    attendant.finished(key, {.task = key.task}, Nanos(0), out);
    attendant.stored(key, 1, Nanos(0), out);
  }
  out.clear();
  attendant.delivered({"r", {1, 3}}, 1, 8, Nanos(0), out);
  EXPECT_TRUE(of<Compute>(out).empty());
  attendant.delivered({"r", {1, 1}}, 1, 9, Nanos(0), out);
  EXPECT_EQ(of<Compute>(out).size(), 1U);
}

void expect_nothing_lost(const test::SimulationResult& result) {
  EXPECT_EQ(result.never_ended, 0);
  EXPECT_EQ(result.ended_twice, 0);
  EXPECT_EQ(result.ended_wrongly, 0);
  EXPECT_EQ(result.left_in_outboxes, 0U);
  EXPECT_EQ(result.left_on_streams, 0U);
  EXPECT_EQ(result.submitted, result.done + result.given_up + result.returned + result.withdrawn);
  EXPECT_GT(result.done, 0);
}

TEST(CloudInVirtualTime, LosesNothingAndDeliversOnceWhateverFails) {
  const auto seeds = static_cast<std::uint64_t>(pirt::test::repeats(5, 50));
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    const auto result = Simulation({.seed = seed, .faults = 2000}).run();
    expect_nothing_lost(result);
    // The faults reach what is there against them.
    EXPECT_GT(result.sent_again, 0);
    EXPECT_GT(result.late, 0);
    EXPECT_GT(result.not_computed_again, 0);
    EXPECT_GT(result.lost_by_server, 0);
    EXPECT_GT(result.given_up, 0);
    EXPECT_GT(result.returned, 0);
    EXPECT_GT(result.withdrawn, 0);
    EXPECT_EQ(result.faults.size(), 6U);
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
