#include "cli/options/process_start.h"

#include <fcntl.h>
#include <fenv.h>
#include <fmt/format.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cfloat>
#include <clocale>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <streambuf>
#include <string_view>

#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/text.h"

namespace pirt::cli {
namespace {

struct ProcessState {
  bool known = false;
  std::array<std::uint64_t, 1024> cores{};  ///< A mask of 65,536.
  std::uint64_t blocked = 0;                ///< Bit N - 1: signal N.
  std::uint64_t ignored = 0;
  int nice = 0, policy = 0;
  sched_param realtime{};
  long slack_ns = 0;
  mode_t mask = 0;
  std::array<rlimit, RLIM_NLIMITS> limits{};
};

constexpr int kLastSignal = 31;  // those with a name
constexpr std::uint64_t bit(int signal) { return std::uint64_t{1} << (signal - 1); }

/// By system calls alone: before main, nothing else of the C library can be relied on (of a
/// sanitizer's neither).
ProcessState read_state() {
  ProcessState state;
  state.known = true;
  ::syscall(SYS_sched_getaffinity, 0, sizeof state.cores, state.cores.data());
  ::syscall(SYS_rt_sigprocmask, SIG_BLOCK, nullptr, &state.blocked, sizeof state.blocked);
  for (int signal = 1; signal <= kLastSignal; ++signal) {
    // The kernel's structure begins with the handler, on all machines but MIPS.
    std::array<std::uintptr_t, 16> action{};
    ::syscall(SYS_rt_sigaction, signal, nullptr, action.data(), sizeof state.blocked);
    if (action[0] == reinterpret_cast<std::uintptr_t>(SIG_IGN)) state.ignored |= bit(signal);
  }
  state.nice = 20 - static_cast<int>(::syscall(SYS_getpriority, PRIO_PROCESS, 0));
  state.policy = static_cast<int>(::syscall(SYS_sched_getscheduler, 0));
  ::syscall(SYS_sched_getparam, 0, &state.realtime);
  state.slack_ns = ::syscall(SYS_prctl, PR_GET_TIMERSLACK, 0, 0, 0, 0);
  state.mask = static_cast<mode_t>(::syscall(SYS_umask, 0));
  ::syscall(SYS_umask, state.mask);
  for (int each = 0; each < RLIM_NLIMITS; ++each) {
    ::syscall(SYS_prlimit64, 0, each, nullptr, &state.limits.at(static_cast<std::size_t>(each)));
  }
  return state;
}

constinit ProcessState at_start;
constinit int results = STDOUT_FILENO;

/// A stream that was closed is open the wrong way round, so that using it fails as before, and no
/// file is ever opened as one of the standard streams: what is written to those would end up in it.
void begin(int, char**, char**) {
  at_start = read_state();
  constexpr const char* kNothing = "/dev/null";
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::syscall(SYS_fcntl, stream, F_GETFD) >= 0) continue;
    // The lowest number that is free is the one that is taken.
    ::syscall(SYS_openat, AT_FDCWD, kNothing, stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
  }
  const auto own = ::syscall(SYS_fcntl, STDOUT_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  if (own < 0 || ::syscall(SYS_dup3, STDERR_FILENO, STDOUT_FILENO, 0) < 0) return;
  results = static_cast<int>(own);
}

/// Before the constructors of all libraries. @source System V ABI, "Initialization and Termination
/// Functions": DT_PREINIT_ARRAY of the executable.
__attribute__((section(".preinit_array"), used)) void (*const kBegin)(int, char**, char**) = begin;

std::string names_of(std::uint64_t signals) {
  std::vector<std::string> names;
  for (int signal = 1; signal <= kLastSignal; ++signal) {
    if ((signals & bit(signal)) != 0) names.emplace_back(::sigabbrev_np(signal));
  }
  return names.empty() ? "real-time signals" : "SIG" + join(names, ", SIG");
}

class Settling {
 public:
  explicit Settling(const ProcessState& start) : start_(start), now_(read_state()) {}

