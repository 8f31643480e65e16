#include "workloads/base/system/deadline.h"

#include <gtest/gtest.h>

namespace pirt {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(Deadline, IsOverAfterItsLimit) {
  Deadline deadline(seconds(100), seconds(3));
  EXPECT_EQ(deadline.next_wait(seconds(100), seconds(2)), seconds(2));
  EXPECT_EQ(deadline.next_wait(seconds(102), seconds(2)), seconds(1));
  EXPECT_EQ(deadline.next_wait(seconds(104), seconds(2)), Nanos(0)) << "a second late: over";
}

// Asked for 1 s, away for 60: what is left is what was.
TEST(Deadline, DoesNotCountTheTimeForWhichThisProcessWasStopped) {
  Deadline deadline(seconds(100), seconds(3));
  EXPECT_EQ(deadline.next_wait(seconds(100), seconds(1)), seconds(1));
  EXPECT_EQ(deadline.next_wait(seconds(161), seconds(5)), seconds(2));
  EXPECT_EQ(deadline.next_wait(seconds(163), seconds(5)), Nanos(0));
  Deadline at_once(seconds(100), seconds(3));
  EXPECT_EQ(at_once.next_wait(seconds(200), seconds(5)), seconds(3)) << "before the first look";
}

TEST(Deadline, IsNoShorterAsPollHasIt) {
  EXPECT_EQ(poll_ms(Nanos(0)), 0);
  EXPECT_EQ(poll_ms(Nanos(1)), 1);
  EXPECT_EQ(poll_ms(milliseconds(7)), 7);
}

}  // namespace
}  // namespace pirt
