// How tasks come in: registered, linked to what they come after, and placed where they may start.
#include <algorithm>
#include <utility>

#include "scheduler/dispatcher/dispatcher.h"

namespace pirt {
namespace {

/// Whether other tasks than those that it comes after bear on it.
bool is_tied(const Task& task) { return task.state || task.series || !task.reads.empty(); }

}  // namespace

bool Dispatcher::submit(FiringId firing, std::span<const Task> tasks, Nanos now, Effects& out) {
  const auto input = [&] {
    return DispatcherInput{
        .kind = DispatcherInput::Kind::kSubmit, .now = now_, .firing = firing, .tasks = tasks};
  };
  return take(now, out, input, [&] {
    if (!add(firing, tasks, nullptr)) return false;
    place_added(out);
    return true;
  });
}

bool Dispatcher::submit(FiringId firing, TemplateId of, std::span<const Task> tasks, Nanos now,
                        Effects& out) {
  const auto input = [&] {
    return DispatcherInput{
        .kind = DispatcherInput::Kind::kSubmit, .now = now_, .firing = firing, .tasks = tasks};
  };
  return take(now, out, input, [&] {
    const bool fits = of < templates_.size() && templates_[of].class_of.size() == tasks.size();
    if (!fits || !add(firing, tasks, &templates_[of])) return false;
    place_added(out);
    return true;
  });
}

/// What was added is submitted.
void Dispatcher::place_added(Effects& out) {
  counts_.submitted += static_cast<std::int64_t>(added_.size());
  // A task may have been dropped with one before it.
  for (const TaskSlot each : doomed_) {
    if (tasks_[each].state == TaskState::kWaiting) drop(each, TaskEnd::kDropped, out);
  }
  if (ties_.has_news()) drop_unmet(out);
  expire(Expire::kBeforeNow, out);
  const bool alone = added_.size() == 1;
  for (const TaskSlot each : added_) {
    if (tasks_[each].state == TaskState::kWaiting && tasks_[each].pending == 0) {
      make_ready(each, alone);
    }
  }
  settle(out);
}

/// Registers the tasks and links them to those that they come after. False, and nothing changed, if
/// one makes no sense.
/// @param known  Their template; null = they have none.
bool Dispatcher::add(FiringId firing, std::span<const Task> tasks, Template* known) {
  const auto [place, is_new] = tasks_.open_firing(firing);
  if (place == kNoSlot) return false;
  added_.clear();
  doomed_.clear();
  bool good = register_all(place, tasks, known != nullptr);
  if (good && known != nullptr) {
    link_all(*known);
  } else {
    for (std::size_t i = 0; good && i < tasks.size(); ++i) good = link(added_[i], tasks[i]);
  }
  if (!good) {
    for (const TaskSlot each : added_) tasks_.remove(each);
    if (is_new) tasks_.release(firing);
    return false;
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
  return true;
}

bool Dispatcher::is_sound(const Task& task) const {
  return task.kind.eligible != 0 && (task.kind.eligible & ~all_) == 0 &&
         task.state.value_or(0) < kMaxStates && task.series.value_or(0) < kMaxSeries &&
         std::ranges::all_of(task.reads, [](SeriesId each) { return each < kMaxSeries; });
}

Dispatcher::TemplateId Dispatcher::add_template(std::span<const Task> tasks) {
  Template made;
  made.class_of.assign(tasks.size(), Waiting::kNone);
  for (std::uint32_t i = 0; i < tasks.size(); ++i) {
    if (!is_sound(tasks[i])) return kNoTemplate;
    made.binds = made.binds || is_tied(tasks[i]);
    for (const TaskId id : tasks[i].after) {
      const auto before = std::ranges::find(tasks.first(i), id, &Task::id);
      if (before == tasks.first(i).end()) return kNoTemplate;
      made.after.emplace_back(static_cast<std::uint32_t>(before - tasks.first(i).begin()), i);
    }
  }
  templates_.push_back(std::move(made));
  return static_cast<TemplateId>(templates_.size() - 1);
}

/// Those before one that makes no sense.
/// @param are_sound  Each by itself, as is known.
bool Dispatcher::register_all(std::uint32_t firing, std::span<const Task> tasks, bool are_sound) {
  for (const Task& task : tasks) {
    const TaskSlot slot = are_sound || is_sound(task) ? tasks_.add(task.id, firing) : kNoSlot;
    if (slot == kNoSlot) return false;
    added_.push_back(slot);
  }
  return true;
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

/// False if the task comes after itself or one that is not linked yet.
bool Dispatcher::link(TaskSlot slot, const Task& task) {
  bool doomed = false;
  for (const TaskId id : task.after) {
    const TaskSlot predecessor = tasks_.find(id);
    if (predecessor == kNoSlot) continue;
    const TaskState state = tasks_[predecessor].state;
    if (state == TaskState::kNew) return false;
    if (is_over(state)) {
      doomed = true;
    } else {
      tasks_.add_successor(predecessor, slot);
      ++tasks_[slot].pending;
    }
  }
  tasks_[slot].state = TaskState::kWaiting;
  if (doomed) doomed_.push_back(slot);
  return true;
}

/// As the template says, in the same order.
void Dispatcher::link_all(const Template& known) {
  for (const TaskSlot each : added_) tasks_[each].state = TaskState::kWaiting;
  for (const auto& [before, behind] : known.after) {
    tasks_.add_successor(added_[before], added_[behind]);
    ++tasks_[added_[behind]].pending;
  }
}

}  // namespace pirt
