// A queue of tasks in the order in which all queues are served.
#pragma once

#include <cstdint>
#include <iterator>
#include <memory>
#include <set>
#include <utility>

#include "scheduler/dispatcher/task_store.h"

namespace pirt {

/// Whether all queues serve @p a before @p b.
[[nodiscard]] inline bool precedes(const TaskRecord& a, const TaskRecord& b) {
  return a.rank != b.rank ? a.rank < b.rank : a.sequence < b.sequence;
}

/// Linked through the records, so that its first task, and one that leaves, cost nothing to find.
/// New tasks go to the end at once, or near it; one that comes back is older than most and goes
/// near the front: so its place is sought from both sides. Where it is far from both, as where
/// deadlines mix, the queue gets an index, and keeps it until it is short: then it takes O(log n).
/// @tparam Order  bool(const TaskRecord&, const TaskRecord&), as precedes.
template <typename Order>
class OrderedTasks {
 public:
  OrderedTasks() = default;
  explicit OrderedTasks(Order order) : order_(std::move(order)) {}

  [[nodiscard]] bool empty() const { return head_ == kNoSlot; }
  [[nodiscard]] TaskSlot front() const { return head_; }

  /// @param store  Always the same, which must outlive it.
  void insert(TaskStore& store, TaskSlot slot) {
    TaskRecord& record = store[slot];
    const bool is_last = tail_ == kNoSlot || !order_(record, store[tail_]);
    const TaskSlot after = is_last ? kNoSlot : find_behind(store, slot);
    record.next = after;
    record.previous = after == kNoSlot ? tail_ : store[after].previous;
    (record.previous == kNoSlot ? head_ : store[record.previous].next) = slot;
    (after == kNoSlot ? tail_ : store[after].previous) = slot;
    ++size_;
    if (index_ && is_last) index_->insert(index_->end(), slot);
  }

  void erase(TaskStore& store, TaskSlot slot) {
    if (index_) erase_from_index(slot);
    TaskRecord& record = store[slot];
    (record.previous == kNoSlot ? head_ : store[record.previous].next) = record.next;
    (record.next == kNoSlot ? tail_ : store[record.next].previous) = record.previous;
    record.previous = record.next = kNoSlot;
    --size_;
  }

 private:
  /// From each end, before there is an index. It goes where the queue is no longer than that.
  static constexpr std::uint32_t kNear = 16;
  struct Before {
    const TaskStore* store = nullptr;
    Order order;
    bool operator()(TaskSlot a, TaskSlot b) const { return order((*store)[a], (*store)[b]); }
  };

  /// The first that comes after the task, if that is not the last; with an index it is in there
  /// from now on.
  TaskSlot find_behind(const TaskStore& store, TaskSlot slot) {
    if (!index_) {
      TaskSlot first = head_;
      TaskSlot last = tail_;  // Comes after the task, as all behind it.
      for (std::uint32_t i = 0; i < kNear; ++i) {
        if (!order_(store[first], store[slot])) return first;
        const TaskSlot before = store[last].previous;
        if (before == kNoSlot || order_(store[before], store[slot])) return last;
        last = before;
        first = store[first].next;
      }
      index_ = std::make_unique<std::set<TaskSlot, Before>>(Before{&store, order_});
      for (TaskSlot each = head_; each != kNoSlot; each = store[each].next) {
        index_->insert(index_->end(), each);
      }
    }
    return *std::next(index_->insert(slot).first);
  }

  void erase_from_index(TaskSlot slot) {
    if (size_ <= kNear) {
      index_ = nullptr;
    } else if (slot == *index_->begin()) {
      index_->erase(index_->begin());
    } else {
      index_->erase(slot);
    }
  }

  TaskSlot head_ = kNoSlot;
  TaskSlot tail_ = kNoSlot;
  std::uint32_t size_ = 0;
  [[no_unique_address]] Order order_ = {};
  std::unique_ptr<std::set<TaskSlot, Before>> index_;  ///< Of all of them; null = none.
};

struct ServedBefore {
  bool operator()(const TaskRecord& a, const TaskRecord& b) const { return precedes(a, b); }
};
using TaskList = OrderedTasks<ServedBefore>;

}  // namespace pirt
