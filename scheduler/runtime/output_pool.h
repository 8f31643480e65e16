// Memory of outputs that nobody reads any more is written again.
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <memory>
#include <vector>

#include "workloads/model/tensor.h"
#include "workloads/model/workload.h"

namespace pirt {

/// Used by one thread at a time.
class OutputPool {
 public:
  using Outputs = std::shared_ptr<std::vector<Tensor>>;

  /// Tensors as Workload::outputs that nobody else has, of which some may have held earlier ones.
  /// They come back by themselves when the last to hold what is returned lets go of it.
  [[nodiscard]] Outputs take(const Workload& workload) {
    Pool& pool = pools_[&workload];
    // Those that are taken longest come back first; a look at a few keeps this short.
    const std::size_t looks = std::min<std::size_t>(pool.all.size(), kLooks);
    for (std::size_t i = 0; i < looks; ++i) {
      pool.next = (pool.next + 1) % pool.all.size();
      if (pool.all[pool.next].use_count() == 1) return pool.all[pool.next];
    }
    pool.next = pool.all.size();
    return pool.all.emplace_back(
        std::make_shared<std::vector<Tensor>>(make_tensors(workload.outputs)));
  }

 private:
  static constexpr std::size_t kLooks = 8;
  struct Pool {
    std::vector<Outputs> all;
    std::size_t next = 0;
  };
  std::map<const Workload*, Pool> pools_;
};

}  // namespace pirt
