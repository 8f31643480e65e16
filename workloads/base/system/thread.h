// Starting threads, of which a machine may not give as many as are asked for.
#pragma once

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <exception>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <type_traits>
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

/// While it lives, threads that are started hear no signal but of what they do themselves: the rest
/// is for those threads of the process that are not ours.
class SignalsKept {
 public:
  SignalsKept() {
    sigset_t others;
    sigfillset(&others);
    for (const int own : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTRAP, SIGSYS, SIGPROF}) {
      sigdelset(&others, own);
    }
    ::pthread_sigmask(SIG_BLOCK, &others, &before_);
  }
  ~SignalsKept() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsKept(const SignalsKept&) = delete;
  SignalsKept& operator=(const SignalsKept&) = delete;

 private:
  sigset_t before_{};
};

/// What a real-time thread of a robot has started is no real-time thread, unless the process is
/// one.
inline void take_class_of_process() {
  const int wanted = ::sched_getscheduler(::getpid());
  sched_param parameters{};
  if (wanted < 0 || ::sched_getscheduler(0) == wanted) return;
  if (::sched_getparam(::getpid(), &parameters) == 0) {
    ::sched_setscheduler(0, wanted, &parameters);
  }
}

/// A thread has ended early: on standard error, in one line, with its name.
inline void report_thread(const char* what) {
  char name[16] = "?";
  static_cast<void>(::pthread_getname_np(::pthread_self(), name, sizeof name));
  std::fprintf(stderr, "pirt: thread %s ended early: %s\n", name, what);
}

/// The only way to a thread: what is thrown out of @p body, such as for want of memory or of room
/// on a disk, ends that thread with a line on standard error, and not the program. Whose work must
/// go on, or be told, catches it itself.
/// @param body  void(), or void(std::stop_token).
/// @throws Error{kEnvironment} if the thread cannot be started; those that run already must then be
/// made to end by the caller, who joins them.
template <typename Body>
[[nodiscard]] std::jthread start_thread(Body&& body) {
  try {
    const SignalsKept kept;
    return std::jthread([body = std::forward<Body>(body)](const std::stop_token& stop) mutable {
      try {
        if constexpr (std::is_invocable_v<Body&, std::stop_token>) {
          body(stop);
        } else {
          body();
        }
      } catch (const std::exception& error) {
        report_thread(error.what());
      } catch (...) {
        report_thread("something that is no std::exception was thrown");
      }
    });
  } catch (const std::system_error& error) {
    throw_environment("cannot start a thread: " + error.code().message() +
                      "; raise the limits on processes and memory (ulimit -u, ulimit -v, those of "
                      "the container)");
  }
}

}  // namespace pirt
