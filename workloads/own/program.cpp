#include "workloads/own/program.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <ctime>
#include <fstream>
#include <numeric>
#include <optional>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/system/child.h"
#include "workloads/base/system/deadline.h"
#include "workloads/base/system/file_descriptor.h"
#include "workloads/base/system/pipe.h"
#include "workloads/base/system/shared_memory.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/slices.h"

namespace pirt::own {
namespace {

constexpr int kMemory = 3;  ///< The program's descriptor of it.
constexpr std::size_t kLongestLine = std::size_t{1} << 20;
constexpr int kNullCalls = 32;

[[noreturn]] void throw_errno(const std::string& doing) {
  throw_environment(fmt::format("cannot {}: {}", doing, std::strerror(errno)));
}

[[noreturn]] void throw_failed(const Program& program, const std::string& how) {
  throw_environment(fmt::format("{}: {} {}", program.workload, join(program.command, " "), how));
}

/// Where the tensors lie in the memory that is shared, each on a page of its own.
struct Layout {
  std::vector<std::size_t> inputs, parameters, outputs;
  std::size_t bytes = 0;
};

Layout layout_of(const Program& program) {
  constexpr std::size_t kPage = 4096;
  Layout layout;
  const auto place = [&layout](const std::vector<TensorSpec>& specs,
                               std::vector<std::size_t>& offsets) {
    for (const TensorSpec& spec : specs) {
      offsets.push_back(layout.bytes);
      const auto size = static_cast<std::size_t>(spec.size_bytes());
      layout.bytes += (size + kPage - 1) / kPage * kPage;
    }
  };
  place(program.inputs, layout.inputs);
  place(program.parameters, layout.parameters);
  place(program.outputs, layout.outputs);
  return layout;
}

/// The running program.
class Process {
 public:
  Process(const Program& program, const SharedMemory& memory)
      : program_(program), shared_bytes_(static_cast<std::int64_t>(memory.bytes())) {
    Pipe in = make_pipe();
    Pipe out = make_pipe();
    to_ = std::move(in.write);
    from_ = std::move(out.read);
    ::fcntl(to_.get(), F_SETFL, O_NONBLOCK);  // One that does not read holds up nobody.

    pid_ = start_child(program.command, {in.read.get(), out.write.get(), -1, memory.fd()},
                       program.folder.c_str());
    if (pid_ < 0) throw_errno("start " + program.command.front());
    watch();
  }
  /// It may end by itself for a moment.
  ~Process() {
    to_.close();
    constexpr int kWaits = 100;
    for (int i = 0; i < kWaits && !has_ended(); ++i) ::poll(nullptr, 0, 10);
    end();
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Its answer to a line.
  /// @throws Error{kEnvironment} if there is none in time; it is over then.
  [[nodiscard]] Json ask(const Json& line, Nanos limit) {
    if (!buffer_.empty()) {
      fail("said something that it was not asked for: " + shown(buffer_));
    }
    Deadline deadline(clock_.now(), limit);
    put(json_text(line) + "\n", deadline, limit);
    return get(deadline, limit);
  }

  /// Bytes of its own that it has had at most, without the tensors, which are this process' as
  /// well, and the processor time of its threads so far; not of what it started.
  [[nodiscard]] std::optional<std::int64_t> peak_bytes() const {
    std::ifstream status(fmt::format("/proc/{}/status", pid_));
    std::optional<std::int64_t> peak;
    for (std::string line; std::getline(status, line);) {
      std::int64_t kib = 0;
      if (std::sscanf(line.c_str(), "VmHWM: %ld kB", &kib) == 1) peak = kib << 10;
      if (!peak || std::sscanf(line.c_str(), "RssShmem: %ld kB", &kib) != 1) continue;
      return std::max<std::int64_t>(0, *peak - std::min(kib << 10, shared_bytes_));
    }
    return peak;
  }
  [[nodiscard]] Nanos processor_time() const {
    clockid_t clock{};
    timespec all{};
    if (::clock_getcpuclockid(pid_, &clock) != 0 || ::clock_gettime(clock, &all) != 0) return {};
    return std::chrono::seconds(all.tv_sec) + Nanos(all.tv_nsec);
  }

 private:
  static std::string shown(const std::string& text) { return printable(text.substr(0, 80)); }

  /// It is reaped last, so that its group's number cannot be somebody else's by now.
  [[nodiscard]] bool has_ended() const {
    if (pid_ <= 0) return true;
    siginfo_t info{};
    const int got = ::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
    return got == 0 ? info.si_pid == pid_ : errno == ECHILD;
  }

  /// Has one in the program's group end all of it when this process ends, however it does: the
  /// program dies with us, and not what it has started. It notices by a pipe of which we alone keep
  /// the other end.
  void watch() {
    std::array<int, 2> life{};
    if (::pipe2(life.data(), O_CLOEXEC) != 0) return;  // Without one nobody watches.
    const FileDescriptor read_end(life[0]);
    life_ = FileDescriptor(life[1]);
    const pid_t group = pid_;
    watcher_ = ::fork();
    if (watcher_ != 0) return;
    if (::setpgid(0, group) != 0) ::_exit(0);  // It has ended already.
    ::dup2(read_end.get(), STDIN_FILENO);
    ::fcntl(STDIN_FILENO, F_SETFD, 0);
    ::close_range(STDOUT_FILENO, ~0U, 0);
    // Another image: a copy of this process would keep the memory that this one gives up.
    ::execl("/bin/sh", "sh", "-c", "read -r unused; kill -9 0", static_cast<char*>(nullptr));
    char unused = 0;
    while (::read(STDIN_FILENO, &unused, 1) < 0 && errno == EINTR) {
    }
    ::kill(0, SIGKILL);
    ::_exit(0);
  }

  /// With what it has started.
  void end() {
    if (pid_ <= 0) return;
    ::kill(-pid_, SIGKILL);
    for (const pid_t each : {pid_, watcher_}) {
      if (each <= 0) continue;
      ::kill(each, SIGKILL);
      int status = 0;
      pid_t got = 0;
      while ((got = ::waitpid(each, &status, 0)) < 0 && errno == EINTR) {
      }
      if (got == pid_) status_ = status;
    }
    pid_ = watcher_ = 0;
  }

  [[noreturn]] void fail(const std::string& how) {
    end();
    throw_failed(program_, how);
  }
  [[noreturn]] void fail_ended() {
    // Its end of the pipe may close a moment before it is gone.
    for (int i = 0; i < 500 && !has_ended(); ++i) ::poll(nullptr, 0, 10);
    if (!has_ended()) fail("closed its standard output");
    end();
    if (status_ && WIFEXITED(*status_) && WEXITSTATUS(*status_) == 127) {
      fail(fmt::format("cannot be started; '{}' is looked for in PATH, and with a '/' in {}",
                       program_.command.front(), program_.folder.string()));
    }
    fail(how_ended(status_));
  }

  void put(std::string_view text, Deadline& deadline, Nanos limit) {
    const WithoutSigpipe quiet;
    while (!text.empty()) {
      const ssize_t put = ::write(to_.get(), text.data(), text.size());
      if (put > 0) {
        text.remove_prefix(static_cast<std::size_t>(put));
      } else if (errno == EAGAIN) {
        if (wait(to_, POLLOUT, deadline)) continue;
        fail(fmt::format("did not read what it was asked in {:.3g} s", to_s(limit)));
      } else if (errno != EINTR) {
        fail_ended();
      }
    }
  }

  /// Until it can be read or written; false if it is too late.
  /// @throws Error{kEnvironment} if the call is stopped, or the program has ended.
  bool wait(const FileDescriptor& of, short what, Deadline& deadline) {
    for (;;) {
      if (stop_of_call().stop_requested()) fail("was stopped");
      constexpr Nanos kLook = std::chrono::milliseconds(50);
      const Nanos span = deadline.next_wait(clock_.now(), kLook);
      pollfd ready{of.get(), what, 0};
      if (::poll(&ready, 1, poll_ms(span)) > 0) return true;
      if (has_ended()) fail_ended();  // What it started may hold the pipe open.
      if (span == Nanos(0)) return false;
    }
  }

  Json get(Deadline& deadline, Nanos limit) {
    for (;;) {
      if (const auto end = buffer_.find('\n'); end != std::string::npos) {
        const std::string line = buffer_.substr(0, end);
        buffer_.erase(0, end + 1);
        const auto json = try_parse_json(line);
        if (json && json->is_object()) return *json;
        fail("answered with what is no JSON object: " + shown(line) +
             "; its standard output is for answers, standard error for the rest");
      }
      if (buffer_.size() > kLongestLine) fail("answers with a line of more than 1 MiB");
      if (!wait(from_, POLLIN, deadline)) {
        fail(fmt::format("did not answer in {:.3g} s{}", to_s(limit),
                         buffer_.empty() ? "" : ", but for half a line: " + shown(buffer_)));
      }
      std::array<char, 4096> bytes{};
      const ssize_t got = ::read(from_.get(), bytes.data(), bytes.size());
      if (got == 0) fail_ended();
      if (got > 0) buffer_.append(bytes.data(), static_cast<std::size_t>(got));
    }
  }

  const Program& program_;
  std::int64_t shared_bytes_;
  FileDescriptor to_, from_;
  FileDescriptor life_;
  pid_t pid_ = 0, watcher_ = 0;
  std::optional<int> status_;  ///< How it ended; absent where another one has asked.
  std::string buffer_;
  MachineClock clock_;
};

Json tensor_json(const TensorSpec& spec, const char* role, std::size_t offset) {
  Json json = {{"name", spec.name},
               {"role", role},
               {"dtype", pirt::to_string(spec.element)},
               {"shape", spec.shape},
               {"offset", offset}};
  if (spec.varies) json["varies"] = true;
  return json;
}

class ProgramKernel final : public Kernel, public OtherProcess {
 public:
  ProgramKernel(Program program, std::span<const Tensor> parameters, int threads)
      : program_(std::move(program)),
        layout_(layout_of(program_)),
        memory_("pirt", std::max<std::size_t>(layout_.bytes, 1)),
        threads_(threads),
        parameters_(copy_tensors(parameters)) {
    start();
  }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) compute();
    return std::nullopt;
  }

