#include "workloads/base/system/caches.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "workloads/base/system/cores.h"

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

/// A data or unified cache as a core's folder lists it.
struct Cache {
  long level = 0;
  std::int64_t bytes = 0;
  std::string cores;  ///< That share it, "0-7"; empty if that is not said.
};

constexpr const char* kCores = "sys/devices/system/cpu";

std::vector<Cache> caches_of(const std::filesystem::path& core) {
  std::vector<Cache> all;
  for (int index = 0;; ++index) {
    const auto folder = core / "cache" / ("index" + std::to_string(index));
    std::ifstream level_file(folder / "level");
    std::ifstream type_file(folder / "type");
    std::ifstream cores_file(folder / "shared_cpu_list");
    Cache cache;
    std::string type;
    if (!(level_file >> cache.level)) return all;
    type_file >> type;
    cores_file >> cache.cores;
    const auto bytes = parse_size(folder / "size");
    if (!bytes || type == "Instruction") continue;
    cache.bytes = *bytes;
    all.push_back(std::move(cache));
  }
}

/// The caches of one level that some cores reach.
struct Level {
  std::map<std::string, std::int64_t> bytes;  ///< Of each, by the cores that share it.
  double part = 0;  ///< Bytes, each cache by the part that is these cores'.
  bool own = true;  ///< No other core shares any.

  [[nodiscard]] std::int64_t sum() const {
    std::int64_t sum = 0;
    for (const auto& [sharing, each] : bytes) sum += each;
    return sum;
  }
};

std::map<long, Level> levels_of(std::span<const int> cores, const std::filesystem::path& root) {
  std::map<long, Level> levels;
  for (const int core : cores) {
    for (const Cache& cache : caches_of(root / kCores / ("cpu" + std::to_string(core)))) {
      if (cache.level < 2) continue;
      auto sharing = parse_core_list(cache.cores);
      if (sharing.empty()) sharing = {core};
      Level& level = levels[cache.level];
      for (const int other : sharing) {
        level.own = level.own && std::ranges::find(cores, other) != cores.end();
      }
      level.part += static_cast<double>(cache.bytes) / static_cast<double>(sharing.size());
      level.bytes[cache.cores.empty() ? std::to_string(core) : cache.cores] = cache.bytes;
    }
  }
  return levels;
}

}  // namespace

std::optional<std::int64_t> own_cache_bytes(std::span<const int> cores,
                                            const std::filesystem::path& root) {
  const auto levels = levels_of(cores, root);
  for (auto level = levels.rbegin(); level != levels.rend(); ++level) {
    if (level->second.own) return level->second.sum();
  }
  if (levels.empty()) return read_cache_sizes(cores.front(), root).l2_bytes;
  return static_cast<std::int64_t>(levels.begin()->second.part);
}

std::optional<std::int64_t> reached_cache_bytes(std::span<const int> cores,
                                                const std::filesystem::path& root) {
  const auto levels = levels_of(cores, root);
  if (levels.empty()) return read_cache_sizes(cores.front(), root).last_bytes;
  return levels.rbegin()->second.sum();
}

CacheSizes read_cache_sizes(int core, const std::filesystem::path& root) {
  CacheSizes sizes;
  for (const Cache& cache : caches_of(root / kCores / ("cpu" + std::to_string(core)))) {
    take(sizes, cache.level, cache.bytes);
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

std::optional<std::int64_t> all_last_cache_bytes(const std::filesystem::path& root) {
  // By level and cores. One of which nobody says who shares it is its core's own: rather too many
  // bytes than too few.
  std::map<std::pair<long, std::string>, std::int64_t> last;
  std::error_code none;  // then there are no entries
  for (const auto& entry : std::filesystem::directory_iterator(root / kCores, none)) {
    const auto caches = caches_of(entry.path());
    const auto largest = std::ranges::max_element(caches, {}, &Cache::level);
    if (largest == caches.end() || largest->level < 2) continue;
    const std::string cores =
        largest->cores.empty() ? entry.path().filename().string() : largest->cores;
    last[{largest->level, cores}] = largest->bytes;
  }
  std::int64_t sum = 0;
  for (const auto& [where, bytes] : last) sum += bytes;
  return sum > 0 ? std::optional(sum) : read_cache_sizes(0, root).last_bytes;
}

}  // namespace pirt
