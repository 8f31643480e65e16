// What the scheduler's tests share: platforms from a few lines of YAML, and dispatchers that say
// what they did as text.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/policies/policy.h"
#include "scheduler/schedule.h"
#include "tests/support/errors.h"

namespace pirt::test {

inline Platform platform_of(const std::string& yaml) {
  return parse_platform("test.yaml", yaml, {}, 4);
}
inline Mix mix_of(const std::string& yaml) { return parse_mix("test.yaml", yaml); }

/// Units gpu, dsp, cpu, cloud: the letters that sequences are written in.
inline const std::vector<Role> kRoles = {Role::kGpu, Role::kDsp, Role::kCpu, Role::kCloud};
inline constexpr UnitId kGpu = 0, kDsp = 1, kCpu = 2, kCloud = 3;
inline constexpr UnitMask kLocal = 0b0111;
inline constexpr UnitMask kAll = 0b1111;

inline char letter(UnitId unit) { return "GDCL"[unit]; }

/// A policy for one workload on those units.
inline PolicySetup setup_of(int gpu, int dsp, int cpu) {
  PolicySetup setup;
  setup.roles = kRoles;
  setup.basic = &find_basic_policy("throughput");
  setup.weights = {{gpu, dsp, cpu, 0}};
  return setup;
}

/// A task under a name of the test's own; what it comes after is named likewise.
struct NamedTask {
  TaskId id = 0;
  TaskClass kind;
  std::optional<Nanos> deadline = {};
  std::optional<Nanos> expires_at = {};
  std::optional<Recall> recall = {};
  std::span<const TaskId> after = {};
  std::optional<StateId> state = {};
  std::optional<SeriesId> series = {};
  std::span<const SeriesId> reads = {};
};

inline NamedTask task_of(TaskId id, TaskClass kind, std::span<const TaskId> after = {}) {
  return {.id = id, .kind = kind, .after = after};
}

/// A dispatcher that speaks of tasks and firings by the names that a test gives them.
class NamedDispatcher : public Dispatcher {
 public:
  using Dispatcher::Dispatcher;

  bool submit(FiringId firing, std::span<const NamedTask> tasks, Nanos now, Effects& out) {
    const Unnamed unnamed(*this, tasks);
    return submitted(firing, tasks, out,
                     [&](Effects& made) { return Dispatcher::submit(unnamed.tasks, now, made); });
  }
  bool submit(FiringId firing, TemplateId of, std::span<const NamedTask> tasks, Nanos now,
              Effects& out) {
    const Unnamed unnamed(*this, tasks);
    return submitted(firing, tasks, out, [&](Effects& made) {
      return Dispatcher::submit(of, unnamed.tasks, now, made);
    });
  }
  TemplateId add_template(std::span<const NamedTask> tasks) {
    return Dispatcher::add_template(Unnamed(*this, tasks).tasks);
  }
  bool release(FiringId firing, Nanos now) {
    return Dispatcher::release(find(firings_, firing), now);
  }
  bool complete(UnitId unit, TaskId task, Outcome outcome, Nanos now, Effects& out) {
    return named(out, [&](Effects& made) {
      return Dispatcher::complete(unit, find(ids_, task), outcome, now, made);
    });
  }
  bool slice_ended(UnitId unit, TaskId task, Nanos now, Effects& out) {
    return named(out, [&](Effects& made) {
      return Dispatcher::slice_ended(unit, find(ids_, task), now, made);
    });
  }
  void cancel(TaskId task, Nanos now, Effects& out) {
    named(out, [&](Effects& made) {
      Dispatcher::cancel(find(ids_, task), now, made);
      return true;
    });
  }
  bool set_unit(UnitId unit, UnitState state, Nanos now, Effects& out) {
    return named(out, [&](Effects& made) { return Dispatcher::set_unit(unit, state, now, made); });
  }
  void wake(Nanos now, Effects& out) {
    named(out, [&](Effects& made) {
      Dispatcher::wake(now, made);
      return true;
    });
  }
  [[nodiscard]] std::optional<TaskState> state(TaskId task) const {
    return Dispatcher::state(find(ids_, task));
  }
  [[nodiscard]] std::optional<Recall> recall(TaskId task) const {
    return Dispatcher::recall(find(ids_, task));
  }

 private:
  using Names = std::map<std::uint64_t, std::uint64_t>;
  /// What a dispatcher is given in the place of such tasks.
  struct Unnamed {
    Unnamed(const NamedDispatcher& dispatcher, std::span<const NamedTask> named)
        : tasks(named.size()), after(named.size()), after_own(named.size()) {
      for (std::size_t i = 0; i < named.size(); ++i) {
        const NamedTask& task = named[i];
        for (const TaskId each : task.after) {
          const auto own = std::ranges::find(named, each, &NamedTask::id);
          if (own == named.end()) {
            after[i].push_back(find(dispatcher.ids_, each));
          } else {
            after_own[i].push_back(static_cast<std::uint32_t>(own - named.begin()));
          }
        }
        tasks[i] = {.kind = task.kind,
                    .deadline = task.deadline,
                    .expires_at = task.expires_at,
                    .recall = task.recall,
                    .after = after[i],
                    .after_own = after_own[i],
                    .state = task.state,
                    .series = task.series,
                    .reads = task.reads};
      }
    }
    std::vector<Task> tasks;
    std::vector<std::vector<TaskId>> after;
    std::vector<std::vector<std::uint32_t>> after_own;
  };

