// All by which threads of a live run meet: clock, atomics, locks, sleep, their start. The one seam:
// nothing else in this room starts a thread, waits or reads a clock, so that tests compile the same
// sources against threads that a seed hands on one at a time, in time that it makes up
// (tests/scheduler/simulation/seam, which comes before this in their include path).
#pragma once

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <ctime>
#include <mutex>
#include <thread>

#include "workloads/base/system/thread.h"
#include "workloads/base/time.h"

namespace pirt::runtime {

template <typename T>
using Atomic = std::atomic<T>;
using Mutex = std::mutex;
using Condition = std::condition_variable;
using Thread = std::jthread;
using LiveClock = MachineClock;
using pirt::start_thread;

/// Sleeping until a number changes, as Linux offers it: std::atomic's wait has no limit of time,
/// and may wake through a pool that all of a process share.
using FutexWord = Atomic<std::uint32_t>;
static_assert(sizeof(FutexWord) == sizeof(std::uint32_t));

/// Sleeps if the word is @p value, until it is woken, @p most is over, or for no reason.
inline void futex_wait(FutexWord& word, std::uint32_t value, Nanos most = Nanos::max()) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(most);
  const std::timespec time{.tv_sec = seconds.count(), .tv_nsec = (most - seconds).count()};
  ::syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&word), FUTEX_WAIT_PRIVATE, value,
            most == Nanos::max() ? nullptr : &time, nullptr, 0);
}

/// @param sleepers  How many are woken at most.
inline void futex_wake(FutexWord& word, int sleepers) {
  ::syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&word), FUTEX_WAKE_PRIVATE, sleepers,
            nullptr, nullptr, 0);
}

}  // namespace pirt::runtime
