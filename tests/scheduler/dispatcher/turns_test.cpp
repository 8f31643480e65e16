// Tasks that wait for their turn, as a plan has it, or for a unit, are asked for when that comes
// and not before.
#include "tests/scheduler/support.h"

namespace pirt::test {
namespace {

/// One unit takes entry after entry, one at a time; counts what it is asked.
class InTurn final : public Policy {
 public:
  InTurn(std::size_t entries, int& asked) : had_(entries, false), asked_(asked) {}

  Placement place(const TaskClass& task, const UnitsView& units) override {
    ++asked_;
    if (task.entry > 0 && !had_[task.entry - 1]) return Placement::hold_behind(task.entry - 1);
    if (units.load[0] > 0) return Placement::hold();
    return Placement::on(0);
  }
  UnitMask takers(const TaskClass&, UnitMask up) const override { return up; }
  void moved(const MovedTask& task, Whereabouts from, Whereabouts, const UnitsView&) override {
    if (from.waits()) had_[task.kind.entry] = true;
  }

 private:
  std::vector<bool> had_;
  int& asked_;
};

constexpr std::uint32_t kTasks = 500;

/// Entries in falling order, so that the last that becomes ready goes first.
std::vector<NamedTask> backwards() {
  std::vector<NamedTask> tasks;
  for (std::uint32_t i = 0; i < kTasks; ++i) {
    tasks.push_back(task_of(i, {.eligible = 1, .entry = kTasks - 1 - i}));
  }
  return tasks;
}

TEST(Turns, AreTakenWithoutAskingForAllThatWait) {
  int asked = 0;
  NamedDispatcher dispatcher({1}, std::make_unique<InTurn>(kTasks, asked));
  Effects out;
  ASSERT_TRUE(dispatcher.submit(0, backwards(), Nanos(0), out));
  for (std::uint32_t entry = 0; entry < kTasks; ++entry) {
    ASSERT_EQ(out.started.size(), entry + 1U);
    EXPECT_EQ(out.started.back().task, kTasks - 1 - entry);
    ASSERT_TRUE(dispatcher.complete(0, out.started.back().task, Outcome::kCompleted,
                                    Nanos(entry + 1), out));
  }
  EXPECT_EQ(dispatcher.counts().completed, kTasks);
  EXPECT_LE(asked, 4 * static_cast<int>(kTasks));
}

/// As Algorithms 2 and 3 with weights of 1, and what it is asked by workload.
class Counted final : public Policy {
 public:
  Counted(std::unique_ptr<Policy> policy, std::vector<int>& asked)
      : policy_(std::move(policy)), asked_(asked) {}
  Placement place(const TaskClass& task, const UnitsView& units) override {
    ++asked_[task.workload];
    return policy_->place(task, units);
  }
  UnitMask takers(const TaskClass& task, UnitMask up) const override {
    return policy_->takers(task, up);
  }
  std::vector<UnitId> order() const override { return policy_->order(); }

 private:
  std::unique_ptr<Policy> policy_;
  std::vector<int>& asked_;
};

// One workload is served on the GPU alone, the other on the DSP: each is asked for once a call that
// ends there, and when a unit changes.
TEST(Turns, WhatWaitsForUnitsIsAskedForWhenTheirLoadsFall) {
  for (const char* mode : {"throughput", "energy", "olb"}) {
    SCOPED_TRACE(mode);
    PolicySetup setup = setup_of(1, 1, 1);
    setup.weights = {{1, 1, 1, 0}, {1, 1, 1, 0}};
    setup.servers = {1, 1, 1, 1};
    std::vector<int> asked(2, 0);
    NamedDispatcher dispatcher({1, 1, 1, 1},
                               std::make_unique<Counted>(policy_of(mode, setup), asked));
    Effects out;
    TaskId next = 0;
    for (int i = 0; i < 20; ++i) {
      for (const WorkloadId workload : {0U, 1U}) {
        const NamedTask task = task_of(
            next, {.workload = workload, .eligible = unit_bit(workload == 0 ? kGpu : kDsp)});
        ASSERT_TRUE(dispatcher.submit(next++, std::span(&task, 1), Nanos(0), out));
      }
    }
    ASSERT_EQ(out.started.size(), 2U);  // Tasks 0 and 1.
    asked = {0, 0};
    for (TaskId task = 0; task < 20; task += 2) {
      ASSERT_TRUE(dispatcher.complete(kGpu, task, Outcome::kCompleted, Nanos(1), out));
      ASSERT_EQ(out.started.back().task, task + 2);
    }
    EXPECT_EQ(asked, (std::vector{20, 0}));  // The next, and then one more, which is refused.
    dispatcher.set_unit(kCpu, UnitState::kDraining, Nanos(2), out);
    EXPECT_EQ(asked, (std::vector{21, 1}));
    dispatcher.cancel(39, Nanos(3), out);  // It waits, which changes nothing for the others.
    EXPECT_EQ(asked, (std::vector{21, 1}));
  }
}

TEST(Turns, OfWhatIsGoneAreOver) {
  int asked = 0;
  NamedDispatcher dispatcher({1}, std::make_unique<InTurn>(kTasks, asked));
  Effects out;
  ASSERT_TRUE(dispatcher.submit(0, backwards(), Nanos(0), out));
  // Entry 0 runs; 1 is cancelled while it waits, and 2 goes next.
  dispatcher.cancel(kTasks - 2, Nanos(1), out);
  ASSERT_TRUE(dispatcher.complete(0, kTasks - 1, Outcome::kCompleted, Nanos(2), out));
  ASSERT_EQ(out.started.size(), 2U);
  EXPECT_EQ(out.started.back().task, kTasks - 3);
}

}  // namespace
}  // namespace pirt::test
