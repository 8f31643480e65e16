// Random call sequences against a plain model: what must hold whatever happens. Seeded; a failure
// names its seed.
#include <map>
#include <set>

#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

constexpr int kSequences = 3000;
constexpr int kSteps = 120;

/// What the test knows of a task that is not done.
struct Known {
  FiringId firing = 0;
  TaskClass kind;
  std::set<TaskId> waits_for;
  std::optional<UnitId> runs_on;
  bool cancelled = false;
  std::optional<Nanos> expires_at, recall_at;
  std::optional<StateId> state;
  /// What it reads: of each series, how many tasks had joined when it was submitted.
  std::vector<std::pair<SeriesId, std::size_t>> reads;
  UnitMask returned_by = 0;
  int returns = 0;
  bool recalled = false;   ///< And still there.
  bool suspended = false;  ///< Between two slices.
  std::optional<Nanos> deadline;
};

/// What became of a task of a series.
enum class Fate : std::uint8_t { kOpen, kCompleted, kLost };

/// Feeds a dispatcher and checks each answer.
class Model {
 public:
  Model(std::uint64_t seed, bool keep_log)
      : random_(seed), keep_log_(keep_log), templates_(seed % 3 == 0), dispatcher_(make()) {}

  void step() {
    const std::uint64_t what = random_.below(14);
    if (what < 4) {
      submit();
    } else if (what < 7) {
      complete(random_.below(8) == 0 ? Outcome::kFailed : Outcome::kCompleted);
    } else if (what < 8) {
      cancel();
    } else if (what < 9) {
      set_unit();
    } else if (what < 10) {
      release();
    } else if (what < 11) {
      pass_time();
    } else if (what < 12) {
      complete(Outcome::kReturned);
    } else {
      end_slice();
    }
    check();
  }

  /// Brings all units up and completes what runs until nothing does.
  void finish() {
    for (UnitId unit = 0; unit < kRoles.size(); ++unit) {
      if (contains(gone_, unit)) continue;
      dispatcher_.set_unit(unit, UnitState::kUp, now_, out_);
      down_ &= ~unit_bit(unit);
      absorb();
    }
    while (running() != 0) complete(Outcome::kCompleted);
    check();
    // A million firings later memory would still be this.
    for (const FiringId firing : std::set(firings_)) release(firing);
    ASSERT_EQ(dispatcher_.known_tasks(), 0U);
    ASSERT_EQ(dispatcher_.known_firings(), 0U);
  }

  const NamedDispatcher& dispatcher() const { return dispatcher_; }
  const std::string& log() const { return log_; }

 private:
  NamedDispatcher make() {
    // Not those that would never place a task that only other roles can serve.
    std::vector<const PolicyInfo*> modes;
    std::vector<const PolicyInfo*> basic;
    for (const PolicyInfo& each : policies()) {
      if (each.planner != nullptr || each.needs_role) continue;
      modes.push_back(&each);
      if (!each.has_basic()) basic.push_back(&each);
    }
    PolicySetup setup;
    setup.roles = kRoles;
    for (std::size_t unit = 0; unit < kRoles.size(); ++unit) setup.servers.push_back(1 + pick(3));
    for (int w = 0; w < 2; ++w) {
      auto& row = setup.costs.emplace_back();
      for (std::size_t unit = 0; unit < kRoles.size(); ++unit) {
        const Nanos occupied(1 + pick(20));
        row.push_back(CallCost{.total = occupied + Nanos(pick(20)), .occupied = occupied});
      }
    }
    // All of the weights at least 1, so that every task can be placed somewhere.
    for (int w = 0; w < 2; ++w) {
      setup.weights.push_back({1 + pick(4), 1 + pick(4), 1 + pick(4), 0});
    }
    setup.budget = any_budget();
    for (std::size_t unit = 0; unit < kRoles.size(); ++unit) {
      setup.budget_without.push_back(random_.below(2) == 0 ? BudgetPlan{} : any_budget());
    }
    setup.literal_overflow = random_.below(2) == 0;
    setup.basic = basic[random_.below(basic.size())];
    std::vector<std::optional<int>> slots;
    for (std::size_t unit = 0; unit < kRoles.size(); ++unit) {
      slots_.push_back(1 + pick(3));
      slots.emplace_back(slots_.back());
    }
    return {std::move(slots), modes[random_.below(modes.size())]->make(setup)};
  }

