#include "characterize/worker/cache_sweep.h"

#include <utility>

#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"

namespace pirt {
namespace {

constexpr std::size_t kLineWords = 64 / sizeof(std::uint64_t);

/// The thread may use the cores again that it could.
class WithCores {
 public:
  WithCores() : before_(current_cores()) {}
  ~WithCores() {
    try {
      bind_to_cores(before_, "");
    } catch (...) {  // Those cores are gone: it keeps what it has.
    }
  }
  WithCores(const WithCores&) = delete;
  WithCores& operator=(const WithCores&) = delete;

 private:
  std::vector<int> before_;
};

}  // namespace

CacheSweep::CacheSweep(std::vector<int> cores)
    : cores_(cores.empty() ? current_cores() : std::move(cores)) {
  const auto bytes = own_cache_bytes(cores_);
  if (bytes) words_.assign(static_cast<std::size_t>(*bytes) / sizeof(std::uint64_t), 1);
}

void CacheSweep::run() {
  const WithCores restored;
  const std::size_t part = words_.size() / cores_.size();
  for (std::size_t i = 0; i < cores_.size(); ++i) {
    bind_to_cores({&cores_[i], 1}, "");
    for (std::size_t word = i * part; word < (i + 1) * part; word += kLineWords) ++words_[word];
  }
}

}  // namespace pirt
