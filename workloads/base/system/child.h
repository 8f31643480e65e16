// What every child process does between fork and exec: only calls that POSIX allows there. What is
// said of one whose end others have taken.
#pragma once

#include <sys/prctl.h>
#include <unistd.h>

#include <csignal>

namespace pirt {

/// It dies with its parent, hears every signal, and takes no descriptors with it but those below
/// @p kept: whoever waits for the end of a pipe would otherwise wait for it too.
inline void begin_child(pid_t parent, unsigned kept) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(127);  // it died before prctl
  ::close_range(kept, ~0U, CLOSE_RANGE_CLOEXEC);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::signal(SIGPIPE, SIG_DFL);
}

/// Of a child that waitpid() does not find.
inline constexpr const char* kEndNotKnown =
    "has ended; how is not known, since this process ignores SIGCHLD or waits for all";

}  // namespace pirt
