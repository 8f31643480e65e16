// How tasks come in: registered, linked to what they come after, and placed where they may start.
#include <algorithm>
#include <utility>

#include "scheduler/dispatcher/dispatcher.h"

namespace pirt {
namespace {

/// Whether other tasks than those that it comes after bear on it.
bool is_tied(const Task& task) { return task.state || task.series || !task.reads.empty(); }

}  // namespace

std::optional<FiringId> Dispatcher::submit(std::span<const Task> tasks, Nanos now, Effects& out) {
  return submit_if(are_sound(tasks), nullptr, tasks, now, out);
}

std::optional<FiringId> Dispatcher::submit(TemplateId of, std::span<const Task> tasks, Nanos now,
                                           Effects& out) {
  const bool fits = of < templates_.size() && templates_[of].class_of.size() == tasks.size();
  return submit_if(fits, fits ? &templates_[of] : nullptr, tasks, now, out);
}

/// @param known  Their template; null = they have none.
std::optional<FiringId> Dispatcher::submit_if(bool sound, Template* known,
                                              std::span<const Task> tasks, Nanos now,
                                              Effects& out) {
  std::optional<FiringId> firing;
  take({.kind = DispatcherInput::Kind::kSubmit, .tasks = tasks}, now, out,
       [&](DispatcherInput& input) {
         if (!sound) return false;
         const Slot slot = tasks_.add_firing();
         input.firing = firing.emplace(tasks_.firing_id(slot));
         add(slot, tasks, known, out);
         place_added(out);
         return true;
       });
  return firing;
}

/// What was added is submitted.
void Dispatcher::place_added(Effects& out) {
  counts_.submitted += static_cast<std::int64_t>(added_.size());
  // A task may have been dropped with one before it.
  for (const TaskSlot each : doomed_) {
    if (tasks_[each].state == TaskState::kWaiting) drop(each, TaskEnd::kDropped, out);
  }
  if (ties_.has_news()) drop_unmet(out);
  expire(now_, out);
  const bool alone = added_.size() == 1;
  for (const TaskSlot each : added_) {
    if (tasks_[each].state == TaskState::kWaiting && tasks_[each].pending == 0) {
      make_ready(each, alone);
    }
  }
  settle(out);
}

/// Registers the tasks and links them to those that they come after.
/// @param known  Their template; null = they have none.
void Dispatcher::add(Slot firing, std::span<const Task> tasks, Template* known, Effects& out) {
  added_.clear();
  doomed_.clear();
  for (const Task& task : tasks) {
    const TaskSlot slot = added_.emplace_back(tasks_.add(firing));
    out.submitted.push_back(tasks_[slot].id);
    if (known == nullptr) link(slot, task.after);
    for (const std::uint32_t before : task.after_own) tasks_.add_successor(added_[before], slot);
  }
  bool binds = known != nullptr && known->binds;
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    const Task& task = tasks[i];
    TaskRecord& record = tasks_[added_[i]];
    if (known == nullptr) {
      record.class_index = waiting_.class_of(task.kind, up_);
      binds = binds || is_tied(task);
    } else {
      std::uint32_t& its_class = known->class_of[i];
      if (its_class == Waiting::kNone) its_class = waiting_.class_of(task.kind, up_);
      record.class_index = its_class;
    }
    record.rank = policy_->rank(task);
    if (task.deadline) record.deadline = *task.deadline;
    binds = binds || task.expires_at || task.recall;
  }
  if (binds) bind(tasks);
}

bool Dispatcher::are_sound(std::span<const Task> tasks) const {
  const auto is_series = [](SeriesId each) { return each < kMaxSeries; };
  for (std::uint32_t i = 0; i < tasks.size(); ++i) {
    const Task& task = tasks[i];
    const bool sound = task.kind.eligible != 0 && (task.kind.eligible & ~all_) == 0 &&
                       task.state.value_or(0) < kMaxStates && is_series(task.series.value_or(0)) &&
                       std::ranges::all_of(task.reads, is_series) &&
                       std::ranges::all_of(task.after_own, [i](auto each) { return each < i; });
    if (!sound) return false;
  }
  return true;
}

Dispatcher::TemplateId Dispatcher::add_template(std::span<const Task> tasks) {
  if (!are_sound(tasks)) return kNoTemplate;
  Template made;
  made.class_of.assign(tasks.size(), Waiting::kNone);
  for (const Task& task : tasks) {
    if (!task.after.empty()) return kNoTemplate;
    made.binds = made.binds || is_tied(task);
  }
  templates_.push_back(std::move(made));
  return static_cast<TemplateId>(templates_.size() - 1);
}

/// What only some tasks have.
void Dispatcher::bind(std::span<const Task> tasks) {
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    if (tasks[i].expires_at) {
      tasks_.tie(added_[i]).expires_at = tasks[i].expires_at;
      expiries_.watch(added_[i], *tasks[i].expires_at);
    }
    if (tasks[i].recall) {
      tasks_.tie(added_[i]).recall = tasks[i].recall;
      recalls_.watch(added_[i], tasks[i].recall->at);
    }
    ties_.await_earlier(added_[i], tasks[i]);
  }
  for (std::size_t i = 0; i < tasks.size(); ++i) ties_.join(added_[i], tasks[i]);
}

/// To what it comes after of earlier submissions.
void Dispatcher::link(TaskSlot slot, std::span<const TaskId> after) {
  bool doomed = std::ranges::find(after, kNoTask) != after.end();
  for (const TaskId id : after) {
    const TaskSlot predecessor = tasks_.find(id);
    if (predecessor == kNoSlot || predecessor == slot) continue;  // Itself: a guess at its id.
    if (is_over(tasks_[predecessor].state)) {
      doomed = true;
    } else {
      tasks_.add_successor(predecessor, slot);
    }
  }
  if (doomed) doomed_.push_back(slot);
}

}  // namespace pirt
