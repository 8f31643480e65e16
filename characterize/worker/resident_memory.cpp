#include "characterize/worker/resident_memory.h"

#include <algorithm>
#include <fstream>

#include "characterize/machine/system_files.h"

namespace pirt {
namespace {

constexpr const char* kStatus = "/proc/self/status";

std::optional<std::int64_t> status_bytes(const char* key) {
  const auto kib = number_of(kStatus, key, ':');
  return kib ? std::optional(*kib << 10) : std::nullopt;
}

}  // namespace

ResidentMemory::ResidentMemory() {
  std::ofstream mark("/proc/self/clear_refs");
  mark << "5" << std::flush;  // proc(5): sets VmHWM back to what is resident
  if (mark.good()) before_bytes_ = status_bytes("VmRSS");
}

std::optional<std::int64_t> ResidentMemory::added_bytes() const {
  const auto highest = status_bytes("VmHWM");
  if (!before_bytes_ || !highest) return std::nullopt;
  return std::max<std::int64_t>(0, *highest - *before_bytes_);
}

std::int64_t ResidentMemory::kept_bytes() const {
  const auto now = status_bytes("VmRSS");
  return before_bytes_ && now ? *now - *before_bytes_ : 0;
}

}  // namespace pirt