  void scribble(std::byte with) override {
    for (std::size_t i = 0; i < layout_.outputs.size(); ++i) {
      std::fill_n(memory_.data() + layout_.outputs[i], program_.outputs[i].size_bytes(), with);
    }
  }

  [[nodiscard]] std::optional<std::int64_t> peak_bytes() const override {
    return process_ ? process_->peak_bytes() : std::nullopt;
  }
  [[nodiscard]] std::optional<Nanos> processor_time() const override {
    return process_ ? std::optional(process_->processor_time()) : std::nullopt;
  }

  [[nodiscard]] std::vector<std::string> remarks() const override {
    if (!process_) return {};
    std::string text = fmt::format("program: a null call {:.3g} us", 1e6 * to_s(null_call_));
    if (calls_ > 0) {
      const Nanos used = process_->processor_time() - before_calls_;
      text += fmt::format(", {:.3g} ms of processor time a call", to_ms(used / calls_));
    }
    if (const auto peak = peak_bytes()) {
      text += fmt::format(", {:.1f} MiB at most", static_cast<double>(*peak) / (1 << 20));
    }
    return {text};
  }

 private:
  void start() {
    // One that ran before may have written to them.
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      std::ranges::copy(parameters_[i].bytes(), memory_.data() + layout_.parameters[i]);
    }
    process_.emplace(program_, memory_);
    try {
      greet();
    } catch (...) {
      process_.reset();  // It is not ready.
      throw;
    }
  }

