// What the scheduler's tests share: platforms from a few lines of YAML, and dispatchers that say
// what they did as text.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

inline Task task_of(TaskId id, TaskClass kind, std::span<const TaskId> after = {}) {
  return {.id = id, .kind = kind, .deadline = {}, .expires_at = {}, .after = after};
}

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
      : dispatcher_(std::make_unique<Dispatcher>(std::move(slots), std::move(policy))) {}

  /// One task, as a firing of its own that has the task's id.
  std::string submit(TaskId id, TaskClass kind = {.eligible = kLocal},
                     std::vector<TaskId> after = {},
                     std::optional<Nanos> expires_at = std::nullopt) {
    return submit_all(
        id, {{.id = id, .kind = kind, .deadline = {}, .expires_at = expires_at, .after = after}});
  }
  std::string submit_all(FiringId firing, const std::vector<Task>& tasks) {
    return taken(dispatcher_->submit(firing, tasks, now_, out_));
  }
  std::string submit_all(FiringId firing, const std::vector<Task>& tasks,
                         Dispatcher::TemplateId of) {
    return taken(dispatcher_->submit(firing, of, tasks, now_, out_));
  }
  /// One that is to have completed elsewhere than in the cloud by then.
  std::string submit_recalled(TaskId id, TaskClass kind, Nanos at) {
    return submit_all(id, {{.id = id,
                            .kind = kind,
                            .deadline = {},
                            .expires_at = {},
                            .recall = Recall{at, unit_bit(kCloud)}}});
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
  const Dispatcher& dispatcher() const { return *dispatcher_; }
  Dispatcher& dispatcher() { return *dispatcher_; }

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
    for (const Sliced& left : out_.left) add('~', left.task);
    for (const Start& start : out_.started) add(letter(start.unit), start.task);
    for (const Ended& ended : out_.ended)
      add(" x-! ?"[static_cast<std::size_t>(ended.how)], ended.task);
    for (const Recalled& recalled : out_.recalled) add('<', recalled.task);
    for (const Sliced& resumed : out_.resumed) add('+', resumed.task);
    out_.clear();
    return text;
  }

  std::unique_ptr<Dispatcher> dispatcher_;
  Effects out_;
  Nanos now_{0};
};

}  // namespace pirt::test
