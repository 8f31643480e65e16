#include "workloads/backends/dsp/tools.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <iterator>
#include <thread>

#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/system/deadline.h"
#include "workloads/base/system/file_descriptor.h"
#include "workloads/base/system/module.h"
#include "workloads/base/system/program_path.h"

namespace pirt::dsp {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEmulator = "qemu-hexagon";
constexpr const char* kPlugin = "pirt_dsp_count.so";
constexpr const char* kProgram = "pirt_dsp.elf";

fs::path find_own(const char* name) {
  std::error_code unknown;
  for (const fs::path& folder : module_folders()) {
    if (fs::is_regular_file(folder / name, unknown)) return folder / name;
  }
  return {};
}

std::string what_is_missing(const Tools& tools) {
  if (tools.emulator.empty()) return "qemu-hexagon is not in PATH; install qemu-user";
  for (const auto& [path, name] : {std::pair(&tools.plugin, kPlugin), {&tools.program, kProgram}}) {
    if (!path->empty()) continue;
    return fmt::format("{} is neither installed with pirt nor in {}; install or build pirt again",
                       name, module_folders().front().string());
  }
  return "";
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

constexpr auto kAnswerLimit = std::chrono::seconds(3);  // it answers in 20 ms
constexpr auto kLookEvery = std::chrono::milliseconds(2);

/// `EMULATOR -plugin PLUGIN --version`, which loads none, in a process group of its own, since it
/// may be a script.
pid_t start_asking(std::string path, std::string plugin, int said) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, said, STDOUT_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, said, STDERR_FILENO);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  std::string takes = "-plugin", asks = "--version";
  const std::array<char*, 5> words = {path.data(), takes.data(), plugin.data(), asks.data(),
                                      nullptr};
  pid_t process = -1;
  const int error =
      ::posix_spawn(&process, path.c_str(), &actions, &attributes, words.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    throw_environment(fmt::format("'{}' does not run; install qemu-user", path));
  }
  return process;
}

/// @return Its status; 0 also where others have taken it: what it said decides.
int wait_for(pid_t process, const std::string& path) {
  const MachineClock clock;
  Deadline deadline(clock.now(), kAnswerLimit);
  int status = -1;
  for (Nanos wait(1); wait > Nanos(0); std::this_thread::sleep_for(wait)) {
    wait = deadline.next_wait(clock.now(), kLookEvery);
    const pid_t ended = ::waitpid(process, &status, WNOHANG);
    if (ended == process) return status;
    if (ended < 0 && errno != EINTR) return errno == ECHILD ? 0 : -1;
  }
  ::kill(-process, SIGKILL);
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  throw_environment(fmt::format("'{}' did not say its version within {} s; install qemu-user", path,
                                kAnswerLimit.count()));
}

}  // namespace

Tools find_tools() {
  Tools tools{try_find_program(kEmulator).value_or(fs::path()), find_own(kPlugin),
              find_own(kProgram), ""};
  tools.missing = what_is_missing(tools);
  return tools;
}

std::string quoted(const fs::path& path) {
  std::string text;
  for (const char c : path.string()) text.append(c == ',' ? 2 : 1, c);
  return text;
}

std::string emulator_version(const Tools& tools) {
  const FileDescriptor said(::memfd_create("pirt-dsp-version", MFD_CLOEXEC));
  const std::string path = tools.emulator.string();
  const int status = wait_for(start_asking(path, "file=" + quoted(tools.plugin), said.get()), path);
  std::array<char, 4096> text{};  // loader and libraries may speak first
  const auto size = ::pread(said.get(), text.data(), text.size(), 0);
  const std::string words(text.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
  // "qemu-hexagon version 7.2.22 (Debian ...)"
  constexpr std::string_view kBefore = "qemu-hexagon version ";
  const auto at = words.find(kBefore);
  if (at == std::string::npos && words.find("unknown option") != std::string::npos) {
    throw_environment(fmt::format(
        "'{}' takes no plugin, which counts the packets; install a qemu-user of 7.2 to 8.2 with "
        "plugins (Debian 12's is one, Debian 13's is not)",
        path));
  }
  if (status != 0 || at == std::string::npos) {
    throw_environment(fmt::format("'{}' {}; install qemu-user", path,
                                  status != 0 ? "does not run" : "does not say its version"));
  }
  const auto begin = at + kBefore.size();
  return fmt::format("qemu-hexagon {}",
                     words.substr(begin, words.find_first_of(" \n", begin) - begin));
}

std::string program_hash(const Tools& tools) {
  Hash64 hash;
  hash.add(text_of(tools.program)).add(text_of(tools.plugin));
  return fmt::format("{:016x}", hash.value());
}

}  // namespace pirt::dsp