  static std::uint64_t find(const Names& names, std::uint64_t name) {
    const auto found = names.find(name);
    return found == names.end() ? kNoTask - 1 : found->second;  // Nobody has that.
  }
  template <typename Call>
  bool submitted(FiringId firing, std::span<const NamedTask> tasks, Effects& out,
                 const Call& call) {
    return named(out, [&](Effects& made) {
      const auto id = call(made);
      if (id) firings_[firing] = *id;
      for (std::size_t i = 0; i < made.submitted.size(); ++i) {
        ids_[tasks[i].id] = made.submitted[i];
        names_[made.submitted[i]] = tasks[i].id;
      }
      return id.has_value();
    });
  }
  /// Appends what the call brings about, by name.
  template <typename Call>
  bool named(Effects& out, const Call& call) {
    Effects made;
    const bool taken = call(made);
    const auto append = [this](auto& to, auto& from) {
      for (auto& each : from) each.task = names_.at(each.task);
      to.insert(to.end(), from.begin(), from.end());
    };
    append(out.started, made.started);
    append(out.ended, made.ended);
    append(out.recalled, made.recalled);
    append(out.suspended, made.suspended);
    append(out.resumed, made.resumed);
    return taken;
  }

  Names ids_, names_, firings_;
};

inline std::unique_ptr<Policy> policy_of(const std::string& name, const PolicySetup& setup) {
  return find_policy(name).make(setup);
}

/// A dispatcher whose every input appends to one text what it brought about: "G3" = task 3 started
/// on the GPU, "-3" = dropped, "!3" = expired, "?3" = no earlier firing has its data, "x3" = given
/// back and failed, "<3" = wanted back from its unit, "~3" = left between two slices, "+3" = goes
/// on after that, "refused".
class Script {
 public:
  Script(std::unique_ptr<Policy> policy, std::vector<std::optional<int>> slots)
      : dispatcher_(std::make_unique<NamedDispatcher>(std::move(slots), std::move(policy))) {}

  /// One task, as a firing of its own that has the task's id.
  std::string submit(TaskId id, TaskClass kind = {.eligible = kLocal},
                     std::vector<TaskId> after = {},
                     std::optional<Nanos> expires_at = std::nullopt) {
    return submit_all(
        id, {{.id = id, .kind = kind, .deadline = {}, .expires_at = expires_at, .after = after}});
  }
  std::string submit_all(FiringId firing, const std::vector<NamedTask>& tasks) {
    return taken(dispatcher_->submit(firing, tasks, now_, out_));
  }
  std::string submit_all(FiringId firing, const std::vector<NamedTask>& tasks,
                         Dispatcher::TemplateId of) {
    return taken(dispatcher_->submit(firing, of, tasks, now_, out_));
  }
  /// One that is to have completed elsewhere than in the cloud by then.
  std::string submit_recalled(TaskId id, TaskClass kind, Nanos at) {
    return submit_all(id, {{.id = id, .kind = kind, .recall = Recall{at, unit_bit(kCloud)}}});
  }
  bool release(FiringId firing) { return dispatcher_->release(firing, now_); }
  std::string complete(UnitId unit, TaskId id, Outcome outcome = Outcome::kCompleted) {
    return taken(dispatcher_->complete(unit, id, outcome, now_, out_));
  }
  std::string slice(UnitId unit, TaskId id) {
    return taken(dispatcher_->slice_ended(unit, id, now_, out_));
  }
  std::string cancel(TaskId id) {
    dispatcher_->cancel(id, now_, out_);
    return take();
  }
  std::string set(UnitId unit, UnitState state) {
    return taken(dispatcher_->set_unit(unit, state, now_, out_));
  }
  std::string wake(Nanos now) {
    now_ = now;
    dispatcher_->wake(now_, out_);
    return take();
  }
  void at(Nanos now) { now_ = now; }
  const NamedDispatcher& dispatcher() const { return *dispatcher_; }
  NamedDispatcher& dispatcher() { return *dispatcher_; }

 private:
  std::string taken(bool taken) {
    const std::string text = take();
    EXPECT_TRUE(taken || text.empty());
    return taken ? text : "refused";
  }
  std::string take() {
    std::string text;
    const auto add = [&](char what, TaskId id) {
      if (!text.empty()) text += ' ';
      text += what + std::to_string(id);
    };
    for (const Sliced& left : out_.suspended) add('~', left.task);
    for (const Start& start : out_.started) add(letter(start.unit), start.task);
    for (const Ended& ended : out_.ended)
      add(" x-! ?"[static_cast<std::size_t>(ended.how)], ended.task);
    for (const Recalled& recalled : out_.recalled) add('<', recalled.task);
    for (const Sliced& resumed : out_.resumed) add('+', resumed.task);
    out_.clear();
    return text;
  }

  std::unique_ptr<NamedDispatcher> dispatcher_;
  Effects out_;
  Nanos now_{0};
};

}  // namespace pirt::test
