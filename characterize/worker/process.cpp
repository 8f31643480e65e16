#include "characterize/worker/process.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <string_view>

#include "characterize/machine/system_files.h"
#include "workloads/base/error.h"
#include "workloads/base/system/child.h"
#include "workloads/base/system/control_groups.h"
#include "workloads/base/system/deadline.h"
#include "workloads/base/system/file_descriptor.h"
#include "workloads/base/system/pipe.h"

namespace pirt {
namespace {

constexpr std::size_t kDiagnosticsKept = 16384;
// How often the stop flag and the limit are looked at.
constexpr Nanos kLookEvery = std::chrono::milliseconds(100);
constexpr int kReapEveryMs = 1;  // of a child about to be gone, on kernels that do not tell

[[noreturn]] void throw_system(std::string_view doing, int error) {
  throw_environment(fmt::format("cannot {}: {}; check the limits on processes and open files",
                                doing, std::strerror(error)));
}

/// The input as a file in memory: nothing to feed while the child runs, and no SIGPIPE if it does
/// not read.
FileDescriptor input_file(const std::string& text) {
  FileDescriptor file(::memfd_create("pirt-input", MFD_CLOEXEC));
  if (file.get() < 0) throw_system("make a file in memory", errno);
  std::size_t written = 0;
  while (written < text.size()) {
    const auto n = ::write(file.get(), text.data() + written, text.size() - written);
    if (n < 0 && errno != EINTR) throw_system("write a file in memory", errno);
    if (n > 0) written += static_cast<std::size_t>(n);
  }
  if (::lseek(file.get(), 0, SEEK_SET) != 0) throw_system("rewind a file in memory", errno);
  return file;
}

/// Environment of the child as execve wants it; replaces variables of the same name.
class ChildEnvironment {
 public:
  explicit ChildEnvironment(const std::vector<std::pair<std::string, std::string>>& added) {
    for (char** entry = environ; *entry != nullptr; ++entry) {
      const std::string_view text(*entry);
      const auto name = text.substr(0, text.find('='));
      const bool replaced =
          std::ranges::any_of(added, [&](const auto& variable) { return variable.first == name; });
      if (!replaced) entries_.emplace_back(text);
    }
    for (const auto& [name, value] : added) entries_.push_back(fmt::format("{}={}", name, value));
    for (std::string& entry : entries_) pointers_.push_back(entry.data());
    pointers_.push_back(nullptr);
  }
  [[nodiscard]] char* const* get() const { return pointers_.data(); }

