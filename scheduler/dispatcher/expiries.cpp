#include "scheduler/dispatcher/expiries.h"

#include <algorithm>
#include <functional>

namespace pirt {

void Expiries::watch(TaskSlot slot, Nanos at) {
  tasks_[slot].*watched_ = true;
  ++live_;
  heap_.push_back({at, sequence_++, tasks_[slot].id});
  std::ranges::push_heap(heap_, std::greater{});
}

/// Keeps a live entry at the top, and memory in proportion to the tasks that are watched.
void Expiries::drop_stale() {
  if (heap_.size() > 2 * live_ + 64) {
    std::erase_if(heap_, [this](const Expiry& expiry) { return is_stale(expiry); });
    std::ranges::make_heap(heap_, std::greater{});
  }
  while (!heap_.empty() && is_stale(heap_.front())) {
    std::ranges::pop_heap(heap_, std::greater{});
    heap_.pop_back();
  }
}

}  // namespace pirt
