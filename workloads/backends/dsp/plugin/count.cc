// The plugin of qemu-hexagon that counts: packets, and lines of the cache that the modelled L2 did
// not hold. Debian packages qemu's plugins without their header, so that the part of the interface
// that is used here is declared by hand (version 1, qemu 7.2: include/qemu/qemu-plugin.h).
//
// For Hexagon, one "instruction" of that interface is one packet. What has been counted is written
// to a page shared with the host at the program's system calls read and write: between them lies a
// command.
#include <sys/mman.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <deque>
#include <string>
#include <vector>

#include "workloads/backends/dsp/protocol.h"

extern "C" {
struct qemu_plugin_tb;
struct qemu_plugin_insn;
using qemu_plugin_id_t = std::uint64_t;
using qemu_plugin_meminfo_t = std::uint32_t;
enum qemu_plugin_op { QEMU_PLUGIN_INLINE_ADD_U64 };
enum qemu_plugin_cb_flags { QEMU_PLUGIN_CB_NO_REGS };
enum qemu_plugin_mem_rw { QEMU_PLUGIN_MEM_R = 1, QEMU_PLUGIN_MEM_W, QEMU_PLUGIN_MEM_RW };

void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id,
                                           void (*callback)(qemu_plugin_id_t, qemu_plugin_tb*));
std::size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb* block);
qemu_plugin_insn* qemu_plugin_tb_get_insn(const qemu_plugin_tb* block, std::size_t index);
std::uint64_t qemu_plugin_insn_vaddr(const qemu_plugin_insn* packet);
void qemu_plugin_register_vcpu_tb_exec_inline(qemu_plugin_tb* block, qemu_plugin_op op, void* to,
                                              std::uint64_t value);
void qemu_plugin_register_vcpu_mem_cb(qemu_plugin_insn* packet,
                                      void (*callback)(unsigned, qemu_plugin_meminfo_t,
                                                       std::uint64_t, void*),
                                      qemu_plugin_cb_flags flags, qemu_plugin_mem_rw which,
                                      void* user);
void qemu_plugin_register_vcpu_syscall_cb(
    qemu_plugin_id_t id,
    void (*callback)(qemu_plugin_id_t, unsigned, std::int64_t number, std::uint64_t, std::uint64_t,
                     std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t,
                     std::uint64_t));

#define EXPORTED __attribute__((visibility("default")))
EXPORTED extern int qemu_plugin_version;
int qemu_plugin_version = 1;
EXPORTED int qemu_plugin_install(qemu_plugin_id_t id, const void* info, int argc, char** argv);
}

namespace {

PirtDspCountsPage* page = nullptr;
PirtDspCounts now{};
PirtDspCounts at_read{};

/// An L2 with least recently used replacement, empty at the begin of each command: what the host
/// has written meanwhile is in memory, and so a command's misses do not depend on those before it.
class Cache {
 public:
  void clear() {
    for (Set& set : sets_) set = {};
    last_ = kNone;
  }
  void touch(std::uint64_t address) {
    const std::uint64_t line = address / PIRT_DSP_LINE;
    if (line == last_) return;
    last_ = line;
    ++now.lines;
    Set& set = sets_[line % kSets];
    std::size_t at = 0;
    while (at < kWays - 1 && set[at] != line + 1) ++at;
    if (set[at] != line + 1) ++now.misses;
    for (; at > 0; --at) set[at] = set[at - 1];
    set[0] = line + 1;
  }

 private:
  static constexpr std::size_t kWays = PIRT_DSP_L2_WAYS;
  static constexpr std::size_t kSets = PIRT_DSP_L2_BYTES / (PIRT_DSP_LINE * kWays);
  static constexpr std::uint64_t kNone = ~std::uint64_t{0};
  using Set = std::array<std::uint64_t, kWays>;  // line + 1, the latest first; 0 = empty
  std::array<Set, kSets> sets_{};
  std::uint64_t last_ = kNone;
};

bool models_memory = false;
Cache cache;

/// The emulator loads vectors by 8 bytes and stores them by single ones, all of a packet's one
/// after the other: what touches the line of the access before it belongs to that.
void on_access(unsigned, qemu_plugin_meminfo_t, std::uint64_t address, void*) {
  cache.touch(address);
}

/// How often each packet was executed, for benchmarks: a file that is written with each reply.
class Profile {
 public:
  void open(const char* path) { path_ = path; }
  void add(qemu_plugin_tb* block) {
    if (path_.empty()) return;
    Block& added = blocks_.emplace_back();
    for (std::size_t i = 0; i < qemu_plugin_tb_n_insns(block); ++i) {
      added.packets.push_back(qemu_plugin_insn_vaddr(qemu_plugin_tb_get_insn(block, i)));
    }
    qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, &added.executions,
                                             1);
  }
  void begin() {
    for (Block& block : blocks_) block.before = block.executions;
  }
  void write() const {
    std::FILE* const file = path_.empty() ? nullptr : std::fopen(path_.c_str(), "w");
    if (file == nullptr) return;
    for (const Block& block : blocks_) {
      for (const std::uint64_t packet : block.packets) {
        std::fprintf(file, "%llx %llu\n", static_cast<unsigned long long>(packet),
                     static_cast<unsigned long long>(block.executions - block.before));
      }
    }
    std::fclose(file);
  }

 private:
  struct Block {
    std::vector<std::uint64_t> packets;  // addresses
    std::uint64_t executions = 0, before = 0;
  };
  std::string path_;
  std::deque<Block> blocks_;  // the emulator keeps their addresses
};

Profile profile;

void on_block(qemu_plugin_id_t, qemu_plugin_tb* block) {
  const std::size_t packets = qemu_plugin_tb_n_insns(block);
  profile.add(block);
  qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, &now.packets,
                                           packets);
  for (std::size_t i = 0; models_memory && i < packets; ++i) {
    qemu_plugin_register_vcpu_mem_cb(qemu_plugin_tb_get_insn(block, i), on_access,
                                     QEMU_PLUGIN_CB_NO_REGS, QEMU_PLUGIN_MEM_RW, nullptr);
  }
}

constexpr std::int64_t kRead = 63;
constexpr std::int64_t kWrite = 64;

void on_system_call(qemu_plugin_id_t, unsigned, std::int64_t number, std::uint64_t, std::uint64_t,
                    std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t,
                    std::uint64_t) {
  if (number == kRead) {
    at_read = now;
    cache.clear();
    profile.begin();
  }
  if (number != kWrite) return;
  page->total = now;
  page->command = {now.packets - at_read.packets, now.lines - at_read.lines,
                   now.misses - at_read.misses};
  profile.write();
}

}  // namespace

/// Arguments: "memory=on", "profile=FILE".
int qemu_plugin_install(qemu_plugin_id_t id, const void*, int argc, char** argv) {
  for (int i = 0; i < argc; ++i) {
    if (std::strcmp(argv[i], "memory=on") == 0) models_memory = true;
    if (std::strncmp(argv[i], "profile=", 8) == 0) profile.open(argv[i] + 8);
  }
  void* const shared = ::mmap(nullptr, sizeof(PirtDspCountsPage), PROT_READ | PROT_WRITE,
                              MAP_SHARED, PIRT_DSP_COUNTS_FD, 0);
  if (shared == MAP_FAILED) return -1;
  page = static_cast<PirtDspCountsPage*>(shared);
  page->magic = PIRT_DSP_COUNTS_MAGIC;
  qemu_plugin_register_vcpu_tb_trans_cb(id, on_block);
  qemu_plugin_register_vcpu_syscall_cb(id, on_system_call);
  return 0;
}
