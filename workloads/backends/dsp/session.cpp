#include "workloads/backends/dsp/session.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "workloads/backends/dsp/elf.h"
#include "workloads/backends/dsp/tools.h"
#include "workloads/base/contract.h"
#include "workloads/base/error.h"
#include "workloads/base/system/child.h"
#include "workloads/base/system/deadline.h"
#include "workloads/base/system/pipe.h"

namespace pirt::dsp {
namespace {

// Kernels load whole vectors around the edges of a picture, whose bytes they then leave out: there
// must be something.
constexpr std::size_t kGuardBytes = 4096;
constexpr std::size_t kSaidKept = 400;

[[noreturn]] void throw_system(std::string_view doing) {
  throw_environment(
      fmt::format("cannot {} for qemu-hexagon: {}; check the limits on processes, open files and "
                  "memory",
                  doing, std::strerror(errno)));
}

FileDescriptor empty_memory_file(const char* name) {
  FileDescriptor file(::memfd_create(name, MFD_CLOEXEC));
  if (file.get() < 0) throw_system("make a file in memory");
  return file;
}

/// Descriptors as the child shall have them: (ours, its).
using Inherited = std::array<std::pair<int, int>, 7>;

/// Between fork and exec; only calls that POSIX allows there.
[[noreturn]] void become(char* const* words, const Inherited& inherited, pid_t parent) {
  begin_child(parent, STDERR_FILENO + 1);
  for (const auto& [ours, its] : inherited) {
    if (::dup2(ours, its) < 0) ::_exit(127);
  }
  ::execv(words[0], words);
  ::_exit(127);
}

bool write_all(int fd, const void* data, std::size_t bytes) {
  const WithoutSigpipe guard;
  while (true) {
    const auto n = ::write(fd, data, bytes);
    if (n >= 0) return static_cast<std::size_t>(n) == bytes;
    if (errno != EINTR) return false;
  }
}

void check_file(const std::filesystem::path& path, std::string_view what, std::string_view remedy) {
  if (std::error_code unknown; !std::filesystem::is_regular_file(path, unknown)) {
    throw_environment(fmt::format("{} '{}' is missing; {}", what, path.string(), remedy));
  }
}

Cost cost_of(const PirtDspCounts& counts) {
  return {static_cast<std::int64_t>(counts.packets), static_cast<std::int64_t>(counts.lines),
          static_cast<std::int64_t>(counts.misses)};
}

std::string plugin_with_arguments(const SessionOptions& options) {
  std::string text = "file=" + quoted(options.plugin);
  if (options.models_memory) text += ",memory=on";
  if (!options.profile.empty()) text += ",profile=" + quoted(options.profile);
  return text;
}

/// The options of a session whose files are there.
SessionOptions checked(SessionOptions options) {
  check_file(options.emulator, "the emulator", "install qemu-user");
  check_file(options.plugin, "the plugin that counts packets", "build pirt again");
  check_file(options.program, "the Hexagon program", "build pirt again");
  check_hexagon_elf(options.program);
  return options;
}

}  // namespace

ProgramSession::ProgramSession(SessionOptions options)
    : options_(checked(std::move(options))),
      mapping_("pirt-dsp", options_.mapping_bytes),
      counts_page_("pirt-dsp-counts", sizeof(PirtDspCountsPage)),
      said_(empty_memory_file("pirt-dsp-said")) {
  free_all();
  try {
    start();
  } catch (...) {
    stop();
    throw;
  }
}

ProgramSession::~ProgramSession() { stop(); }

PirtDspCountsPage ProgramSession::counts() const {
  PirtDspCountsPage page;
  std::memcpy(&page, counts_page_.data(), sizeof(page));
  return page;
}

void ProgramSession::start() {
  stop();
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  if (files.rlim_cur <= PIRT_DSP_COUNTS_FD) {
    throw_environment(
        fmt::format("qemu-hexagon gets descriptors up to {}, and the limit on open files is {}; "
                    "raise it (ulimit -n 256)",
                    PIRT_DSP_COUNTS_FD, files.rlim_cur));
  }
  if (::ftruncate(said_.get(), 0) != 0) throw_system("clear a file in memory");
  std::memset(counts_page_.data(), 0, sizeof(PirtDspCountsPage));
  std::array<std::string, 4> words = {options_.emulator.string(), "-plugin",
                                      plugin_with_arguments(options_), options_.program.string()};
  std::array<char*, 5> arguments{};
  std::ranges::transform(words, arguments.begin(), [](std::string& word) { return word.data(); });
  const FileDescriptor nothing(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  Pipe commands = make_pipe();
  Pipe replies = make_pipe();
  // qemu, and glib within it, speak on both streams.
  const Inherited inherited = {{{nothing.get(), STDIN_FILENO},
                                {said_.get(), STDOUT_FILENO},
                                {said_.get(), STDERR_FILENO},
                                {mapping_.fd(), PIRT_DSP_MAPPING_FD},
                                {commands.read.get(), PIRT_DSP_COMMAND_FD},
                                {replies.write.get(), PIRT_DSP_REPLY_FD},
                                {counts_page_.fd(), PIRT_DSP_COUNTS_FD}}};
  const pid_t self = ::getpid();
  process_ = ::fork();
  if (process_ < 0) throw_system("start a process");
  if (process_ == 0) become(arguments.data(), inherited, self);
  commands_ = std::move(commands.write);
  replies_ = std::move(replies.read);
  commands.read.close();  // or its end would not be seen
  replies.write.close();

  PirtDspCommand map{};
  map.serial = ++serial_;
  map.kernel = PIRT_DSP_MAP;
  map.values[0] = static_cast<std::int32_t>(options_.mapping_bytes);
  static_cast<void>(exchange(map, "map the shared memory"));
  if (counts().magic != PIRT_DSP_COUNTS_MAGIC) {
    stop();
    throw_environment(fmt::format(
        "qemu-hexagon runs without its plugin '{}', so that nothing is counted; install a "
        "qemu-user whose plugins are enabled (that of Debian 12)",
        options_.plugin.string()));
  }
  start_cost_ = cost_of(counts().total);
}

/// Ends the program whatever it is doing. Closing its commands would do where it waits for one.
void ProgramSession::stop() {
  commands_.close();
  replies_.close();
  if (process_ > 0) {
    ::kill(process_, SIGKILL);
    while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  process_ = -1;
}

Buffer ProgramSession::allocate(std::size_t bytes, std::string_view what) {
  constexpr std::size_t kUnit = PIRT_DSP_ALIGNMENT;
  const std::size_t needed = (bytes + kUnit - 1) / kUnit * kUnit + kUnit;
  if (needed + kGuardBytes > options_.mapping_bytes - used_) {
    throw_environment(fmt::format(
        "{} needs {} bytes, and of the {} bytes that host and DSP share {} are taken; this backend "
        "is for smaller workloads",
        what, bytes, options_.mapping_bytes, used_));
  }
  const Buffer buffer{static_cast<std::uint32_t>(used_), static_cast<std::uint32_t>(bytes)};
  used_ += needed;
  return buffer;
}

void ProgramSession::free_all() { used_ = kGuardBytes; }

std::span<std::byte> ProgramSession::bytes(Buffer buffer) const {
  return {mapping_.data() + buffer.offset, buffer.bytes};
}

Cost ProgramSession::run(std::uint32_t kernel, std::span<const Buffer> buffers,
                         std::span<const std::int32_t> values, std::string_view name) {
  expect(buffers.size() <= PIRT_DSP_MAX_BUFFERS && values.size() <= PIRT_DSP_MAX_VALUES,
         "more buffers or values than a command has room for");
  if (process_ < 0) start();
  PirtDspCommand command{};
  command.serial = ++serial_;
  command.kernel = kernel;
  for (std::size_t i = 0; i < buffers.size(); ++i) {
    command.buffers[i] = {buffers[i].offset, buffers[i].bytes};
  }
  std::ranges::copy(values, std::begin(command.values));
  return exchange(command, name);
}

Cost ProgramSession::exchange(const PirtDspCommand& command, std::string_view name) {
  static_assert(sizeof(PirtDspCommand) <= 4096, "longer than what a pipe passes in one piece");
  PirtDspReply reply{};
  if (!write_all(commands_.get(), &command, sizeof(command))) fail_call(name, how_it_ended());
  const bool is_first = command.kernel == PIRT_DSP_MAP;
  wait_for_reply(reply, name,
                 is_first ? std::min(options_.limit, options_.start_limit) : options_.limit);
  if (reply.serial != command.serial) fail_call(name, "answered another command");
  switch (reply.status) {
    case PIRT_DSP_OK:
      return cost_of(counts().command);
    case PIRT_DSP_NO_SUCH_KERNEL:
      throw_environment(
          fmt::format("the Hexagon program has no kernel '{}'; build pirt again", name));
    case PIRT_DSP_OUTSIDE_MAPPING:
      throw_environment(fmt::format(
          "DSP kernel '{}': buffer {} lies outside the {} bytes that host and DSP share", name,
          reply.detail, options_.mapping_bytes));
    default:
      throw_environment(fmt::format("the Hexagon program cannot map the {} bytes to share: {}",
                                    options_.mapping_bytes,
                                    std::strerror(static_cast<int>(reply.detail))));
  }
}

void ProgramSession::wait_for_reply(PirtDspReply& reply, std::string_view name, Nanos limit) {
  const MachineClock clock;
  Deadline deadline(clock.now(), limit);
  while (true) {
    const Nanos wait = deadline.next_wait(clock.now(), std::chrono::seconds(1));
    pollfd stream{replies_.get(), POLLIN, 0};
    if (::poll(&stream, 1, poll_ms(wait)) <= 0) {
      if (wait > Nanos(0)) continue;  // EINTR, or time to look at the limit
      fail_call(name, fmt::format("gave no answer within {:.3g} s and was ended", to_s(limit)));
    }
    const auto n = ::read(replies_.get(), &reply, sizeof(reply));
    if (n == sizeof(reply)) return;
    if (n < 0 && errno == EINTR) continue;
    fail_call(name, how_it_ended());
  }
}

void ProgramSession::fail_call(std::string_view name, std::string_view how) {
  stop();
  throw_environment(fmt::format("DSP kernel '{}': the Hexagon program {}", name, how));
}

/// Of a program that has closed its end: with what it said.
std::string ProgramSession::how_it_ended() {
  int status = 0;
  ::kill(process_, SIGKILL);  // of no effect on one that ended by itself
  pid_t got = 0;
  while ((got = ::waitpid(process_, &status, 0)) < 0 && errno == EINTR) {
  }
  process_ = -1;
  const std::string how = how_ended(got < 0 ? std::nullopt : std::optional(status));
  std::array<char, kSaidKept> text{};
  const auto n = ::pread(said_.get(), text.data(), text.size(), 0);
  std::string said(text.data(), n > 0 ? static_cast<std::size_t>(n) : 0);
  std::ranges::replace_if(
      said, [](char c) { return c < ' '; }, ' ');
  while (!said.empty() && said.back() == ' ') said.pop_back();
  return said.empty() ? how : how + ", saying: " + said;
}

}  // namespace pirt::dsp
