// Starting threads, of which a machine may not give as many as are asked for.
#pragma once

#include <pthread.h>
#include <sys/resource.h>

#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "workloads/base/error.h"

namespace pirt {

/// Of the calling thread, for whoever looks at it from outside (top -H, a debugger); the system
/// keeps 15 bytes.
inline void name_thread(const std::string& name) {
  constexpr std::size_t kLongest = 15;
  static_cast<void>(::pthread_setname_np(::pthread_self(), name.substr(0, kLongest).c_str()));
}

/// The calling thread gives way to others, of which each gets ten times as much of a core that both
/// want. It must hold nothing that they wait for.
inline void give_way() {
  constexpr int kNice = 10;
  static_cast<void>(::setpriority(PRIO_PROCESS, 0, kNice));  // 0: of this thread alone.
}

/// @throws Error{kEnvironment} if the thread cannot be started; those that run already must then be
/// made to end by the caller, who joins them.
template <typename Body>
[[nodiscard]] std::jthread start_thread(Body&& body) {
  try {
    return std::jthread(std::forward<Body>(body));
  } catch (const std::system_error& error) {
    throw_environment("cannot start a thread: " + error.code().message() +
                      "; raise the limits on processes and memory (ulimit -u, ulimit -v, those of "
                      "the container)");
  }
}

}  // namespace pirt
