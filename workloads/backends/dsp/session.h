// One Hexagon program under qemu-hexagon: a process, a mapping shared with it, commands one at a
// time.
//
// Knows nothing of workloads. A program that crashes or does not answer costs the call: the error
// names the kernel, the process is gone, the mapping keeps what is in it, and the next call starts
// another one. Used by one thread at a time; the program ends with the thread that started it.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "workloads/backends/dsp/protocol.h"
#include "workloads/base/system/file_descriptor.h"
#include "workloads/base/system/shared_memory.h"
#include "workloads/base/time.h"

namespace pirt::dsp {

struct SessionOptions {
  std::filesystem::path emulator;                     ///< qemu-hexagon
  std::filesystem::path plugin;                       ///< What counts: plugin/count.cc, built.
  std::filesystem::path program;                      ///< The ELF of program/.
  std::size_t mapping_bytes = std::size_t{64} << 20;  ///< Pages that are not touched cost nothing.
  bool models_memory = false;  ///< Counts Cost::lines and misses, too; takes longer.
  /// A file for how often each packet was executed in the last command, "address count" a line;
  /// empty = none.
  std::filesystem::path profile = {};
  /// Of the machine's time, for one command; a program that works on is killed, too.
  Nanos limit = std::chrono::seconds(30);
  Nanos start_limit = std::chrono::seconds(5);  ///< Of the first one, or `limit` if that is less.
};

/// What one command cost.
struct Cost {
  std::int64_t packets = 0;
  std::int64_t lines = 0;   ///< Of the cache, that loads and stores went over to.
  std::int64_t misses = 0;  ///< Of these, those that the modelled L2 did not hold.
};

/// Bytes of the mapping that a kernel reads or writes.
struct Buffer {
  std::uint32_t offset = 0;
  std::uint32_t bytes = 0;
};

class ProgramSession {
 public:
  /// Starts the program.
  /// @throws Error{kEnvironment} if one of the files is missing or no such program, or the first
  /// command has no answer.
  explicit ProgramSession(SessionOptions options);
  ~ProgramSession();
  ProgramSession(const ProgramSession&) = delete;
  ProgramSession& operator=(const ProgramSession&) = delete;

  /// @p bytes of the mapping, aligned for vectors, with room for a vector behind them. What kernels
  /// wrote elsewhere is left alone.
  /// @throws Error{kEnvironment} naming @p what if the mapping is too small.
  [[nodiscard]] Buffer allocate(std::size_t bytes, std::string_view what);
  /// Gives back all buffers.
  void free_all();
  [[nodiscard]] std::span<std::byte> bytes(Buffer buffer) const;

  /// Runs kernel @p kernel (PIRT_DSP_...) and waits for its end.
  /// @param values  At most PIRT_DSP_MAX_VALUES; buffers likewise.
  /// @param name    Of the kernel, for messages.
  /// @throws Error{kEnvironment} if the program crashes, is not done within the limit, or refuses.
  Cost run(std::uint32_t kernel, std::span<const Buffer> buffers,
           std::span<const std::int32_t> values, std::string_view name);

  /// Packets from the program's start to its first wait.
  [[nodiscard]] Cost start_cost() const { return start_cost_; }
  /// The process; below 0 = none is running.
  [[nodiscard]] pid_t process() const { return process_; }

 private:
  void start();
  void stop();
  /// As the plugin has left them; read after a reply.
  [[nodiscard]] PirtDspCountsPage counts() const;
  [[nodiscard]] Cost exchange(const PirtDspCommand& command, std::string_view name);
  void wait_for_reply(PirtDspReply& reply, std::string_view name, Nanos limit);
  [[noreturn]] void fail_call(std::string_view name, std::string_view how);
  [[nodiscard]] std::string how_it_ended();

  SessionOptions options_;
  SharedMemory mapping_;
  SharedMemory counts_page_;
  FileDescriptor said_;  ///< What qemu wrote to standard output and error.
  FileDescriptor commands_, replies_;
  std::size_t used_ = 0;
  pid_t process_ = -1;
  std::uint32_t serial_ = 0;
  Cost start_cost_;
};

}  // namespace pirt::dsp