  void greet() {
    Json tensors = Json::array();
    const auto add = [&tensors](const std::vector<TensorSpec>& specs, const char* role,
                                const std::vector<std::size_t>& offsets) {
      for (std::size_t i = 0; i < specs.size(); ++i) {
        tensors.push_back(tensor_json(specs[i], role, offsets[i]));
      }
    };
    add(program_.inputs, "input", layout_.inputs);
    add(program_.parameters, "parameter", layout_.parameters);
    add(program_.outputs, "output", layout_.outputs);
    const Json answer = ask({{"pirt", 1},
                             {"workload", program_.workload},
                             {"threads", threads_},
                             {"memory", fmt::format("/proc/self/fd/{}", kMemory)},
                             {"bytes", memory_.bytes()},
                             {"tensors", tensors}},
                            program_.start_limit);
    if (!answer.contains("ready")) fail("answered neither with `ready` nor with `error`");
    std::vector<Nanos> times;
    const MachineClock clock;
    for (int i = 0; i < kNullCalls; ++i) {
      const Nanos begin = clock.now();
      expect_done(ask({{"null", ++number_}}, program_.call_limit));
      times.push_back(clock.now() - begin);
    }
    std::ranges::nth_element(times, times.begin() + kNullCalls / 2);
    null_call_ = times[kNullCalls / 2];
    calls_ = 0;
    before_calls_ = process_->processor_time();
  }

