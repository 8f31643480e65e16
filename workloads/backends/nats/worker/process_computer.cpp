#include "workloads/backends/nats/worker/process_computer.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <list>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/child.h"

namespace pirt::cloud {
namespace {

// A call: a TaskBody; then, where the process says that it misses them, the parameters; then one of
// these. All are numbers of 8 bytes, and bytes with their length before them.
enum class Word : std::uint64_t { kMissesParameters = 1, kDone, kFailed };

/// What is longer is no message of the other end's.
constexpr std::uint64_t kMost = kMostBlobBytes;

class Line {
 public:
  explicit Line(int descriptor) : descriptor_(descriptor) {}

  [[nodiscard]] bool put(const void* data, std::size_t size) const {
    const auto* at = static_cast<const std::byte*>(data);
    while (size > 0) {
      const ssize_t sent = ::send(descriptor_, at, size, MSG_NOSIGNAL);
      if (sent < 0 && errno == EINTR) continue;
      if (sent <= 0) return false;
      at += sent;
      size -= static_cast<std::size_t>(sent);
    }
    return true;
  }
  [[nodiscard]] bool put(std::uint64_t number) const { return put(&number, sizeof number); }
  [[nodiscard]] bool put(ByteView bytes) const {
    return put(std::uint64_t{bytes.size()}) && put(bytes.data(), bytes.size());
  }
  [[nodiscard]] bool get(void* data, std::size_t size) const {
    auto* at = static_cast<std::byte*>(data);
    while (size > 0) {
      const ssize_t got = ::recv(descriptor_, at, size, 0);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return false;
      at += got;
      size -= static_cast<std::size_t>(got);
    }
    return true;
  }
  [[nodiscard]] bool get(std::uint64_t& number) const { return get(&number, sizeof number); }
  [[nodiscard]] bool get(Bytes& bytes) const {
    std::uint64_t size = 0;
    if (!get(size) || size > kMost) return false;
    bytes.resize(static_cast<std::size_t>(size));
    return get(bytes.data(), bytes.size());
  }

 private:
  int descriptor_;
};

class ProcessComputer : public Computer {
 public:
  ProcessComputer(std::string program, std::vector<std::string> arguments)
      : program_(std::move(program)), arguments_(std::move(arguments)) {}
  ~ProcessComputer() override { static_cast<void>(end()); }
  ProcessComputer(const ProcessComputer&) = delete;
  ProcessComputer& operator=(const ProcessComputer&) = delete;

  std::vector<Tensor> compute(const Workload& workload, const SharedTensors& parameters,
                              const Digest& content, std::span<const Tensor> inputs,
                              Nanos& took) override {
    if (process_ <= 0) start();
    const Bytes tensors = encode_tensors(inputs);
    Kind kind = kind_of(workload);
    TaskBody body{.workload = std::move(kind.name),
                  .sizes = std::move(kind.sizes),
                  .spec = spec_digest(workload),
                  .tensors = tensors};
    if (parameters != nullptr) body.parameters = Blob{content, 1, kLeastChunkBytes};
    const Line line(line_);
    std::uint64_t word = 0, nanos = 0;
    Bytes bytes;
    bool there = line.put(encode(body)) && line.get(word);
    if (there && word == static_cast<std::uint64_t>(Word::kMissesParameters)) {
      there = line.put(encode_tensors(*parameters)) && line.get(word);
    }
    there = there && line.get(nanos) && line.get(bytes);
    if (!there) throw_environment("its process " + end());
    if (word != static_cast<std::uint64_t>(Word::kDone)) {
      throw_environment(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
    }
    took = Nanos(static_cast<std::int64_t>(nanos));
    auto decoded = decode_tensors(bytes, workload.outputs);
    if (!decoded.value) throw_environment("its process gave no outputs: " + decoded.problem);
    return std::move(*decoded.value);
  }

 private:
  void start() {
    std::vector<std::string> words = {program_};
    words.insert(words.end(), arguments_.begin(), arguments_.end());
    std::vector<char*> raw;
    for (std::string& each : words) raw.push_back(each.data());
    raw.push_back(nullptr);
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
      throw_environment(fmt::format("no line to a process: {}", std::strerror(errno)));
    }
    const pid_t parent = ::getpid();
    process_ = ::fork();
    if (process_ == 0) {
      // Only what is safe between fork and exec.
      begin_child(parent, STDERR_FILENO + 1);
      ::setpgid(0, 0);  // a terminal's Ctrl-C is for the worker
      if (ends[1] == kSlotDescriptor) {
        ::fcntl(ends[1], F_SETFD, 0);
      } else {
        ::dup2(ends[1], kSlotDescriptor);
      }
      ::execv(raw[0], raw.data());
      ::_exit(127);
    }
    const int error = errno;
    ::close(ends[1]);
    line_ = ends[0];
    if (process_ > 0) return;
    ::close(std::exchange(line_, -1));
    throw_environment(fmt::format("no process could be started: {}", std::strerror(error)));
  }

