#include "workloads/base/caches.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace pirt {
namespace {

/// "32768K", "1M". @source Documentation/ABI/testing/sysfs-devices-system-cpu.
std::optional<std::int64_t> parse_size(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::int64_t value = 0;
  char unit = ' ';
  if (!(in >> value) || value <= 0) return std::nullopt;
  in >> unit;
  return unit == 'K' ? value << 10 : unit == 'M' ? value << 20 : unit == 'G' ? value << 30 : value;
}

void take(CacheSizes& sizes, long level, std::int64_t bytes) {
  if (level == 2) sizes.l2_bytes = bytes;
  if (level >= 2) sizes.last_bytes = std::max(sizes.last_bytes.value_or(0), bytes);
}

}  // namespace

CacheSizes read_cache_sizes(int core, const std::filesystem::path& root) {
  CacheSizes sizes;
  const auto folder = root / "sys/devices/system/cpu" / ("cpu" + std::to_string(core)) / "cache";
  for (int index = 0;; ++index) {
    const auto cache = folder / ("index" + std::to_string(index));
    std::ifstream level_file(cache / "level");
    std::ifstream type_file(cache / "type");
    long level = 0;
    std::string type;
    if (!(level_file >> level)) break;
    type_file >> type;
    const auto bytes = parse_size(cache / "size");
    if (bytes && type != "Instruction") take(sizes, level, *bytes);
  }
#ifdef _SC_LEVEL2_CACHE_SIZE  // of the GNU C library
  if (!sizes.l2_bytes && root == "/") {
    for (const auto& [level, name] :
         {std::pair(2L, _SC_LEVEL2_CACHE_SIZE), std::pair(3L, _SC_LEVEL3_CACHE_SIZE)}) {
      if (const long bytes = ::sysconf(name); bytes > 0) take(sizes, level, bytes);
    }
  }
#endif
  return sizes;
}

}  // namespace pirt
