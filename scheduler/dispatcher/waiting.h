// Tasks that could start and are in no unit's queue: held back by the policy, or in the global
// high-priority queue. They are kept by class, so that a long backlog costs one question.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include "scheduler/dispatcher/task_list.h"
#include "scheduler/dispatcher/task_store.h"
#include "scheduler/mix/task.h"
#include "scheduler/policies/policy.h"

namespace pirt {

class Waiting {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  /// Tasks of one class are placed, and refused, together.
  struct Class {
    TaskClass kind;
    UnitMask takers = 0;  ///< Of the units that are up.
    TaskList held = {};
    TaskList high_priority = {};
    /// Those of both with a deadline, once calls suspend and where the policy does not rank: ranks
    /// of one class rise with deadlines.
    std::set<ByDeadline> urgent = {};
    bool in_holding = false;            ///< It is in holding_,
    bool in_prioritized = false;        ///< and in prioritized_.
    bool refused = false;               ///< For as long as its refusal stands.
    bool parked = false;                ///< Refused until another entry has had its turn.
    bool hopeless = false;              ///< No unit that is left for it would ever take it.
    std::uint32_t next_parked = kNone;  ///< Behind the same entry.
    /// It is refused until the load of one of these falls; absent = until anything happens.
    std::optional<UnitMask> awaits = {};
  };

  /// @param tasks  Must outlive it, as must the policy.
  Waiting(TaskStore& tasks, Policy& policy) : tasks_(tasks), policy_(policy) {}

  /// That of a task which is given its class: a task graph has one a task; elsewhere the same come
  /// again and again.
  [[nodiscard]] std::uint32_t class_of(const TaskClass& kind, UnitMask up) {
    if (last_class_ < classes_.size() && classes_[last_class_].kind == kind) return last_class_;
    return last_class_ = find_class(kind, up);
  }
  [[nodiscard]] Class& class_at(TaskSlot slot) { return classes_[tasks_[slot].class_index]; }
  [[nodiscard]] const Class& class_at(TaskSlot slot) const {
    return classes_[tasks_[slot].class_index];
  }
  void set_up(UnitMask up) {
    for (Class& each : classes_) {
      each.takers = policy_.takers(each.kind, up);
      each.refused = each.parked;
    }
  }

  [[nodiscard]] std::size_t size() const { return held_count_ + high_priority_count_; }
  [[nodiscard]] bool holds_any() const { return held_count_ != 0; }
  [[nodiscard]] bool prioritizes_any() const { return high_priority_count_ != 0; }
  void hold(TaskSlot slot);
  void prioritize(TaskSlot slot);
  /// @param slot  Is held, or in the high-priority queue.
  void erase(TaskSlot slot);

  /// The class is not asked for, whatever happens, until had_turn() of @p entry: a graph's tasks
  /// are a class each, and most of them wait for their turn.
  void park(Class& entry_class, std::uint32_t entry);
  /// A task of the entry was placed, or is gone.
  void had_turn(std::uint32_t entry) {
    if (entry < first_parked_.size() && first_parked_[entry] != kNone) wake_parked(entry);
  }
  /// A load fell, a unit changed, or a task ended: what was refused is asked for again, if it
  /// does not await what has not happened.
  void forget_refusals() { refusals_stand_ = false; }
  /// The load of the unit fell.
  void note_fall(UnitId unit) { fallen_ |= unit_bit(unit); }
  /// Places what is held, in the order of all queues, until every class is refused: what has become
  /// ready competes with what was held. Loads only rise meanwhile, so that a refusal stands.
  /// @param place  bool(TaskSlot): false if the policy refuses it.
  template <typename Place>
  void place_held(const Place& place) {
    if (held_count_ == 0) return;
    list_asking();
    while (!asking_.empty()) {
      std::ranges::pop_heap(asking_, Later{tasks_});
      Class& first = *asking_.back();
      const TaskSlot slot = first.held.front();
      erase(slot);
      first.refused = !place(slot);
      if (first.refused) hold(slot);
      if (first.refused || first.held.empty()) {
        asking_.pop_back();
      } else {
        std::ranges::push_heap(asking_, Later{tasks_});
      }
    }
  }
  /// The first of the high-priority queue that the unit may take; kNoSlot if there is none.
  [[nodiscard]] TaskSlot first_for(UnitId unit) {
    return high_priority_count_ == 0 ? kNoSlot : find_first_for(unit);
  }