  std::vector<std::string> run() {
    if (!start_.known) return {};
    settle_signals();
    if (now_.cores != start_.cores) {
      restore("bound the process to other cores",
              ::syscall(SYS_sched_setaffinity, 0, sizeof start_.cores, start_.cores.data()) == 0);
    }
    settle_class();
    if (now_.slack_ns != start_.slack_ns) {
      restore("changed the slack of its timers", ::prctl(PR_SET_TIMERSLACK, start_.slack_ns) == 0);
    }
    settle_files();
    settle_limits();
    settle_path();
    settle_arithmetic();
    return std::move(said_);
  }

 private:
  void restore(const std::string& what, bool done) {
    said_.push_back(fmt::format(
        "a library {} when it was loaded; {}", what,
        done ? "this is undone" : std::string("this cannot be undone: ") + strerror(errno)));
  }

  void settle_signals() {
    if (now_.blocked != 0) {
      sigset_t none;
      sigemptyset(&none);
      ::sigprocmask(SIG_SETMASK, &none, nullptr);
      said_.push_back(fmt::format("{} were blocked by {}; they are heard again",
                                  names_of(now_.blocked),
                                  start_.blocked == 0 ? "a library" : "who started this"));
    }
    // These may be ignored on purpose: nohup, a shell's background, a service.
    constexpr auto kWishes = bit(SIGHUP) | bit(SIGINT) | bit(SIGQUIT) | bit(SIGTERM) |
                             bit(SIGPIPE) | bit(SIGTSTP) | bit(SIGTTIN) | bit(SIGTTOU) |
                             bit(SIGUSR1) | bit(SIGUSR2) | bit(SIGXCPU) | bit(SIGXFSZ);
    const std::uint64_t unwished = now_.ignored & ~(start_.ignored & kWishes);
    for (int signal = 1; signal <= kLastSignal; ++signal) {
      if ((unwished & bit(signal)) != 0) ::signal(signal, SIG_DFL);
    }
    if (unwished != 0) {
      said_.push_back(
          fmt::format("{} were ignored by {}; they are heard again", names_of(unwished),
                      (unwished & start_.ignored) == 0 ? "a library" : "who started this"));
    }
    // What ends processes, and how children are waited for, is ours; handlers of crashes are not.
    for (const int signal : {SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGPIPE, SIGCHLD}) {
      struct sigaction action {};
      ::sigaction(signal, nullptr, &action);
      const auto handler = reinterpret_cast<std::uintptr_t>(action.sa_handler);
      const bool wished = (start_.ignored & kWishes & bit(signal)) != 0;
      if (handler == reinterpret_cast<std::uintptr_t>(wished ? SIG_IGN : SIG_DFL) &&
          (action.sa_flags & SA_NOCLDWAIT) == 0) {
        continue;
      }
      restore("took " + names_of(bit(signal)),
              ::signal(signal, wished ? SIG_IGN : SIG_DFL) != SIG_ERR);
    }
  }

  void settle_class() {
    if (now_.policy != start_.policy ||
        now_.realtime.sched_priority != start_.realtime.sched_priority) {
      restore("changed the process's scheduling class",
              ::sched_setscheduler(0, start_.policy, &start_.realtime) == 0);
    }
    if (now_.nice != start_.nice) {
      restore("changed the process's niceness", ::setpriority(PRIO_PROCESS, 0, start_.nice) == 0);
    }
  }

  void settle_files() {
    if (now_.mask != start_.mask) {
      ::umask(start_.mask);
      restore("changed the umask", true);
    }
    if ((start_.mask & S_IRWXU) == 0) return;
    ::umask(start_.mask & ~static_cast<mode_t>(S_IRWXU));
    said_.push_back(
        fmt::format("umask {:04o} keeps files from their own owner; they are made as "
                    "with {:04o}",
                    start_.mask, start_.mask & ~static_cast<mode_t>(S_IRWXU)));
  }

  /// Without one, drivers do not find the linker that they call.
  void settle_path() {
    if (std::getenv("PATH") != nullptr) return;
    std::array<char, 256> usual{};
    const std::size_t size = ::confstr(_CS_PATH, usual.data(), usual.size());
    if (size == 0 || size > usual.size()) return;
    ::setenv("PATH", usual.data(), 1);
    said_.push_back(fmt::format("PATH is not set; {} is taken", usual.data()));
  }

