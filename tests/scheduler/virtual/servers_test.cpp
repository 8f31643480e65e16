// FIFO and processor sharing, worked by hand to the nanosecond.
#include "scheduler/virtual/servers.h"

#include <gmock/gmock.h>

#include <utility>
#include <vector>

namespace pirt::test {
namespace {

struct Arrival {
  Nanos at;
  Nanos work;
};
using Completions = std::vector<std::pair<JobId, std::int64_t>>;

/// Jobs 0, 1, 2, ... arrive in order; at equal times completions come first.
Completions serve(int servers, Discipline discipline, const std::vector<Arrival>& arrivals) {
  const auto station = make_servers(servers, discipline);
  Completions done;
  const auto complete_until = [&](Nanos time) {
    while (station->next().time <= time && station->next().time != Nanos::max()) {
      const Nanos at = station->next().time;
      done.emplace_back(station->complete_next(), at.count());
    }
  };
  for (JobId job = 0; job < arrivals.size(); ++job) {
    complete_until(arrivals[job].at);
    station->arrive(job, arrivals[job].work, job, arrivals[job].at);
  }
  complete_until(Nanos::max());
  return done;
}

Nanos ns(std::int64_t count) { return Nanos(count); }

TEST(Servers, LetAJobGoAndGoOnWithTheNext) {
  const auto fifo = make_servers(1, Discipline::kFifo);
  fifo->arrive(0, ns(10), 0, ns(0));
  fifo->arrive(1, ns(5), 1, ns(0));
  fifo->arrive(2, ns(7), 2, ns(0));
  EXPECT_EQ(fifo->remove(1, ns(2)), ns(5)) << "it had not begun";
  EXPECT_EQ(fifo->remove(0, ns(4)), ns(6));
  EXPECT_EQ(fifo->remove(0, ns(4)), std::nullopt);
  EXPECT_EQ(fifo->next().time, ns(11));
  EXPECT_EQ(fifo->complete_next(), 2U);
  EXPECT_EQ(fifo->next().time, Nanos::max());
  fifo->arrive(3, ns(1), 3, ns(20));
  EXPECT_EQ(fifo->next().time, ns(21)) << "the server is idle again";

  const auto shared = make_servers(1, Discipline::kProcessorSharing);
  shared->arrive(0, ns(10), 0, ns(0));
  shared->arrive(1, ns(10), 1, ns(0));
  EXPECT_EQ(shared->remove(0, ns(8)), ns(6)) << "each had half of the server";
  EXPECT_EQ(shared->next().time, ns(14));
  EXPECT_EQ(shared->remove(1, ns(9)), ns(5));
  EXPECT_EQ(shared->next().time, Nanos::max());
}

TEST(FifoServers, ServeOneAfterTheOther) {
  EXPECT_EQ(serve(1, Discipline::kFifo, {{ns(0), ns(10)}, {ns(3), ns(5)}, {ns(20), ns(1)}}),
            (Completions{{0, 10}, {1, 15}, {2, 21}}));
}

TEST(FifoServers, TwoServersTakeTheFirstThatWaits) {
  // 0 and 1 start; 2 starts when 1 ends at 4, 3 when 2 ends at 6.
  EXPECT_EQ(serve(2, Discipline::kFifo,
                  {{ns(0), ns(10)}, {ns(0), ns(4)}, {ns(1), ns(2)}, {ns(1), ns(3)}}),
            (Completions{{1, 4}, {2, 6}, {3, 9}, {0, 10}}));
}

TEST(ProcessorSharing, IsFullSpeedUpToTheNumberOfServers) {
  EXPECT_EQ(
      serve(4, Discipline::kProcessorSharing, {{ns(0), ns(10)}, {ns(2), ns(3)}, {ns(2), ns(9)}}),
      (Completions{{1, 5}, {0, 10}, {2, 11}}));
}

TEST(ProcessorSharing, SlowsAllJobsAlikeBeyondThat) {
  // Two servers. [0, 10): 0 and 1 at rate 1, 30 of their 40 left. At 10 job 2 joins with 20: all at
  // rate 2/3, so that its 20 take 30: until 40, when 0 and 1 have 30 - 20 = 10 left, at rate 1
  // again: until 50.
  EXPECT_EQ(
      serve(2, Discipline::kProcessorSharing, {{ns(0), ns(40)}, {ns(0), ns(40)}, {ns(10), ns(20)}}),
      (Completions{{2, 40}, {0, 50}, {1, 50}}));
}

TEST(ProcessorSharing, RoundsCompletionsUpToTheNanosecond) {
  // Three jobs of 7 on two servers: each at rate 2/3, 10.5.
  EXPECT_EQ(
      serve(2, Discipline::kProcessorSharing, {{ns(0), ns(7)}, {ns(0), ns(7)}, {ns(0), ns(7)}}),
      (Completions{{0, 11}, {1, 11}, {2, 11}}));
}

TEST(ProcessorSharing, DoesNotGainOrLoseWorkOverManyArrivals) {
  // One server, always busy: whatever the order, it ends when all work is done. 3000 jobs of 1000 +
  // i, one each nanosecond: 3000*1000 + 2999*3000/2 = 7498500. Jobs leave between nanoseconds; were
  // the others kept waiting till the next, the end would be 2 ns late.
  std::vector<Arrival> arrivals;
  for (int i = 0; i < 3000; ++i) arrivals.push_back({ns(i), ns(1000 + i)});
  const auto done = serve(1, Discipline::kProcessorSharing, arrivals);
  ASSERT_EQ(done.size(), 3000U);
  EXPECT_NEAR(static_cast<double>(done.back().second), 7498500,
              1);  // 3000 roundings of 2^-32 ns, then one up.
}

TEST(ProcessorSharing, LetsOthersSpeedUpBetweenNanoseconds) {
  // One server. Jobs of 1 and 3 for 3 ns and of 4: [0, 3) each at 1/3; the first is done at 3. The
  // others have 2 and 3 left at 1/2: 7; then 1: 8.
  EXPECT_EQ(
      serve(1, Discipline::kProcessorSharing, {{ns(0), ns(1)}, {ns(0), ns(3)}, {ns(0), ns(4)}}),
      (Completions{{0, 3}, {1, 7}, {2, 8}}));
  // Two servers. Three jobs of 1, 1 and 2 at 2/3: the first two end at 1.5, reported at 2; the last
  // has 1 left at rate 1: 2.5, reported at 3.
  EXPECT_EQ(
      serve(2, Discipline::kProcessorSharing, {{ns(0), ns(1)}, {ns(0), ns(1)}, {ns(0), ns(2)}}),
      (Completions{{0, 2}, {1, 2}, {2, 3}}));
}

TEST(ProcessorSharing, HandlesJobsWithoutWork) {
  EXPECT_EQ(serve(1, Discipline::kProcessorSharing, {{ns(5), ns(0)}, {ns(5), ns(2)}}),
            (Completions{{0, 5}, {1, 7}}));
}

}  // namespace
}  // namespace pirt::test
