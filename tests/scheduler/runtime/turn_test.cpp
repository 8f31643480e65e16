// Whose turn it is in the runtime: one thread at a time, and who waits for it sleeps.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <string>
#include <thread>

#include "scheduler/runtime/bell.h"

namespace pirt::runtime {
namespace {

/// 'R' = runs or wants to, 'S' = sleeps. @source proc(5), /proc/[pid]/stat.
char state_of(pid_t thread) {
  std::ifstream in("/proc/self/task/" + std::to_string(thread) + "/stat");
  std::string line;
  std::getline(in, line);
  const auto name = line.rfind(") ");
  return name == std::string::npos ? '?' : line[name + 2];
}

// A thread of high priority that waited awake would keep the one that has the turn from its core.
TEST(Turn, WhoWaitsForItSleepsUntilItIsGivenBack) {
  Turn turn;
  auto held = turn.take();
  EXPECT_FALSE(turn.try_take());
  std::atomic<pid_t> waits = 0;
  std::atomic<bool> has_it = false;
  std::jthread thread([&] {
    waits = ::gettid();
    const auto mine = turn.take();
    has_it = true;
  });
  while (waits == 0 || state_of(waits) != 'S') std::this_thread::yield();
  EXPECT_FALSE(has_it);
  held.give_back();
  thread.join();
  EXPECT_TRUE(has_it);
  EXPECT_TRUE(turn.try_take());
}

TEST(Turn, IsGivenBackByWhatEndsIt) {
  Turn turn;
  try {
    const auto held = turn.take();
    throw 1;
  } catch (int) {
  }
  EXPECT_TRUE(turn.try_take());
  turn.take().keep_for_good();
  EXPECT_FALSE(turn.try_take());
}

}  // namespace
}  // namespace pirt::runtime