  void settle_limits() {
    for (std::size_t i = 0; i < start_.limits.size(); ++i) {
      const rlimit& was = start_.limits.at(i);
      const rlimit& is = now_.limits.at(i);
      if (was.rlim_cur == is.rlim_cur && was.rlim_max == is.rlim_max) continue;
      // A soft limit that was raised harms nothing.
      if (was.rlim_max == is.rlim_max && was.rlim_cur < is.rlim_cur) continue;
      restore("lowered a limit of the process", ::setrlimit(static_cast<int>(i), &was) == 0);
    }
  }

  /// With start files of -ffast-math, a library makes the processor take tiny numbers for zero.
  void settle_arithmetic() {
    volatile double tiny = DBL_MIN;
    tiny = tiny / 2;
    if (tiny == 0 || ::fegetround() != FE_TONEAREST) {
      restore("changed how numbers are rounded", ::fesetenv(FE_DFL_ENV) == 0);
    }
    if (std::string_view(std::setlocale(LC_ALL, nullptr)) != "C") {
      restore("changed the locale", std::setlocale(LC_ALL, "C") != nullptr);
    }
  }

  const ProcessState& start_;
  ProcessState now_;
  std::vector<std::string> said_;
};

class ResultsBuffer : public std::streambuf {
 protected:
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    write_results({text, static_cast<std::size_t>(size)});
    return size;
  }
  int overflow(int c) override {
    if (c == traits_type::eof()) return 0;
    const char text = static_cast<char>(c);
    write_results({&text, 1});
    return c;
  }
};

}  // namespace

std::vector<std::string> settle_process() { return Settling(at_start).run(); }

int run_with_room(const std::function<int()>& body) {
  constexpr rlim_t kEnough = rlim_t{8} << 20;  // Linux's own limit, which compilers of drivers need
  constexpr rlim_t kFiles = 1024;              // the same of descriptors
  const auto limit = [](int which) {
    rlimit is{};
    ::getrlimit(static_cast<__rlimit_resource_t>(which), &is);
    return is;
  };
  rlimit files = limit(RLIMIT_NOFILE);
  if (files.rlim_cur < std::min(kFiles, files.rlim_max)) {
    files.rlim_cur = std::min(kFiles, files.rlim_max);
    ::setrlimit(RLIMIT_NOFILE, &files);
  }
  // Where both limits are one, the kernel kills without the signal that says why.
  rlimit time = limit(RLIMIT_CPU);
  if (time.rlim_cur != RLIM_INFINITY && time.rlim_cur == time.rlim_max && time.rlim_max > 1) {
    --time.rlim_cur;
    ::setrlimit(RLIMIT_CPU, &time);
  }
  const rlim_t stack = limit(RLIMIT_STACK).rlim_cur;
  if (stack < kEnough || stack == RLIM_INFINITY) {  // without a limit, threads are given 2 MB
    pthread_attr_t roomy;
    ::pthread_attr_init(&roomy);
    ::pthread_attr_setstacksize(&roomy, kEnough);
    ::pthread_setattr_default_np(&roomy);
    ::pthread_attr_destroy(&roomy);
  }
  if (stack >= kEnough) return body();
  int code = 0;
  start_thread([&] { code = body(); }).join();
  return code;
}

int results_descriptor() { return results; }

void write_results(std::string_view text) {
  while (!text.empty()) {
    const auto n = ::write(results, text.data(), text.size());
    if (n >= 0) {
      text.remove_prefix(static_cast<std::size_t>(n));
    } else if (errno == EAGAIN) {  // who shares the pipe with us wants not to wait
      pollfd room = {results, POLLOUT, 0};
      ::poll(&room, 1, -1);
    } else if (errno != EINTR) {
      throw_environment(std::string("cannot write to standard output: ") + std::strerror(errno));
    }
  }
}

std::ostream& results_stream() {
  static ResultsBuffer buffer;
  static std::ostream stream(&buffer);
  return stream;
}

}  // namespace pirt::cli
