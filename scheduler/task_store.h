// The dispatcher's memory: records of the tasks that are not done, their successors, and lists of
// them. Slots are used again, so that memory follows the tasks that are live, not those that were.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "scheduler/id_map.h"
#include "scheduler/task.h"

namespace pirt {

enum class TaskState : std::uint8_t {
  kWaiting,       ///< For predecessors.
  kHeld,          ///< The policy refuses it for now.
  kHighPriority,  ///< In the global high-priority queue.
  kQueued,        ///< In a unit's queue.
  kRunning,
  kCancelled,  ///< Still runs, but counts as dropped already.
};

using TaskSlot = std::uint32_t;
inline constexpr TaskSlot kNoSlot = IdMap::kAbsent;

struct TaskRecord {
  TaskId id = 0;
  std::uint32_t class_index = 0;
  TaskState state = TaskState::kWaiting;
  UnitId unit = 0;            ///< Of kQueued, kRunning and kCancelled.
  std::uint32_t pending = 0;  ///< Predecessors not complete.
  std::uint32_t first_edge = kNoSlot;
  std::uint32_t generation = 0;  ///< Of the slot; tells a record from an earlier one in its place.
  TaskSlot previous = kNoSlot;   ///< In the list that it is in.
  TaskSlot next = kNoSlot;
  Nanos rank{0};               ///< The policy's; all queues keep this order,
  std::uint64_t sequence = 0;  ///< and then the order in which tasks became ready.
  Nanos dispatched_at{0};
  Nanos ready_at{0};
  bool expires = false;
};

class TaskStore {
 public:
  [[nodiscard]] TaskRecord& operator[](TaskSlot slot) { return records_[slot]; }
  [[nodiscard]] const TaskRecord& operator[](TaskSlot slot) const { return records_[slot]; }
  /// kNoSlot if there is no such task, any more or yet.
  [[nodiscard]] TaskSlot find(TaskId id) const { return slots_.find(id); }

  TaskSlot add(TaskId id) {
    TaskSlot slot = 0;
    if (free_.empty()) {
      slot = static_cast<TaskSlot>(records_.size());
      records_.emplace_back();
    } else {
      slot = free_.back();
      free_.pop_back();
    }
    const std::uint32_t generation = records_[slot].generation;
    records_[slot] = TaskRecord{.id = id, .generation = generation};
    slots_.insert(id, slot);
    return slot;
  }

  void remove(TaskSlot slot) {
    slots_.erase(records_[slot].id);
    free_edges(slot);
    ++records_[slot].generation;
    free_.push_back(slot);
  }

  [[nodiscard]] bool is_current(TaskSlot slot, std::uint32_t generation) const {
    return records_[slot].generation == generation;
  }

  void add_successor(TaskSlot predecessor, TaskSlot successor) {
    std::uint32_t edge = free_edge_;
    if (edge == kNoSlot) {
      edge = static_cast<std::uint32_t>(edges_.size());
      edges_.emplace_back();
    } else {
      free_edge_ = edges_[edge].next;
    }
    edges_[edge] = {successor, records_[successor].generation, records_[predecessor].first_edge};
    records_[predecessor].first_edge = edge;
  }

  /// Appends the successors that are still live, in order of submission.
  void successors(TaskSlot slot, std::vector<TaskSlot>& out) const {
    const auto begin = static_cast<std::ptrdiff_t>(out.size());
    for (std::uint32_t e = records_[slot].first_edge; e != kNoSlot; e = edges_[e].next) {
      if (is_current(edges_[e].successor, edges_[e].generation)) out.push_back(edges_[e].successor);
    }
    std::reverse(out.begin() + begin, out.end());  // Edges are linked newest first.
  }

 private:
  struct Edge {
    TaskSlot successor = kNoSlot;
    std::uint32_t generation = 0;
    std::uint32_t next = kNoSlot;
  };

  void free_edges(TaskSlot slot) {
    for (std::uint32_t e = records_[slot].first_edge; e != kNoSlot;) {
      const std::uint32_t next = edges_[e].next;
      edges_[e].next = free_edge_;
      free_edge_ = e;
      e = next;
    }
  }

  std::vector<TaskRecord> records_;
  std::vector<TaskSlot> free_;
  std::vector<Edge> edges_;
  std::uint32_t free_edge_ = kNoSlot;
  IdMap slots_;
};

/// Whether all queues serve @p a before @p b.
[[nodiscard]] inline bool precedes(const TaskRecord& a, const TaskRecord& b) {
  return a.rank != b.rank ? a.rank < b.rank : a.sequence < b.sequence;
}

/// A queue in order of `rank` and `sequence`, linked through the records.
class TaskList {
 public:
  [[nodiscard]] bool empty() const { return head_ == kNoSlot; }
  [[nodiscard]] TaskSlot front() const { return head_; }

  /// New tasks go to the end at once, or near it; one that comes back is older than most and goes
  /// near the front. So its place is sought from both sides.
  void insert(TaskStore& store, TaskSlot slot) {
    TaskRecord& record = store[slot];
    TaskSlot after = kNoSlot;
    if (tail_ != kNoSlot && precedes(record, store[tail_])) {
      TaskSlot last = tail_;  // Comes after the record, as all behind it.
      after = head_;
      while (precedes(store[after], record)) {
        const TaskSlot before = store[last].previous;
        if (before == kNoSlot || precedes(store[before], record)) {
          after = last;
          break;
        }
        last = before;
        after = store[after].next;
      }
    }
    record.next = after;
    record.previous = after == kNoSlot ? tail_ : store[after].previous;
    (record.previous == kNoSlot ? head_ : store[record.previous].next) = slot;
    (after == kNoSlot ? tail_ : store[after].previous) = slot;
  }

  void erase(TaskStore& store, TaskSlot slot) {
    TaskRecord& record = store[slot];
    (record.previous == kNoSlot ? head_ : store[record.previous].next) = record.next;
    (record.next == kNoSlot ? tail_ : store[record.next].previous) = record.previous;
    record.previous = record.next = kNoSlot;
  }

 private:
  TaskSlot head_ = kNoSlot;
  TaskSlot tail_ = kNoSlot;
};

}  // namespace pirt
