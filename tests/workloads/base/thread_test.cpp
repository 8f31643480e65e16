#include "workloads/base/system/thread.h"

#include <gtest/gtest.h>

namespace pirt {
namespace {

bool hears(int signal) {
  sigset_t blocked;
  ::pthread_sigmask(SIG_BLOCK, nullptr, &blocked);
  return sigismember(&blocked, signal) == 0;
}

// Handlers of a robot's process run in the robot's threads.
TEST(Thread, HearsNoSignalButOfWhatItDoes) {
  bool termination = true, child = true, fault = false;
  start_thread([&] {
    termination = hears(SIGTERM);
    child = hears(SIGCHLD);
    fault = hears(SIGSEGV);
  }).join();
  EXPECT_FALSE(termination);
  EXPECT_FALSE(child);
  EXPECT_TRUE(fault);
  EXPECT_TRUE(hears(SIGTERM)) << "who starts one goes on hearing them";
}

TEST(Thread, OfARealTimeThreadTakesTheClassOfTheProcess) {
  int before = -1, after = -1;
  std::jthread robot([&] {
    sched_param urgent{};
    urgent.sched_priority = 1;
    if (::sched_setscheduler(0, SCHED_FIFO, &urgent) != 0) return;
    start_thread([&] {
      before = ::sched_getscheduler(0);
      take_class_of_process();
      after = ::sched_getscheduler(0);
    }).join();
  });
  robot.join();
  if (before < 0) GTEST_SKIP() << "skipped: no real-time class is permitted";
  EXPECT_EQ(before, SCHED_FIFO);
  EXPECT_EQ(after, ::sched_getscheduler(::getpid()));
}

// Such as no memory, or no room on a disk.
TEST(StartThread, AnExceptionEndsTheThreadAndNotTheProgram) {
  testing::internal::CaptureStderr();
  start_thread([] {
    name_thread("worker");
    throw std::runtime_error("no room is left");
  }).join();
  start_thread([](const std::stop_token&) { throw 5; }).join();
  EXPECT_EQ(testing::internal::GetCapturedStderr().substr(0, 57),
            "pirt: thread worker ended early: no room is left\npirt: th");
}

}  // namespace
}  // namespace pirt