  /// Each of the local units may serve the one entry, in some order.
  BudgetPlan any_budget() {
    BudgetPlan::Task task{.units = {kGpu, kDsp, kCpu},
                          .capacity = {},
                          .share = {},
                          .worst = {},
                          .context = {},
                          .prepare = {},
                          .window_j = {}};
    std::swap(task.units[0], task.units[random_.below(3)]);
    for (std::size_t unit = 0; unit < kRoles.size(); ++unit) {
      task.capacity.push_back(1 + pick(3));
      task.share.push_back(1);
      task.worst.emplace_back(1 + pick(20));
      task.context.push_back(static_cast<std::uint32_t>(pick(2)));
      task.prepare.emplace_back(pick(20));
      task.window_j.push_back(0);
    }
    return {.tasks = {task}, .pipelines = {{}}, .window_j = {}};
  }

  int pick(std::uint64_t n) { return static_cast<int>(random_.below(n)); }

  /// One to three tasks, after any that are known: live, ended without completing, of this firing.
  void submit() {
    const FiringId firing = next_firing_++;
    firings_.insert(firing);
    std::vector<NamedTask> tasks(1 + random_.below(3));
    std::vector<std::vector<TaskId>> after(tasks.size());
    std::vector<std::vector<SeriesId>> reads(tasks.size());
    const auto joined = series_;
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      Known known;
      known.firing = firing;
      known.kind = {.workload = static_cast<WorkloadId>(random_.below(2)),
                    .eligible = 1 + random_.below(7),  // Some of gpu, dsp, cpu.
                    .real_time = random_.below(4) != 0,
                    .image_input = random_.below(2) == 0};
      if (random_.below(2) == 0) known.kind.eligible |= unit_bit(kCloud);
      for (const auto& [id, each] : tasks_) {
        if (templates_ && each.firing != firing) continue;
        if (random_.below(templates_ ? 3 : tasks_.size()) < 2) after[i].push_back(id);
      }
      for (const auto& [id, of] : ended_) {
        if (!templates_ && random_.below(20 * ended_.size()) == 0) after[i].push_back(id);
      }
      known.waits_for.insert(after[i].begin(), after[i].end());
      if (random_.below(4) == 0) known.state = static_cast<StateId>(random_.below(2));
      for (SeriesId each = 0; each < series_.size(); ++each) {
        if (random_.below(6) != 0) continue;
        reads[i].push_back(each);
        known.reads.emplace_back(each, joined[each].size());
      }
      if (random_.below(3) == 0) known.expires_at = now_ + Nanos(pick(40) - 2);
      const TaskId id = next_id_++;
      tasks[i] = {.id = id,
                  .kind = known.kind,
                  .expires_at = known.expires_at,
                  .after = after[i],
                  .state = known.state,
                  .reads = reads[i]};
      if (random_.below(3) == 0) {
        tasks[i].series = static_cast<SeriesId>(random_.below(series_.size()));
        series_[*tasks[i].series].emplace_back(id, Fate::kOpen);
      }
      if (random_.below(2) == 0) tasks[i].deadline = known.deadline = now_ + Nanos(pick(40));
      if (random_.below(4) == 0) {
        known.recall_at = now_ + Nanos(pick(40));
        tasks[i].recall = Recall{*known.recall_at, unit_bit(kCloud)};
      }
      tasks_[id] = known;
    }
    if (templates_) {
      const auto of = add_template(tasks);
      ASSERT_FALSE(dispatcher_.submit(firing, of + 1, tasks, now_, out_)) << "no such template";
      ASSERT_TRUE(dispatcher_.submit(firing, of, tasks, said_time(), out_));
    } else {
      ASSERT_TRUE(dispatcher_.submit(firing, tasks, said_time(), out_));
    }
    absorb();
  }

  /// Of such tasks, under other ids and without times.
  Dispatcher::TemplateId add_template(std::vector<NamedTask> tasks) {
    std::vector<std::vector<TaskId>> after(tasks.size());
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      for (const TaskId id : tasks[i].after) after[i].push_back(~id);
      tasks[i].id = ~tasks[i].id;
      tasks[i].after = after[i];
      tasks[i].deadline = tasks[i].expires_at = {};
      tasks[i].recall = {};
    }
    return dispatcher_.add_template(tasks);
  }

  void release() {
    if (firings_.empty()) return;
    release(*std::next(firings_.begin(), pick(firings_.size())));
  }

  void release(FiringId firing) {
    ASSERT_TRUE(dispatcher_.release(firing, said_time()));
    ASSERT_FALSE(dispatcher_.release(firing, said_time()));
    firings_.erase(firing);
    std::erase_if(ended_, [&](const auto& each) { return each.second == firing; });
  }

  /// A caller's clock may be a little behind.
  Nanos said_time() {
    const Nanos said = random_.below(4) == 0 ? now_ - Nanos(pick(5)) : now_;
    taken_as_ = std::max(taken_as_, said);
    return said;
  }

  void set_fate(TaskId id, Fate fate) {
    for (auto& series : series_) {
      for (auto& [member, its] : series) {
        if (member == id) its = fate;
      }
    }
  }

  /// The newest that completed of those that had joined, where all newer ones are lost.
  bool has_read(const Known& known) const {
    return std::ranges::all_of(known.reads, [this](const auto& read) {
      for (std::size_t i = read.second; i-- > 0;) {
        const Fate fate = series_[read.first][i].second;
        if (fate != Fate::kLost) return fate == Fate::kCompleted;
      }
      return false;
    });
  }

  /// Some series has nothing for it, or some task that it comes after ended for want of that.
  bool finds_nothing(const Known& known) const {
    const auto empty = [this](const auto& read) {
      const auto& series = series_[read.first];
      return std::all_of(series.begin(), series.begin() + static_cast<std::ptrdiff_t>(read.second),
                         [](const auto& each) { return each.second == Fate::kLost; });
    };
    return std::ranges::any_of(known.reads, empty) ||
           std::ranges::any_of(known.waits_for,
                               [this](TaskId each) { return found_nothing_.contains(each); });
  }

  /// Nobody who was submitted before it still may hold its state.
  bool has_state(TaskId id, const Known& known) const {
    return !known.state || std::ranges::none_of(tasks_, [&](const auto& each) {
      return each.first < id && each.second.state == known.state;
    });
  }

  void ended(TaskId id) {
    set_fate(id, Fate::kLost);
    if (firings_.contains(tasks_.at(id).firing)) ended_[id] = tasks_.at(id).firing;
    tasks_.erase(id);
  }

  std::optional<TaskId> any_that_runs() {
    std::vector<TaskId> candidates;
    for (const auto& [id, each] : tasks_) {
      if (each.runs_on) candidates.push_back(id);
    }
    if (candidates.empty()) return std::nullopt;
    return candidates[random_.below(candidates.size())];
  }

  void complete(Outcome outcome) {
    const auto any = any_that_runs();
    if (!any) return;
    const TaskId id = *any;
    const Known known = tasks_.at(id);
    if (outcome == Outcome::kReturned && !known.cancelled) return give_back(id);
    forget_suspended(id);
    if (!known.cancelled) ++(outcome == Outcome::kCompleted ? completed_ : failed_);
    if (!known.cancelled && outcome == Outcome::kCompleted) {
      for (auto& [other, each] : tasks_) each.waits_for.erase(id);
      set_fate(id, Fate::kCompleted);
      tasks_.erase(id);
    } else {
      ended(id);
    }
    ASSERT_TRUE(dispatcher_.complete(*known.runs_on, id, outcome, said_time(), out_));
    absorb();
    // Said once more, and of another unit: refused, and nothing has changed.
    ASSERT_FALSE(dispatcher_.complete(*known.runs_on, id, outcome, now_, out_));
    ASSERT_TRUE(out_.started.empty() && out_.ended.empty());
  }

  /// It goes on waiting, or fails.
  void give_back(TaskId id) {
    Known& known = tasks_.at(id);
    const UnitId unit = *std::exchange(known.runs_on, std::nullopt);
    forget_suspended(id);
    known.suspended = false;
    known.returned_by |= unit_bit(unit);
    if (!known.recalled) ++known.returns;
    known.recalled = false;
    ++returned_;
    ASSERT_TRUE(dispatcher_.complete(unit, id, Outcome::kReturned, said_time(), out_));
    const bool stays = std::ranges::none_of(out_.ended, [&](const Ended& each) {
      return each.task == id && each.how == TaskEnd::kFailed;
    });
    const UnitMask remaining = known.kind.eligible & ~known.returned_by & ~gone_;
    ASSERT_FALSE(stays && (remaining == 0 || known.returns == kMostTries));
    // Weights of all local units are above 0: some of them takes it.
    ASSERT_TRUE(stays || (remaining & kLocal) == 0 || known.returns == kMostTries);
    absorb();
    ASSERT_FALSE(dispatcher_.complete(unit, id, Outcome::kReturned, now_, out_));
  }

  void end_slice() {
    const auto any = any_that_runs();
    if (!any) return;
    const TaskId id = *any;
    const Known& known = tasks_.at(id);
    const UnitId unit = *known.runs_on;
    ASSERT_EQ(dispatcher_.slice_ended(unit, id, said_time(), out_), !known.suspended);
    ASSERT_LE(out_.suspended.size(), 1U);
    ASSERT_TRUE(out_.suspended.empty() || out_.suspended[0] == (Sliced{id, unit}));
    // Nothing is resumed that was not suspended; this one, if it is, has not ended a slice since.
    absorb();
  }

  void cancel() {
    if (tasks_.empty()) return;
    const auto at = std::next(tasks_.begin(), pick(tasks_.size()));
    dispatcher_.cancel(at->first, now_, out_);
    absorb();
  }

  void set_unit() {
    const auto unit = static_cast<UnitId>(random_.below(kRoles.size()));
    if (contains(gone_, unit)) return;
    const bool goes = random_.below(16) == 0;
    const UnitState otherwise = random_.below(2) == 0 ? UnitState::kUp : UnitState::kDraining;
    const UnitState state = goes ? UnitState::kGone : otherwise;
    gone_ = state == UnitState::kGone ? gone_ | unit_bit(unit) : gone_ & ~unit_bit(unit);
    down_ = state == UnitState::kUp ? down_ & ~unit_bit(unit) : down_ | unit_bit(unit);
    dispatcher_.set_unit(unit, state, now_, out_);
    absorb();
  }

  void pass_time() {
    now_ += Nanos(pick(20));
    if (random_.below(3) == 0) return;  // Whoever should wake it is late.
    while (dispatcher_.next_wake() <= now_) {
      taken_as_ = std::max(taken_as_, now_);
      dispatcher_.wake(now_, out_);
      absorb();
    }
  }

  /// Every start and every end has to be one that the model allows.
  void absorb() {
    for (const Sliced& each : out_.suspended) {
      Known& known = tasks_.at(each.task);
      ASSERT_TRUE(known.runs_on == each.unit && !known.suspended);
      known.suspended = true;
      suspended_[each.unit].push_back(each.task);
    }
    for (const Ended& ended : out_.ended) {
      ASSERT_TRUE(tasks_.contains(ended.task));
      Known& known = tasks_.at(ended.task);
      ++(ended.how == TaskEnd::kExpired  ? expired_
         : ended.how == TaskEnd::kFailed ? failed_
                                         : dropped_);
      if (ended.how == TaskEnd::kNoPredecessor) {
        ASSERT_TRUE(finds_nothing(known));
        found_nothing_.insert(ended.task);
        ++no_predecessor_;
      }
      if (ended.how == TaskEnd::kFailed && !known.runs_on && known.returns < kMostTries) {
        const UnitMask remaining = known.kind.eligible & ~known.returned_by & ~gone_;
        ASSERT_EQ(remaining & kLocal, 0U) << "failed though a unit may take it";
        ASSERT_TRUE(known.waits_for.empty()) << "failed before it could start";
      }
      if (ended.how == TaskEnd::kExpired) {
        ASSERT_FALSE(known.runs_on);
        ASSERT_TRUE(known.expires_at && *known.expires_at <= now_);
      }
      if (known.runs_on) {
        known.cancelled = true;
        set_fate(ended.task, Fate::kLost);
      } else {
        this->ended(ended.task);
      }
      if (keep_log_) log_ += std::to_string(ended.task) + "- ";
    }
    for (const Recalled& recalled : out_.recalled) {
      Known& known = tasks_.at(recalled.task);
      ASSERT_TRUE(known.runs_on == recalled.unit && recalled.unit == kCloud && !known.cancelled);
      ASSERT_TRUE(known.recall_at && *known.recall_at <= now_);
      ASSERT_NE(known.kind.eligible & kLocal, 0U) << "nobody else would take it";
      known.recalled = true;
    }
    for (const Start& start : out_.started) {
      ASSERT_TRUE(tasks_.contains(start.task));
      Known& known = tasks_.at(start.task);
      const UnitMask here = known.kind.eligible & kLocal & ~known.returned_by & ~gone_;
      ASSERT_TRUE(start.unit != kCloud || here == 0 || !known.recall_at ||
                  *known.recall_at >= taken_as_)
          << "there, when it should be back";
      ASSERT_FALSE(known.runs_on) << "started twice";
      ASSERT_TRUE(known.waits_for.empty()) << "started before a predecessor was complete";
      ASSERT_TRUE(has_read(known)) << "started before it was known what it reads";
      ASSERT_TRUE(has_state(start.task, known)) << "two hold a state, or out of turn";
      ASSERT_FALSE(contains(known.returned_by, start.unit)) << "back to who gave it back";
      ASSERT_TRUE(!known.expires_at || *known.expires_at >= taken_as_) << "started too late";
      ASSERT_TRUE(contains(known.kind.eligible & ~down_, start.unit));
      ASSERT_LE(start.dispatched_at, now_);
      if (start.let_in) {
        const TaskId innermost = suspended_[start.unit].back();
        const Known& outer = tasks_.at(innermost);
        ASSERT_TRUE(known.deadline && (!outer.deadline || *known.deadline < *outer.deadline))
            << "let in though it is not more urgent";
        for (const TaskId each : suspended_[start.unit]) {
          ASSERT_NE(tasks_.at(each).kind.workload, known.kind.workload) << "one kernel, two calls";
        }
      }
      known.runs_on = start.unit;
      if (keep_log_) log_ += std::to_string(start.task) + letter(start.unit) + ' ';
    }
    for (const Sliced& each : out_.resumed) {
      ASSERT_EQ(suspended_[each.unit].back(), each.task) << "not the innermost";
      suspended_[each.unit].pop_back();
      tasks_.at(each.task).suspended = false;
      if (keep_log_) log_ += std::to_string(each.task) + "+ ";
    }
    out_.clear();
  }

  /// It has ended, wherever it was.
  void forget_suspended(TaskId id) {
    for (auto& [unit, tasks] : suspended_) std::erase(tasks, id);
  }

  std::int64_t running() const {
    return std::ranges::count_if(tasks_,
                                 [](const auto& each) { return each.second.runs_on.has_value(); });
  }

  void check() {
    const TaskCounts& counts = dispatcher_.counts();
    const auto cancelled =
        std::ranges::count_if(tasks_, [](const auto& each) { return each.second.cancelled; });
    EXPECT_EQ(counts.submitted, static_cast<std::int64_t>(next_id_));
    EXPECT_EQ(counts.completed, completed_);
    EXPECT_EQ(counts.dropped, dropped_);
    EXPECT_EQ(counts.expired, expired_);
    EXPECT_EQ(counts.failed, failed_);
    EXPECT_EQ(counts.no_predecessor, no_predecessor_);
    EXPECT_EQ(counts.returned, returned_);
    EXPECT_EQ(counts.queued(), static_cast<std::int64_t>(tasks_.size()) - cancelled);
    std::map<UnitId, int> on_unit;
    for (const auto& [id, each] : tasks_) {
      ASSERT_TRUE(dispatcher_.state(id).has_value());
      if (each.runs_on && !each.suspended) ++on_unit[*each.runs_on];
      const bool is_ready = !each.runs_on && each.waits_for.empty() && has_read(each);
      const UnitMask remaining = each.kind.eligible & ~each.returned_by & ~gone_;
      EXPECT_TRUE(!is_ready || !has_state(id, each) || remaining != 0)
          << "waits for units that are gone";
    }
    for (UnitId unit = 0; unit < kRoles.size(); ++unit) {
      EXPECT_EQ(dispatcher_.running(unit), on_unit[unit]);
      EXPECT_EQ(dispatcher_.suspended(unit), static_cast<int>(suspended_[unit].size()));
      // What is suspended is resumed as soon as there is a slot.
      EXPECT_TRUE(suspended_[unit].empty() || dispatcher_.running(unit) == slots_[unit]);
      EXPECT_LE(dispatcher_.running(unit), slots_[unit]);
      // Nothing waits in the queue of a unit that could start it, or of one that is not up.
      const int queued =
          dispatcher_.load(unit) - dispatcher_.running(unit) - dispatcher_.suspended(unit);
      EXPECT_GE(queued, 0);
      const bool nothing_waits = contains(down_, unit) || dispatcher_.running(unit) < slots_[unit];
      EXPECT_TRUE(!nothing_waits || queued == 0);
    }
  }

  Random random_;
  bool keep_log_;
  bool templates_;  ///< Firings are submitted by them, and come after nothing outside.
  std::vector<int> slots_;
  NamedDispatcher dispatcher_;
  std::map<TaskId, Known> tasks_;
  std::map<TaskId, FiringId> ended_;  ///< Without completing, of firings that are not released.
  std::set<FiringId> firings_;        ///< Not released.
  UnitMask down_ = 0;
  UnitMask gone_ = 0;  ///< Of these.
  TaskId next_id_ = 0;
  FiringId next_firing_ = 0;
  std::int64_t completed_ = 0, dropped_ = 0, expired_ = 0, failed_ = 0;
  std::int64_t no_predecessor_ = 0, returned_ = 0;
  std::map<UnitId, std::vector<TaskId>> suspended_;  ///< Between two slices, the innermost last.
  std::vector<std::vector<std::pair<TaskId, Fate>>> series_{3};  ///< In order of submission.
  std::set<TaskId> found_nothing_;
  Effects out_;
  Nanos now_{0};
  Nanos taken_as_ = Nanos::min();  ///< By the dispatcher: never before what it was told last.
  std::string log_;
};

TEST(DispatcherProperties, HoldInRandomCallSequences) {
  for (std::uint64_t seed = 0; seed < kSequences; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Model model(seed, false);
    for (int i = 0; i < kSteps && !testing::Test::HasFailure(); ++i) model.step();
    if (testing::Test::HasFailure()) return;
    model.finish();
    // With every unit up that is not gone and all weights above 0, nothing may be left behind.
    ASSERT_EQ(model.dispatcher().counts().queued(), 0);
    ASSERT_FALSE(testing::Test::HasFailure());
  }
}

TEST(DispatcherProperties, SameInputsGiveTheSameAnswers) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Model first(seed, true);
    Model second(seed, true);
    for (int i = 0; i < kSteps; ++i) {
      first.step();
      second.step();
    }
    ASSERT_FALSE(first.log().empty());
    ASSERT_EQ(first.log(), second.log()) << "seed " << seed;
  }
}

}  // namespace
}  // namespace pirt::test
