#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "workloads/backends/nats/service/computer.h"
#include "workloads/base/system/child.h"
#include "workloads/base/system/file_descriptor.h"

namespace pirt::cloud {
namespace {

// First nothing, with its length: it is ready.
// A call: the robot's name, a frame with the task, and its parameters, or nothing; then a frame
// with the reply. Each with its length before it.

constexpr std::uint64_t kMostFrame = kMostBlobBytes + (1 << 20);

class Line {
 public:
  /// @param goes_on  Asked several times a second while the other end says nothing; may be empty.
  explicit Line(int descriptor, std::function<bool()> goes_on = {})
      : descriptor_(descriptor), goes_on_(std::move(goes_on)) {}

  [[nodiscard]] bool put(ByteView bytes) const {
    const std::uint64_t size = bytes.size();
    return put_all(std::as_bytes(std::span(&size, 1))) && put_all(bytes);
  }
  /// @param most  Of bytes: more is no message of the other end's.
  [[nodiscard]] bool get(Bytes& bytes, std::uint64_t most) const {
    std::uint64_t size = 0;
    if (!get_all(std::as_writable_bytes(std::span(&size, 1))) || size > most) return false;
    bytes.resize(static_cast<std::size_t>(size));
    return get_all(bytes);
  }

 private:
  [[nodiscard]] bool put_all(ByteView bytes) const {
    return all(POLLOUT, bytes.size(), [&](std::size_t done) {
      const ByteView left = bytes.subspan(done);
      return ::send(descriptor_, left.data(), left.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    });
  }
  [[nodiscard]] bool get_all(std::span<std::byte> bytes) const {
    return all(POLLIN, bytes.size(), [&](std::size_t done) {
      const auto left = bytes.subspan(done);
      return ::recv(descriptor_, left.data(), left.size(), MSG_DONTWAIT);
    });
  }
  template <typename Move>
  [[nodiscard]] bool all(short events, std::size_t size, const Move& move) const {
    constexpr int kLookMs = 100;
    for (std::size_t done = 0; done < size;) {
      if (goes_on_ && !goes_on_()) return false;
      pollfd ready{descriptor_, events, 0};
      if (::poll(&ready, 1, goes_on_ ? kLookMs : -1) == 0) continue;
      const ssize_t moved = move(done);
      if (moved < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      if (moved <= 0) return false;
      done += static_cast<std::size_t>(moved);
    }
    return true;
  }

  int descriptor_;
  std::function<bool()> goes_on_;
};

class ProcessComputer : public Computer {
 public:
  explicit ProcessComputer(SlotProgram program) : program_(std::move(program)) {}
  ~ProcessComputer() override { static_cast<void>(end()); }

  ReplyMessage compute(const Call& call) override {
    if (process_ <= 0) {
      if (const std::string how = start(call); !how.empty()) {
        return later("a slot of the worker could not start (its output says why): " + how);
      }
    }
    const auto own = program_.call_limits.find(call.workload.get());
    const Nanos limit = own != program_.call_limits.end() ? own->second : program_.call_limit;
    Nanos until = clock_.now() + limit;
    bool ends = false;
    const Line line(line_.get(), [&] {
      if (!ends && call.stop())
        ends = true, until = std::min(until, clock_.now() + program_.end_limit);
      return clock_.now() < until;
    });
    try {
      if (auto reply = exchange(line, call)) return *std::move(reply);
    } catch (...) {  // What it was in the middle of would be taken for the next call's.
      static_cast<void>(end(true));
      throw;
    }
    const bool over = clock_.now() >= until;
    const std::string how = end(over);
    if (over && ends) return later("the worker ends");
    throw ProcessGone(over ? fmt::format("it was over its limit of {:.3g} s (pirt cloud-worker "
                                         "--call-limit, --profile): its process was killed",
                                         to_s(limit))
                           : "its process " + how);
  }

 private:
  static ReplyMessage later(std::string why) {
    return {.kind = ReplyKind::kLater, .problem = std::move(why)};
  }

  /// @return  None once the line has ended.
  static std::optional<ReplyMessage> exchange(const Line& line, const Call& call) {
    const std::uint64_t most = encoded_bytes(call.workload->outputs) + (64 << 10);
    Bytes bytes;
    if (!line.put(std::as_bytes(std::span(call.robot))) || !line.put(encode(call.task)) ||
        !line.put(call.parameters) || !line.get(bytes, most)) {
      return std::nullopt;
    }
    auto said = decode_as<ReplyMessage>(bytes).value;
    if (said && said->outputs.blob) return std::nullopt;
    return said;
  }

  /// Until the process says that it computes. One that does not is no fault of the call's.
  /// @return  Why it does not; empty = it does.
  std::string start(const Call& call) {
    constexpr Nanos kStart = std::chrono::seconds(60), kAgain = std::chrono::seconds(1);
    std::string how = spawn();
    if (how.empty()) {
      const Nanos until = clock_.now() + kStart;
      Bytes none;
      const Line line(line_.get(), [&] { return !call.stop() && clock_.now() < until; });
      if (line.get(none, 0)) return "";
      how = "its process " + end(true);
    }
    // It would be claimed again at once.
    for (const Nanos next = clock_.now() + kAgain; !call.stop() && clock_.now() < next;) {
      ::usleep(10'000);
    }
    return how;
  }

  /// @return  Why there is no process; empty = there is.
  std::string spawn() {
    std::vector<char*> raw = {program_.program.data()};
    for (std::string& each : program_.arguments) raw.push_back(each.data());
    raw.push_back(nullptr);
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
      return fmt::format("no line to a process: {}", std::strerror(errno));
    }
    line_ = FileDescriptor(ends[0]);
    const FileDescriptor theirs(ends[1]);
    const pid_t parent = ::getpid();
    process_ = ::fork();
    if (process_ == 0) {
      // Only what is safe between fork and exec.
      begin_child(parent, STDERR_FILENO + 1);
      ::setpgid(0, 0);  // a terminal's Ctrl-C is for the worker
      if (theirs.get() == kSlotDescriptor) {
        ::fcntl(kSlotDescriptor, F_SETFD, 0);
      } else {
        ::dup2(theirs.get(), kSlotDescriptor);
      }
      ::execv(raw[0], raw.data());
      ::_exit(127);
    }
    if (process_ < 0) {
      return fmt::format("no process could be started: {}", std::strerror(errno));
    }
    return "";
  }

  /// Kills it, if it does not end with its line, or at once. @return  How it ended.
  std::string end(bool at_once = false) {
    if (at_once && process_ > 0) ::kill(process_, SIGKILL);
    line_.close();
    if (process_ <= 0) return "is not there";
    int status = 0;
    const Nanos until = clock_.now() + program_.end_limit;
    while (::waitpid(process_, &status, WNOHANG) == 0) {
      if (clock_.now() >= until) ::kill(process_, SIGKILL);
      ::usleep(1000);
    }
    process_ = -1;
    if (WIFSIGNALED(status)) {
      const int signal = WTERMSIG(status);
      const char* const name = ::sigabbrev_np(signal);
      return fmt::format("died (SIG{})", name != nullptr ? name : std::to_string(signal));
    }
    return fmt::format("ended with code {}", WEXITSTATUS(status));
  }

  SlotProgram program_;
  MachineClock clock_;
  pid_t process_ = -1;
  FileDescriptor line_;
};

}  // namespace

std::unique_ptr<Computer> make_process_computer(SlotProgram program) {
  return std::make_unique<ProcessComputer>(std::move(program));
}

bool serve_computer(Computer& computer, const Admission& admission, int descriptor) {
  const Line line(descriptor);
  if (!line.put({})) return true;
  Bytes name, frame;
  while (line.get(name, 64) && line.get(frame, kMostFrame)) {
    Bytes parameters;  // Of this call: what is kept of them is the computer's.
    if (!line.get(parameters, kMostFrame)) break;
    const std::string robot(reinterpret_cast<const char*>(name.data()), name.size());
    const auto task = decode_as<TaskMessage>(frame);
    if (!task.value) return false;
    ReplyMessage reply;
    try {
      const auto workload = admission.admit(*task.value);
      if (workload.value && !task.value->inputs.blob) {
        reply = computer.compute({robot, *task.value, *workload.value, parameters});
      } else {
        reply = {.kind = ReplyKind::kRefused,
                 .problem = workload.value ? "its inputs are elsewhere" : workload.problem};
      }
    } catch (const std::exception& error) {
      reply = {.kind = ReplyKind::kFailedTry, .problem = error.what()};
      if (reply.problem.empty()) reply.problem = "an error without words";
    }
    if (!line.put(encode(reply))) return false;
  }
  return true;
}

}  // namespace pirt::cloud
