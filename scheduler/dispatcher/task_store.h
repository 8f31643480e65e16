// The dispatcher's memory: records of the tasks of firings that are not released, and their
// successors. A task that completed is forgotten at once, one that ended otherwise with its
// firing.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/slot_table.h"
#include "scheduler/mix/task.h"

namespace pirt {

enum class TaskState : std::uint8_t {
  kWaiting,       ///< For predecessors.
  kHeld,          ///< The policy refuses it for now.
  kHighPriority,  ///< In the global high-priority queue.
  kQueued,        ///< In a unit's queue.
  kRunning,
  kCancelled,  ///< Still runs, but counts as dropped already.
  kEnded,      ///< Without having completed; whoever comes after it is dropped.
};

/// Nothing else: it could start, and no unit was chosen.
[[nodiscard]] constexpr bool waits_for_unit(TaskState state) {
  return state == TaskState::kHeld || state == TaskState::kHighPriority;
}

/// It can no longer start, or has ended.
[[nodiscard]] constexpr bool is_over(TaskState state) {
  return state == TaskState::kCancelled || state == TaskState::kEnded;
}

using TaskSlot = Slot;
inline constexpr TaskSlot kDoneSlot = kNoSlot - 1;  ///< Stands for one that completed.
/// A task among others, the nearest deadline first.
using ByDeadline = std::tuple<Nanos, std::uint64_t, TaskSlot>;

struct TaskRecord {
  TaskId id = kNoTask;  ///< kNoTask: the slot is free.
  std::uint32_t class_index = 0;
  TaskState state = TaskState::kWaiting;
  UnitId unit = 0;            ///< Of kQueued, kRunning and kCancelled.
  std::uint32_t pending = 0;  ///< Predecessors not complete.
  std::uint32_t first_edge = kNoSlot;
  std::uint32_t generation = 0;  ///< How often the slot was used before.
  std::uint32_t firing = 0;      ///< Position in the store's firings.
  TaskSlot previous = kNoSlot;   ///< In the list that it is in.
  TaskSlot next = kNoSlot;
  Nanos rank{0};               ///< The policy's; all queues keep this order,
  std::uint64_t sequence = 0;  ///< and then the order in which tasks became ready.
  Nanos dispatched_at{0};
  Nanos ready_at{0};
  Nanos deadline = Nanos::max();  ///< Nanos::max() = none.
  bool suspended = false;         ///< Runs, and is between two slices.
  bool expires = false;           ///< Watched for that,
  bool recalled = false;          ///< and for being taken back.
  bool in_state = false;          ///< In the queue of a state; see TaskTies.
  bool in_series = false;         ///< Not decided, and in the list of a series.
};

/// What few tasks have, kept apart so that the others need not carry it.
struct TaskTies {
  std::optional<Nanos> expires_at;
  std::optional<Recall> recall;
  UnitMask returned_by = 0;
  int returns = 0;
  // In the queue of a state, while in_state.
  StateId state = 0;
  TaskSlot state_before = kNoSlot, state_behind = kNoSlot;
  // In the list of those of a series that are not decided, while in_series.
  SeriesId series = 0;
  TaskSlot older = kNoSlot;  ///< Or kDoneSlot: the next older one has completed.
  TaskSlot newer = kNoSlot;
  std::uint32_t first_reader = kNoSlot;  ///< Edges to those that read it, if it completes.
};

class TaskStore {
 public:
  [[nodiscard]] TaskRecord& operator[](TaskSlot slot) { return records_[slot]; }
  [[nodiscard]] const TaskRecord& operator[](TaskSlot slot) const { return records_[slot]; }
  [[nodiscard]] ByDeadline by_deadline(TaskSlot slot) const {
    return {records_[slot].deadline, records_[slot].sequence, slot};
  }
  /// Those of a task that got some by tie(); a task's are its own from then to its end.
  [[nodiscard]] TaskTies& ties(TaskSlot slot) { return ties_[slot]; }
  TaskTies& tie(TaskSlot slot) {
    if (ties_.size() <= slot) ties_.resize(records_.records().size());
    return ties_[slot];
  }
  /// Null: it has none.
  [[nodiscard]] const TaskTies* find_ties(TaskSlot slot) const {
    return slot < ties_.size() ? &ties_[slot] : nullptr;
  }
  /// kNoSlot if no such task is known, any more or yet.
  [[nodiscard]] TaskSlot find(TaskId id) const {
    const TaskSlot slot = slot_of(id);
    return slot < records_.records().size() && records_[slot].id == id ? slot : kNoSlot;
  }

  /// Also if it has ended.
  [[nodiscard]] TaskSlot find_live(TaskId id) const {
    const TaskSlot slot = find(id);
    return slot == kNoSlot || records_[slot].state == TaskState::kEnded ? kNoSlot : slot;
  }

