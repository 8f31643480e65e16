// Sleeping until a number changes, as Linux offers it: std::atomic's wait has no limit of time, and
// may wake through a pool that all of a process share.
#pragma once

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <ctime>

namespace pirt::runtime {

using FutexWord = std::atomic<std::uint32_t>;
static_assert(sizeof(FutexWord) == sizeof(std::uint32_t));

/// Sleeps if the word is @p value, until it is woken, @p most is over, or for no reason.
/// @param most  Null = as long as it takes.
inline void futex_wait(FutexWord& word, std::uint32_t value, const std::timespec* most = nullptr) {
  ::syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&word), FUTEX_WAIT_PRIVATE, value, most,
            nullptr, 0);
}

/// @param sleepers  How many are woken at most.
inline void futex_wake(FutexWord& word, int sleepers) {
  ::syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&word), FUTEX_WAKE_PRIVATE, sleepers,
            nullptr, nullptr, 0);
}

}  // namespace pirt::runtime