  /// Some call has ended a slice.
  [[nodiscard]] bool slices_end() const { return slices_end_; }
  /// One has, from now on.
  void note_urgent();
  /// The task with the nearest deadline of each class that is held, or in the high-priority queue,
  /// and that the unit may take.
  template <typename Visit>
  void visit_nearest_for(UnitId unit, const Visit& visit) {
    const auto visit_of = [&](const std::vector<std::uint32_t>& classes, TaskList Class::*list) {
      for (const std::uint32_t index : classes) {
        const Class& entry = classes_[index];
        if (!contains(entry.takers, unit) || (entry.*list).empty()) continue;
        visit(entry.urgent.empty() ? (entry.*list).front() : std::get<2>(*entry.urgent.begin()));
      }
    };
    visit_of(holding_, &Class::held);
    visit_of(prioritized_, &Class::high_priority);
  }

  /// Appends the tasks that @p unit could have taken, in no queue from now on.
  void take_those_of(UnitId unit, UnitMask gone, std::vector<TaskSlot>& out);
  /// Whether tasks are held that no unit will ever take.
  [[nodiscard]] bool despairs() const { return despair_; }
  /// Each of them, in no queue from now on.
  template <typename Visit>
  void take_hopeless(const Visit& visit) {
    despair_ = false;
    for (Class& entry : classes_) {
      while (entry.hopeless && !entry.held.empty()) {
        const TaskSlot slot = entry.held.front();
        erase(slot);
        visit(slot);
      }
    }
  }

 private:
  struct ClassHash {
    std::size_t operator()(const TaskClass& kind) const;
  };
  /// Of classes with held tasks: which is asked for later.
  struct Later {
    const TaskStore& tasks;
    bool operator()(const Class* a, const Class* b) const {
      return precedes(tasks[b->held.front()], tasks[a->held.front()]);
    }
  };

  [[nodiscard]] bool is_urgent(TaskSlot slot) const {
    const TaskRecord& record = tasks_[slot];
    return slices_end_ && record.deadline != Nanos::max() && record.rank == Nanos::zero();
  }
  void note_deadline(Class& entry, TaskSlot slot) {
    if (is_urgent(slot)) entry.urgent.insert(tasks_.by_deadline(slot));
  }
  std::uint32_t find_class(const TaskClass& kind, UnitMask up);
  void wake_parked(std::uint32_t entry);
  void note_holding(std::uint32_t index);
  void list_asking();
  [[nodiscard]] TaskSlot find_first_for(UnitId unit);

  TaskStore& tasks_;
  Policy& policy_;
  std::vector<Class> classes_;
  std::unordered_map<TaskClass, std::uint32_t, ClassHash> class_indices_;
  std::uint32_t last_class_ = 0;
  std::vector<std::uint32_t>
      holding_;  ///< Classes with held tasks, and some that had; none parked.
  std::vector<std::uint32_t> first_parked_;  ///< By entry: the classes that are parked behind it.
  std::vector<std::uint32_t> prioritized_;   ///< The same for the high-priority queue.
  std::vector<Class*> asking_;  ///< Of place_held: a heap, that of the first task on top.
  bool refusals_stand_ = true;  ///< Those that await anything.
  bool slices_end_ = false;
  UnitMask fallen_ = 0;  ///< Units whose load fell since they were asked for.
  bool despair_ = false;
  std::size_t held_count_ = 0;
  std::size_t high_priority_count_ = 0;
};

}  // namespace pirt