  /// A new one, to add tasks to.
  Slot add_firing() {
    const Slot firing = firings_.take();
    firings_[firing] = {.id = FiringId{firing_number_++} << 32 | firing};
    return firing;
  }
  [[nodiscard]] FiringId firing_id(Slot firing) const { return firings_[firing].id; }

  /// Nothing that comes later names its tasks. False if there is no such firing, or it is released
  /// already.
  bool release(FiringId id) {
    const Slot firing = slot_of(id);
    if (firing >= firings_.records().size() || firings_[firing].id != id ||
        firings_[firing].released) {
      return false;
    }
    for (TaskSlot slot = firings_[firing].ended; slot != kNoSlot;) {
      const TaskSlot next = records_[slot].next;
      forget(slot);
      slot = next;
    }
    firings_[firing].ended = kNoSlot;
    firings_[firing].released = true;
    if (firings_[firing].live == 0) forget_firing(firing);
    return true;
  }

  /// Firings that are not released, or have live tasks.
  [[nodiscard]] std::size_t firings() const { return firings_.used(); }
  /// Tasks that are live, or ended without completing and are of a firing that is not released.
  [[nodiscard]] std::size_t tasks() const { return records_.used(); }

  TaskSlot add(Slot firing) {
    const TaskSlot slot = records_.take();
    const std::uint32_t generation = records_[slot].generation;
    records_[slot] = {
        .id = TaskId{generation} << 32 | slot, .generation = generation, .firing = firing};
    if (slot < ties_.size()) ties_[slot] = {};
    ++firings_[firing].live;
    return slot;
  }

  /// The task is done, and who comes after it need not know of it.
  void remove(TaskSlot slot) {
    free_edges(records_[slot].first_edge);
    const std::uint32_t firing = records_[slot].firing;
    forget(slot);
    if (--firings_[firing].live == 0 && firings_[firing].released) {
      forget_firing(firing);
    }
  }

  /// The task ended without having completed: known as that until its firing is released.
  void end(TaskSlot slot) {
    FiringRecord& firing = firings_[records_[slot].firing];
    if (firing.released) return remove(slot);
    free_edges(records_[slot].first_edge);
    TaskRecord& record = records_[slot];
    record.state = TaskState::kEnded;
    record.next = std::exchange(firing.ended, slot);
    --firing.live;
  }

  /// The successor waits for one task more.
  void add_successor(TaskSlot predecessor, TaskSlot successor) {
    add_edge(records_[predecessor].first_edge, successor);
    ++records_[successor].pending;
  }
  /// Appends the successors that are still live, in order of submission.
  void successors(TaskSlot slot, std::vector<TaskSlot>& out) const {
    if (records_[slot].first_edge != kNoSlot) edges_from(records_[slot].first_edge, out);
  }

  /// @param reader  Reads what the task makes, if it completes. The task has ties.
  void add_reader(TaskSlot slot, TaskSlot reader) { add_edge(ties_[slot].first_reader, reader); }
  /// Appends the readers that are still live, in the order in which they were added, and forgets
  /// them.
  void take_readers(TaskSlot slot, std::vector<TaskSlot>& out) {
    edges_from(ties_[slot].first_reader, out);
    free_edges(ties_[slot].first_reader);
  }

 private:
  struct Edge {
    TaskId successor = kNoTask;
    Slot next = kNoSlot;
  };
  struct FiringRecord {
    FiringId id = 0;
    std::uint32_t live = 0;    ///< Tasks that are not done.
    TaskSlot ended = kNoSlot;  ///< Those that ended without completing, linked by `next`.
    bool released = false;
  };

  void forget(TaskSlot slot) {
    records_[slot].id = kNoTask;
    ++records_[slot].generation;
    records_.give_back(slot);
  }

  void forget_firing(Slot firing) {
    firings_[firing].id = kNoTask;
    firings_.give_back(firing);
  }

  /// @param first  Of a list of edges, newest first.
  void add_edge(Slot& first, TaskSlot successor) {
    const Slot edge = edges_.take();
    edges_[edge] = {records_[successor].id, first};
    first = edge;
  }

  void edges_from(Slot first, std::vector<TaskSlot>& out) const {
    const auto begin = static_cast<std::ptrdiff_t>(out.size());
    for (Slot e = first; e != kNoSlot; e = edges_[e].next) {
      const TaskSlot successor = find_live(edges_[e].successor);
      if (successor != kNoSlot) out.push_back(successor);
    }
    std::reverse(out.begin() + begin, out.end());
  }

  void free_edges(Slot& first) {
    for (Slot e = std::exchange(first, kNoSlot); e != kNoSlot; e = edges_[e].next) {
      edges_.give_back(e);
    }
  }

  SlotTable<TaskRecord> records_;
  std::vector<TaskTies> ties_;  ///< By slot, as far as there was need of them.
  SlotTable<Edge> edges_;
  SlotTable<FiringRecord> firings_;
  std::uint32_t firing_number_ = 0;
};

}  // namespace pirt
