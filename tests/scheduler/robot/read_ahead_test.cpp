#include "scheduler/robot/read_ahead.h"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <atomic>
#include <stdexcept>

namespace pirt {
namespace {

/// Of one pixel, which says of which frame it is.
ReadAhead::Pictures numbered(std::size_t frame) {
  return {{1, 1, {static_cast<std::uint8_t>(frame)}}, {}};
}

TEST(ReadAhead, GivesEachFrameInItsOrder) {
  ReadAhead pictures(5, numbered, false);
  for (int frame = 0; frame < 5; ++frame) {
    const auto next = pictures.next();
    EXPECT_EQ(next.left.pixels.at(0), frame);
    EXPECT_TRUE(next.right.empty());
  }
}

TEST(ReadAhead, ThrowsAtTheFrameThatCannotBeRead) {
  ReadAhead pictures(
      3,
      [](std::size_t frame) {
        if (frame == 1) throw std::runtime_error("no picture");
        return numbered(frame);
      },
      false);
  static_cast<void>(pictures.next());
  EXPECT_THROW(static_cast<void>(pictures.next()), std::runtime_error);
  EXPECT_EQ(pictures.next().left.pixels.at(0), 2);
}

TEST(ReadAhead, KeepsNoMoreThanAFewAndEndsBeforeItIsThrough) {
  std::atomic<int> read = 0;
  {
    ReadAhead pictures(
        1000,
        [&](std::size_t frame) {
          ++read;
          return numbered(frame);
        },
        false);
    static_cast<void>(pictures.next());
  }
  // One taken, two kept, one in its hand.
  EXPECT_LE(read, 4);
}

TEST(ReadAhead, GivesWayOnItsThreadAlone) {
  const auto mine = [] { return ::getpriority(PRIO_PROCESS, 0); };
  std::atomic<int> its = 0;
  const int before = mine();
  ReadAhead pictures(
      1,
      [&](std::size_t frame) {
        its = mine();
        return numbered(frame);
      },
      true);
  static_cast<void>(pictures.next());
  EXPECT_GT(its, before);
  EXPECT_EQ(mine(), before);
}

}  // namespace
}  // namespace pirt
