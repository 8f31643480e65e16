#include "scheduler/dispatcher/waiting.h"

#include <algorithm>

#include "workloads/base/math/random.h"

namespace pirt {

std::size_t Waiting::ClassHash::operator()(const TaskClass& kind) const {
  const std::uint64_t tags =
      (std::uint64_t{kind.entry} << 2) | (kind.real_time ? 2U : 0U) | (kind.image_input ? 1U : 0U);
  return static_cast<std::size_t>(hash_u64(hash_u64(kind.workload, kind.eligible), tags));
}

std::uint32_t Waiting::find_class(const TaskClass& kind, UnitMask up) {
  const auto [found, is_new] =
      class_indices_.try_emplace(kind, static_cast<std::uint32_t>(classes_.size()));
  if (is_new) {
    classes_.push_back({.kind = kind,
                        .takers = policy_.takers(kind, up),
                        .hopeless = policy_.takers(kind, kind.eligible) == 0});
  }
  return found->second;
}

void Waiting::hold(TaskSlot slot) {
  TaskRecord& record = tasks_[slot];
  Class& entry = classes_[record.class_index];
  record.state = TaskState::kHeld;
  entry.held.insert(tasks_, slot);
  note_deadline(entry, slot);
  ++held_count_;
  despair_ = despair_ || entry.hopeless;
  note_holding(record.class_index);
}

void Waiting::note_holding(std::uint32_t index) {
  Class& entry = classes_[index];
  if (!entry.parked && !std::exchange(entry.in_holding, true)) holding_.push_back(index);
}

void Waiting::park(Class& entry_class, std::uint32_t entry) {
  if (first_parked_.size() <= entry) first_parked_.resize(entry + std::size_t{1}, kNone);
  const auto index = static_cast<std::uint32_t>(&entry_class - classes_.data());
  entry_class.parked = true;
  entry_class.next_parked = std::exchange(first_parked_[entry], index);
}

void Waiting::wake_parked(std::uint32_t entry) {
  for (std::uint32_t i = std::exchange(first_parked_[entry], kNone); i != kNone;) {
    Class& each = classes_[i];
    each.parked = each.refused = false;
    if (!each.held.empty()) note_holding(i);
    i = std::exchange(each.next_parked, kNone);
  }
}

void Waiting::prioritize(TaskSlot slot) {
  TaskRecord& record = tasks_[slot];
  Class& entry = classes_[record.class_index];
  record.state = TaskState::kHighPriority;
  entry.high_priority.insert(tasks_, slot);
  note_deadline(entry, slot);
  ++high_priority_count_;
  if (!std::exchange(entry.in_prioritized, true)) prioritized_.push_back(record.class_index);
}

void Waiting::erase(TaskSlot slot) {
  Class& entry = class_at(slot);
  if (is_urgent(slot)) entry.urgent.erase(tasks_.by_deadline(slot));
  if (tasks_[slot].state == TaskState::kHeld) {
    entry.held.erase(tasks_, slot);
    --held_count_;
  } else {
    entry.high_priority.erase(tasks_, slot);
    --high_priority_count_;
  }
}

void Waiting::note_urgent() {
  slices_end_ = true;
  for (Class& entry : classes_) {
    for (const TaskList* list : {&entry.held, &entry.high_priority}) {
      for (TaskSlot slot = list->front(); slot != kNoSlot; slot = tasks_[slot].next) {
        note_deadline(entry, slot);
      }
    }
  }
}

void Waiting::list_asking() {
  asking_.clear();
  std::erase_if(holding_, [this](std::uint32_t index) {
    Class& entry = classes_[index];
    const bool stands = entry.awaits ? (*entry.awaits & fallen_) == 0 : refusals_stand_;
    entry.refused = entry.refused && stands && !entry.held.empty();
    entry.in_holding = !entry.held.empty() && !entry.parked;
    if (entry.in_holding && !entry.refused) asking_.push_back(&entry);
    return !entry.in_holding;
  });
  refusals_stand_ = true;
  fallen_ = 0;
  std::ranges::make_heap(asking_, Later{tasks_});
}

TaskSlot Waiting::find_first_for(UnitId unit) {
  Class* oldest = nullptr;
  std::erase_if(prioritized_, [&](std::uint32_t index) {
    Class& entry = classes_[index];
    entry.in_prioritized = !entry.high_priority.empty();
    if (entry.in_prioritized && contains(entry.takers, unit) &&
        (oldest == nullptr ||
         precedes(tasks_[entry.high_priority.front()], tasks_[oldest->high_priority.front()]))) {
      oldest = &entry;
    }
    return !entry.in_prioritized;
  });
  return oldest == nullptr ? kNoSlot : oldest->high_priority.front();
}

void Waiting::take_those_of(UnitId unit, UnitMask gone, std::vector<TaskSlot>& out) {
  for (Class& entry : classes_) {
    if (!contains(entry.kind.eligible & gone, unit)) continue;
    for (const TaskList* list : {&entry.held, &entry.high_priority}) {
      while (!list->empty()) {
        out.push_back(list->front());
        erase(list->front());
      }
    }
  }
}

}  // namespace pirt