 private:
  std::vector<std::string> entries_;
  std::vector<char*> pointers_;
};

/// What a child says of itself before it becomes the program, and where it cannot.
struct Start {
  std::int64_t most_kib = 0;  ///< What the kernel counts already, of the copy of this process.
  std::int64_t error = 0;     ///< As errno; an exit status may be a program's own. 0 = it could.
};

/// Between fork and exec; only calls that POSIX allows there, and bare system calls.
/// @param start  Where the fields of Start go.
[[noreturn]] void become(const char* program, char* const* arguments, char* const* environment,
                         int in, int out, int err, int start, pid_t parent) {
  ::setpgid(0, 0);
  begin_child(parent, STDERR_FILENO + 1);
  ::signal(SIGINT, SIG_DFL);
  rusage used{};
  ::getrusage(RUSAGE_SELF, &used);
  const std::int64_t most_kib = used.ru_maxrss;
  static_cast<void>(!::write(start, &most_kib, sizeof most_kib));
  if (::dup2(in, STDIN_FILENO) >= 0 && ::dup2(out, STDOUT_FILENO) >= 0 &&
      ::dup2(err, STDERR_FILENO) >= 0) {
    ::execve(program, arguments, environment);
  }
  const std::int64_t error = errno;
  static_cast<void>(!::write(start, &error, sizeof error));
  ::_exit(EXIT_FAILURE);
}

class Child {
 public:
  explicit Child(const ProcessRequest& request) {
    std::vector<std::string> words = {request.program.string()};
    words.insert(words.end(), request.arguments.begin(), request.arguments.end());
    std::vector<char*> arguments;
    arguments.reserve(words.size() + 1);
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const ChildEnvironment environment(request.environment);
    const FileDescriptor input = input_file(request.input);
    Pipe out = make_pipe();
    Pipe err = make_pipe();
    Pipe start = make_pipe(O_NONBLOCK);
    const pid_t self = ::getpid();
    pid_ = ::fork();
    if (pid_ < 0) throw_system("start a process", errno);
    if (pid_ == 0) {
      become(words[0].c_str(), arguments.data(), environment.get(), input.get(), out.write.get(),
             err.write.get(), start.write.get(), self);
    }
    ::setpgid(pid_, pid_);  // also here, so that a kill right away finds the group
    out_ = std::move(out.read);
    err_ = std::move(err.read);
    start_ = std::move(start.read);
    end_ = FileDescriptor(static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0)));
  }
  ~Child() {
    kill();
    ::waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// The whole group: compilers that a driver started must not go on computing. The child itself is
  /// reaped last, so that its number cannot be somebody else's by now.
  void kill() const { ::kill(-pid_, SIGKILL); }

  /// Waits for output or @p wait_ms and takes in what there is.
  void pump(int wait_ms, ProcessResult& result) {
    std::array<pollfd, 3> streams = {pollfd{out_.get(), POLLIN, 0}, pollfd{err_.get(), POLLIN, 0},
                                     pollfd{end_.get(), POLLIN, 0}};
    if (is_closed() && end_.get() < 0) wait_ms = std::min(wait_ms, kReapEveryMs);
    if (::poll(streams.data(), streams.size(), wait_ms) <= 0)
      return;  // EINTR: the caller looks again
    if (streams[0].revents != 0) take(out_, result.output);
    if (streams[1].revents != 0) {
      take(err_, result.diagnostics);
      const std::size_t size = result.diagnostics.size();
      if (size > kDiagnosticsKept) result.diagnostics.erase(0, size - kDiagnosticsKept);
    }
  }

  [[nodiscard]] bool is_closed() const { return out_.get() < 0 && err_.get() < 0; }

  /// How it ended, once it has; it stays to be reaped.
  [[nodiscard]] std::optional<siginfo_t> ended() const {
    siginfo_t info{};
    if (::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) != 0) {
      return std::nullopt;
    }
    return info.si_pid == pid_ ? std::optional(info) : std::nullopt;
  }

  /// Once it has ended.
  [[nodiscard]] Start start() const {
    Start start;
    static_cast<void>(!::read(start_.get(), &start, sizeof start));
    return start;
  }

  /// Once it has ended. The C library's waitid has no place for it.
  [[nodiscard]] rusage usage() const {
    rusage used{};
    siginfo_t info{};
    static_cast<void>(
        ::syscall(SYS_waitid, P_PID, pid_, &info, WEXITED | WNOHANG | WNOWAIT, &used));
    return used;
  }

 private:
  static void take(FileDescriptor& stream, std::string& text) {
    std::array<char, 65536> buffer;
    const auto n = ::read(stream.get(), buffer.data(), buffer.size());
    if (n > 0) text.append(buffer.data(), static_cast<std::size_t>(n));
    if (n == 0 || (n < 0 && errno != EINTR)) stream.close();
  }

  pid_t pid_ = -1;
  FileDescriptor out_, err_, start_;
  FileDescriptor end_;  ///< Readable once it has ended; none on kernels before 5.3.
};

/// What is left in the pipes of a child that has ended. Something that it started may hold them
/// open: nothing is waited for.
void drain(Child& child, ProcessResult& result) {
  std::size_t before = 0;
  do {
    before = result.output.size() + result.diagnostics.size();
    child.pump(0, result);
  } while (!child.is_closed() && result.output.size() + result.diagnostics.size() != before);
}

