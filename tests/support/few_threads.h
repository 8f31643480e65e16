// A machine that gives no more than so many threads.
#pragma once

#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstddef>
#include <fstream>
#include <string>

#include "workloads/base/error.h"

namespace pirt::test {

/// Runs @p action in a process that can start @p threads threads and no more, for want of address
/// space: each of their stacks takes a gigabyte.
/// @return What happened: "cannot start a thread" for the error that says so, "nothing", another
/// error, or "hangs" after a while.
template <typename Action>
std::string with_threads(int threads, Action action) {
  constexpr std::size_t kStack = std::size_t{1} << 30;
  constexpr int kHangsAfter_s = 20;
  enum Code : int { kNothing = 10, kAsItShould, kOther };
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(kHangsAfter_s);
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    pthread_attr_t attributes;
    ::pthread_attr_init(&attributes);
    ::pthread_attr_setstacksize(&attributes, kStack);
    ::pthread_setattr_default_np(&attributes);
    // Half a stack is left for all else.
    const rlim_t size = pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)) +
                        static_cast<std::size_t>(threads) * kStack + kStack / 2;
    const rlimit limit{size, size};
    ::setrlimit(RLIMIT_AS, &limit);
    int code = kNothing;
    try {
      action();
    } catch (const Error& error) {
      const bool right = error.code() == ErrorCode::kEnvironment &&
                         std::string(error.what()).starts_with("cannot start a thread: ");
      code = right ? kAsItShould : kOther;
    } catch (...) {
      code = kOther;
    }
    ::_exit(code);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  if (WIFSIGNALED(status)) return WTERMSIG(status) == SIGALRM ? "hangs" : "dies";
  switch (WEXITSTATUS(status)) {
    case kNothing:
      return "nothing";
    case kAsItShould:
      return "cannot start a thread";
    default:
      return "another error";
  }
}

}  // namespace pirt::test