  /// @return  How it ended.
  std::string end() {
    if (line_ >= 0) ::close(std::exchange(line_, -1));
    if (process_ <= 0) return "is not there";
    int status = 0;
    while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) continue;
    process_ = -1;
    if (WIFSIGNALED(status)) {
      const int signal = WTERMSIG(status);
      const char* const name = ::sigabbrev_np(signal);
      return fmt::format("died (SIG{})", name != nullptr ? name : std::to_string(signal));
    }
    return fmt::format("ended with code {}", WEXITSTATUS(status));
  }

  std::string program_;
  std::vector<std::string> arguments_;
  pid_t process_ = -1;
  int line_ = -1;
};

/// Parameters by content; those that were used longest ago go first.
class Kept {
 public:
  explicit Kept(std::uint64_t most_bytes) : most_bytes_(most_bytes) {}
  SharedTensors find(const Digest& content) {
    const auto at = std::ranges::find(entries_, content, &Entry::content);
    if (at == entries_.end()) return nullptr;
    entries_.splice(entries_.begin(), entries_, at);
    return at->tensors;
  }
  void add(const Digest& content, SharedTensors tensors, std::uint64_t bytes) {
    entries_.push_front({content, std::move(tensors), bytes});
    bytes_ += bytes;
    while (bytes_ > most_bytes_ && entries_.size() > 1) {
      bytes_ -= entries_.back().bytes;
      entries_.pop_back();
    }
  }

 private:
  struct Entry {
    Digest content;
    SharedTensors tensors;
    std::uint64_t bytes = 0;
  };
  std::uint64_t most_bytes_, bytes_ = 0;
  std::list<Entry> entries_;
};

/// @return  False once the line has ended.
bool get_parameters(const Line& line, const Workload& workload, const Digest& content, Kept& kept,
                    SharedTensors& parameters, std::string& problem) {
  Bytes bytes;
  if (!line.put(static_cast<std::uint64_t>(Word::kMissesParameters)) || !line.get(bytes)) {
    return false;
  }
  auto decoded = decode_tensors(bytes, workload.parameters);
  if (!decoded.value) {
    problem = decoded.problem;
    return true;
  }
  parameters = std::make_shared<const std::vector<Tensor>>(std::move(*decoded.value));
  kept.add(content, parameters, bytes.size());
  return true;
}

}  // namespace

std::unique_ptr<Computer> make_process_computer(std::string program,
                                                std::vector<std::string> arguments) {
  return std::make_unique<ProcessComputer>(std::move(program), std::move(arguments));
}

bool serve_computer(Computer& computer, std::span<const Workload* const> workloads,
                    std::uint64_t kept_bytes, int descriptor) {
  const Line line(descriptor);
  const Admission admission(workloads);
  Kept kept(kept_bytes);
  Bytes body;
  while (line.get(body)) {
    auto admitted = admission.admit(body);
    std::string problem = admitted.problem;
    Bytes made;
    Nanos took{0};
    if (admitted.value) {
      const Workload& workload = *admitted.value->workload;
      SharedTensors parameters;
      Digest content;
      if (admitted.value->parameters) {
        content = admitted.value->parameters->digest;
        parameters = kept.find(content);
        if (parameters == nullptr &&
            !get_parameters(line, workload, content, kept, parameters, problem)) {
          return false;
        }
      }
      try {
        if (problem.empty()) {
          made = encode_tensors(
              computer.compute(workload, parameters, content, admitted.value->inputs, took));
        }
      } catch (const std::exception& error) {
        problem = error.what();
        if (problem.empty()) problem = "an error without words";
      }
    }
    if (!problem.empty()) {
      const ByteView text = std::as_bytes(std::span(problem));
      made.assign(text.begin(), text.end());
    }
    const Word word = problem.empty() ? Word::kDone : Word::kFailed;
    if (!line.put(static_cast<std::uint64_t>(word)) ||
        !line.put(static_cast<std::uint64_t>(took.count())) || !line.put(ByteView(made))) {
      return false;
    }
  }
  return true;
}

}  // namespace pirt::cloud