Nanos nanos_of(const timeval& time) {
  return std::chrono::seconds(time.tv_sec) + std::chrono::microseconds(time.tv_usec);
}

void take_usage(const rusage& used, ProcessResult& result) {
  result.cpu = nanos_of(used.ru_utime) + nanos_of(used.ru_stime);
  result.peak_bytes = std::int64_t{used.ru_maxrss} * 1024;
}

}  // namespace

ProcessResult run_process(const ProcessRequest& request) {
  const MachineClock clock;
  // Of the machine and of all control groups. @source mm/oom_kill.c
  const auto killed_for_memory = [] { return number_of("/proc/vmstat", "oom_kill", ' '); };
  const auto killed_before = killed_for_memory();
  ProcessResult result;
  const Nanos begin = clock.now();
  Child child(request);
  Deadline deadline(clock.now(), request.limit);
  while (!child.ended()) {
    const bool stopped = request.stop != nullptr && request.stop->load();
    const bool too_much = result.output.size() > request.most_output;
    const Nanos wait = deadline.next_wait(clock.now(), kLookEvery);
    if (stopped || too_much || wait == Nanos(0)) {
      result.end = stopped    ? ProcessResult::End::kStopped
                   : too_much ? ProcessResult::End::kTooMuch
                              : ProcessResult::End::kTimedOut;
      child.kill();
      drain(child, result);
      return result;  // ~Child waits for it
    }
    const std::size_t known = result.output.size();
    child.pump(poll_ms(wait), result);
    const bool said = result.output.size() > known && request.on_output;
    if (said && request.on_output(std::string_view(result.output).substr(known))) {
      deadline = Deadline(clock.now(), request.limit);
    }
  }
  result.wall = clock.now() - begin;
  take_usage(child.usage(), result);
  const Start start = child.start();
  result.inherited_bytes = start.most_kib * 1024;
  drain(child, result);
  const siginfo_t info = child.ended().value();
  result.end =
      info.si_code == CLD_EXITED ? ProcessResult::End::kExited : ProcessResult::End::kSignalled;
  result.code = info.si_status;
  result.out_of_memory = result.end == ProcessResult::End::kSignalled && result.code == SIGKILL &&
                         killed_for_memory().value_or(0) > killed_before.value_or(0);
  if (start.error != 0) {
    throw_environment(fmt::format("cannot start '{}': {}; give the path of a program",
                                  request.program.string(),
                                  std::strerror(static_cast<int>(start.error))));
  }
  return result;
}

std::string how_it_ended(const ProcessResult& process, Nanos limit) {
  switch (process.end) {
    case ProcessResult::End::kTimedOut:
      return fmt::format("timed out after {:.3g} s", to_s(limit));
    case ProcessResult::End::kTooMuch:
      return fmt::format("printed more than {} MiB", process.output.size() >> 20);
    case ProcessResult::End::kSignalled: {
      if (process.out_of_memory) {
        const auto limit_bytes = memory_limit_bytes();
        return limit_bytes ? fmt::format(
                                 "ran out of memory (its control group has {} MB; give the "
                                 "container more)",
                                 *limit_bytes >> 20)
                           : "ran out of memory (the kernel killed it; stop other programs)";
      }
      if (process.code == SIGXCPU) return "used up its processor time (raise it: ulimit -t)";
      const char* name = ::sigabbrev_np(process.code);
      return name != nullptr ? fmt::format("crashed (SIG{})", name)
                             : fmt::format("crashed (signal {})", process.code);
    }
    case ProcessResult::End::kStopped:
      return "was stopped";
    case ProcessResult::End::kExited:
      break;
  }
  return fmt::format("ended with code {}", process.code);
}

std::string one_line(std::string text, std::size_t longest) {
  std::ranges::replace_if(
      text, [](unsigned char c) { return c < ' '; }, ' ');
  while (!text.empty() && text.back() == ' ') text.pop_back();
  if (text.size() > longest) text = "..." + text.substr(text.size() - longest);
  return text;
}

}  // namespace pirt
