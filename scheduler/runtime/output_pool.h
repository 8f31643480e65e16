// Memory of outputs that nobody reads any more is written again.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#include "scheduler/runtime/threads.h"
#include "workloads/model/tensor.h"
#include "workloads/model/workload.h"

namespace pirt {

/// Any thread. Outputs may outlive it.
class OutputPool {
 public:
  using Outputs = std::shared_ptr<std::vector<Tensor>>;

  /// Tensors as Workload::outputs that nobody else has, of which some may have held earlier ones.
  /// @param memory  Device::output_memory of the unit that writes them, which lives until forget().
  /// They come back when the last to hold what is returned lets go of it, but for those of
  /// which somebody shares a tensor: these are his.
  [[nodiscard]] Outputs take(const Workload& workload, TensorMemory* memory = nullptr) {
    const Key key{&workload, memory};
    std::unique_ptr<std::vector<Tensor>> outputs = free_->take(key);
    if (outputs == nullptr) {
      outputs = std::make_unique<std::vector<Tensor>>(make_tensors(workload.outputs, memory));
    }
    return {outputs.release(), [free = free_, key](std::vector<Tensor>* back) {
              free->put(key, std::unique_ptr<std::vector<Tensor>>(back));
            }};
  }

  /// Lets go of all that is in that memory, also of what comes back later.
  void forget(const TensorMemory* memory) {
    const std::lock_guard lock(free_->mutex);
    std::erase_if(free_->sets, [memory](const auto& each) { return each.first.second == memory; });
  }

 private:
  using Key = std::pair<const Workload*, const TensorMemory*>;
  struct Free {
    std::unique_ptr<std::vector<Tensor>> take(const Key& key) {
      const std::lock_guard lock(mutex);
      auto& known = sets[key];
      known.reserve(kMost);  // So that nothing is asked for where it comes back.
      if (known.empty()) return nullptr;
      auto last = std::move(known.back());  // Its memory is in a cache yet.
      known.pop_back();
      return last;
    }
    void put(const Key& key, std::unique_ptr<std::vector<Tensor>> outputs) noexcept {
      // Nobody but its sharers could share a tensor anew, and they let go of it before this is
      // read. What they read is read before anybody writes: counting up and down again acquires,
      // as a fence would, which the thread sanitizer does not know.
      try {
        for (const Tensor& each : *outputs) {
          if (each.is_shared()) return;
          static_cast<void>(each.share());
        }
      } catch (const std::bad_alloc&) {  // Of its spec.
        return;
      }
      const std::lock_guard lock(mutex);
      const auto known = sets.find(key);
      if (known != sets.end() && known->second.size() < kMost) {
        known->second.push_back(std::move(outputs));
      }
    }

    static constexpr std::size_t kMost = 64;  ///< Of a workload: what a burst took is given back.
    runtime::Mutex mutex;
    std::map<Key, std::vector<std::unique_ptr<std::vector<Tensor>>>> sets;
  };
  std::shared_ptr<Free> free_ = std::make_shared<Free>();
};

}  // namespace pirt
