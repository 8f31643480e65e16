// What libraries do when they are loaded, each of it seen somewhere: they bind the process to a
// core (OpenMP), block signals around threads that they start, take SIGCHLD, lower priority and
// limits, round otherwise (-ffast-math), set the locale's umask, and say hello on stdout.
#include <fenv.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstddef>
#include <cstdio>
#include <cstdlib>

namespace {

[[maybe_unused]] const bool kMeddled = [] {
  std::puts("hello from a library");
  std::fflush(stdout);
  sigset_t blocked;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGTERM);
  sigaddset(&blocked, SIGINT);
  ::sigprocmask(SIG_BLOCK, &blocked, nullptr);
  ::signal(SIGCHLD, SIG_IGN);
  ::signal(SIGHUP, [](int) {});
  cpu_set_t all, one;
  ::sched_getaffinity(0, sizeof all, &all);
  CPU_ZERO(&one);
  for (std::size_t core = 0; CPU_COUNT(&one) == 0; ++core) {
    if (CPU_ISSET(core, &all)) CPU_SET(core, &one);
  }
  ::sched_setaffinity(0, sizeof one, &one);
  static_cast<void>(::setpriority(PRIO_PROCESS, 0, 7));
  ::umask(0777);
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = 20;
  ::setrlimit(RLIMIT_NOFILE, &files);
  ::fesetround(FE_UPWARD);
  return true;
}();

/// At the end, where that is asked for, the stack that threads were given.
__attribute__((destructor)) void tell_stack() {
  if (std::getenv("PIRT_TEST_STACK") == nullptr) return;
  pthread_attr_t attributes;
  std::size_t size_bytes = 0;
  ::pthread_getattr_default_np(&attributes);
  ::pthread_attr_getstacksize(&attributes, &size_bytes);
  std::fprintf(stderr, "stack of a thread: %zu kB\n", size_bytes >> 10U);
}

}  // namespace
