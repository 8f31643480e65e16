#include "characterize/worker/cache_sweep.h"

#include <utility>

#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"

namespace pirt {

CacheSweep::CacheSweep(std::vector<int> cores, std::int64_t bytes)
    : cores_(std::move(cores)), memory_(static_cast<std::size_t>(bytes)) {}

void CacheSweep::run() {
  const CoresRestored restored;
  auto* const words = memory_.as<std::uint64_t>();
  const std::size_t part = memory_.size_bytes() / sizeof(std::uint64_t) / cores_.size();
  for (std::size_t i = 0; i < cores_.size(); ++i) {
    bind_to_cores({&cores_[i], 1}, "");
    for (std::size_t word = i * part; word < (i + 1) * part; word += kLineWords) ++words[word];
  }
}

}  // namespace pirt