  void compute() {
    if (!process_) start();
    Json line = {{"call", ++number_}};
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      std::ranges::copy(inputs_[i].used_bytes(), memory_.data() + layout_.inputs[i]);
      if (inputs_[i].spec().varies) line["rows"][inputs_[i].spec().name] = inputs_[i].rows();
    }
    const Json answer = ask(line, program_.call_limit);
    expect_done(answer);
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      Tensor& output = outputs_[i];
      if (output.spec().varies) output.set_rows(rows_of(answer, output.spec()));
      const auto bytes = output.used_bytes().size();
      std::copy_n(memory_.data() + layout_.outputs[i], bytes, output.data());
    }
    ++calls_;
  }

  std::int64_t rows_of(const Json& answer, const TensorSpec& spec) {
    try {
      const auto rows = answer.at("rows").at(spec.name).get<std::int64_t>();
      if (rows >= 0 && rows <= spec.shape.front()) return rows;
    } catch (const JsonError&) {
    }
    fail(fmt::format("did not say in `rows` how many of {} there are", spec.describe()));
  }

  /// @throws Error{kEnvironment} for an answer that is an error, of a call CallFailed; as
  /// Process::ask.
  Json ask(const Json& line, Nanos limit) {
    Json answer;
    try {
      answer = process_->ask(line, limit);
    } catch (...) {
      process_.reset();
      throw;
    }
    if (answer.contains("error")) {
      const Json& error = answer.at("error");
      const std::string why =
          fmt::format("{}: {}", program_.workload,
                      error.is_string() ? error.get<std::string>() : json_text(error));
      if (line.contains("call")) throw CallFailed(why);
      throw_environment(why);
    }
    return answer;
  }

  void expect_done(const Json& answer) {
    const bool done = answer.contains("done") && answer.at("done").is_number_integer() &&
                      answer.at("done").get<std::int64_t>() == number_;
    if (!done) fail(fmt::format("did not answer with {{\"done\": {}}}", number_));
  }

  /// What it says next would be of another call.
  [[noreturn]] void fail(const std::string& how) {
    process_.reset();
    throw_failed(program_, how);
  }

  Program program_;
  Layout layout_;
  SharedMemory memory_;
  int threads_;
  std::vector<Tensor> parameters_;
  std::optional<Process> process_;  ///< None: the next call starts it.
  std::int64_t number_ = 0;
  std::int64_t calls_ = 0;  ///< Since it was started.
  Nanos null_call_{0}, before_calls_{0};
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
};

}  // namespace

std::unique_ptr<Kernel> make_program_kernel(const Program& program,
                                            std::span<const Tensor> parameters, int threads) {
  return std::make_unique<ProgramKernel>(program, parameters, threads);
}

}  // namespace pirt::own
