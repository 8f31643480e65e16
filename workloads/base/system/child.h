// What every child process does between fork and exec: only calls that POSIX allows there. What is
// said of its end.
#pragma once

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

namespace pirt {

/// It dies with its parent, blocks no signal, and takes no descriptors with it but those below
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

/// Starts a program in a group of its own: a terminal's Ctrl-C is for this one.
/// @param command  Its file, which is looked for in PATH, and its arguments.
/// @param given    What become its descriptors 0 to 3, of this process; below 0 = as here.
/// @param folder   That it runs in; null = this one's.
/// @return         As fork() says it.
[[nodiscard]] inline pid_t start_child(const std::vector<std::string>& command,
                                       const std::array<int, 4>& given,
                                       const char* folder = nullptr) {
  std::vector<char*> words;
  for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  const pid_t parent = ::getpid(), child = ::fork();
  if (child > 0) ::setpgid(child, child);
  if (child != 0) return child;
  std::array<int, 4> apart{};  // Above those that are to be, before they are put in place.
  for (std::size_t i = 0; i < apart.size(); ++i) {
    apart[i] = given[i] < 0 ? -1 : ::fcntl(given[i], F_DUPFD, 10);
  }
  bool good = folder == nullptr || ::chdir(folder) == 0;
  for (std::size_t i = 0; i < apart.size(); ++i) {
    if (given[i] >= 0) good = ::dup2(apart[i], static_cast<int>(i)) >= 0 && good;
  }
  begin_child(parent, 4);
  ::setpgid(0, 0);
  if (good) ::execvp(words.front(), words.data());
  ::_exit(127);
}

/// "crashed (SIGSEGV)", "ended with code 3".
/// @param status  As waitpid() says it; absent = it did not find the child.
[[nodiscard]] inline std::string how_ended(std::optional<int> status) {
  if (!status) {
    return "has ended; how is not known, since this process ignores SIGCHLD or waits for all";
  }
  if (!WIFSIGNALED(*status)) return "ended with code " + std::to_string(WEXITSTATUS(*status));
  const int signal = WTERMSIG(*status);
  const char* const name = ::sigabbrev_np(signal);
  const std::string text =
      name != nullptr ? std::string("SIG") + name : "signal " + std::to_string(signal);
  return "crashed (" + text + ")";
}

}  // namespace pirt
