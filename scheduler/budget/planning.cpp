#include "scheduler/budget/planning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "scheduler/bounds/bounds.h"
#include "scheduler/budget/assignment.h"
#include "scheduler/budget/guarantees.h"
#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/planner/mix_plan.h"
#include "scheduler/planner/shortened.h"
#include "scheduler/policies/policies.h"
#include "scheduler/record/keeping_up.h"
#include "scheduler/record/summary.h"
#include "scheduler/virtual/virtual_time.h"
#include "workloads/base/math/random.h"

namespace pirt {
namespace {

/// About so many tasks run, or up to so many times as many where a first deadline is late.
struct Extent {
  double tasks = 0;
  double most_times = 0;
};
constexpr Extent kTrial = {1000, 10};
constexpr Extent kJudged = {5000, 100};  ///< Of the run that a candidate is judged by.
// In all trials of a plan, and of one that is for another objective or for when a unit is away.
constexpr std::int64_t kMostTasks = 100'000;
constexpr std::int64_t kMostTasksBeside = 20'000;
/// Tasks of a mix that fires once, for trials: each end in them asks for all that wait.
constexpr std::size_t kMostOnce = 200;
constexpr double kAlike = 0.003;  ///< Figures that differ by less count as the same.
/// What may be given away of the objective for the figures behind it, all in all.
constexpr double kSlack = 0.005;
constexpr double kMargin = 1e-6;  ///< By which a least rate is kept.

bool joules_known(const ModeSetup& setup) {
  return without_joules(setup.scenario, setup.policy_setup.budget) == nullptr;
}

/// Tasks a second of pipelines with a rate.
double task_rate(const Mix& mix) {
  double rate = 0;
  for (const Pipeline& pipeline : mix.pipelines) {
    rate += pipeline.rate_hz.value_or(0) * static_cast<double>(pipeline.tasks.size());
  }
  return rate;
}

/// Tasks a millisecond of a mix of rates and closed loops at most; absent where no unit limits it.
std::optional<double> most_per_ms(const ModeSetup& setup) {
  const Scenario& run = setup.scenario;
  const Work work = work_of(run, setup.mode.policy.cloud_use, Taken::kMean);
  const auto most = most_tasks_per_ms(work);
  if (!most || !setup.in_flight_given) return most;  // Others are chosen.
  double in_flight = task_rate(run.mix) / 1e3;       // What the frames in flight let through, too.
  for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
    const PipelineWork& pipeline = work.pipelines[p];
    if (pipeline.per_ms) continue;
    in_flight +=
        run.in_flight[p] * static_cast<double>(pipeline.tasks.size()) / critical_path_ms(pipeline);
  }
  return std::min(*most, in_flight);
}

/// The joules are 0 where nobody knows some unit's.
struct TrialResult : TriedPlan {
  std::int64_t queued = 0;     ///< Of the late ones, those without a deadline.
  std::int64_t misses = 0;     ///< Of all deadlines; firings that were dropped, too.
  std::int64_t never_ran = 0;  ///< Pipelines; with those that had time and ended none.
  std::int64_t completed = 0;  ///< Tasks.
};

/// From a firing to its end.
double mean_latency_ms(const Tally& tally) {
  double sum_ms = 0;
  double firings = 0;
  for (const PipelineTally& each : tally.pipelines) {
    const auto completed = static_cast<double>(each.completed);
    sum_ms += to_ms(each.latency.mean().value_or(Nanos::zero())) * completed;
    firings += completed;
  }
  return firings > 0 ? sum_ms / firings : 0;
}

/// Runs so much of the mix in virtual time that about so many tasks complete, with a seed of its
/// own and the mix's jitter: what a choice would come to.
class Trial {
 public:
  /// @param setup   Of mode budget; must outlive it.
  /// @param slices  Calls are suspended where their workloads say so, if the setup has that.
  Trial(const ModeSetup& setup, const Extent& extent, bool slices = true)
      : setup_(setup), mix_(setup.scenario.mix), joules_known_(joules_known(setup)) {
    const Scenario& run = setup.scenario;
    std::optional<double> beside;  // With closed loops beside rates, while these go on.
    double loops = 0;              // Tasks that they have in all.
    if (mix_.open_loop() && std::ranges::max(run.in_flight) > 0) beside = most_per_ms(setup);
    for (Pipeline& pipeline : mix_.pipelines) {
      if (pipeline.rate_hz && pipeline.offset < run.duration) {
        pipeline.offset %= pipeline.period();  // Of the same phase, from the begin on.
      }
      if (!pipeline.frames) continue;
      const auto tasks = static_cast<double>(pipeline.tasks.size());
      loops += static_cast<double>(*pipeline.frames) * tasks;
      const auto most =
          static_cast<std::int64_t>((beside ? 2 * extent.most_times : 1) * extent.tasks / tasks);
      pipeline.frames =
          std::clamp<std::int64_t>(*pipeline.frames, 1, std::max<std::int64_t>(1, most));
    }
    scenario_.emplace(Scenario{.platform = run.platform,
                               .mix = mix_,
                               .services = run.services,
                               .classes = run.classes,
                               .in_flight = run.in_flight,
                               .duration = run.duration,
                               .seed = derive_seed(run.seed, "trial"),
                               .slices = run.slices});
    if (!slices) scenario_->keep_calls_whole();
    if (!mix_.open_loop()) return;
    const double rated = task_rate(mix_);
    const double rate = std::max(rated, beside.value_or(0) * 1e3);
    const auto lasts_s = [&](double tasks) {  // Loops that are over leave the time to the rates.
      return std::max(tasks / rate, loops < tasks ? (tasks - loops) / rated : 0);
    };
    end_after(lasts_s(extent.tasks), lasts_s(extent.most_times * extent.tasks));
  }

  /// @param plan  Followed in place of the choice, if it has entries.
  TrialResult run(const BudgetChoice& choice, const MixPlan& plan = {}) {
    PolicySetup policy = setup_.policy_setup;
    policy.plan = plan;
    policy.budget = choice.plan;
    for (std::size_t p = 0; p < mix_.pipelines.size(); ++p) {
      policy.budget.pipelines[p].offset = mix_.pipelines[p].offset;
    }
    policy.follows = choice.follows;
    scenario_->in_flight = choice.in_flight;
    Dispatcher dispatcher(setup_.slots, setup_.mode.policy.make(policy));
    const Tally tally = VirtualTime(*scenario_, dispatcher).run();
    const RunRecord record = summarize(*scenario_, nullptr, {}, tally);
    tasks_run_ += record.submitted;
    TrialResult result;
    result.rate_per_ms = record.throughput_per_ms.value_or(0);
    result.latency_ms = mean_latency_ms(tally);
    if (joules_known_ && record.energy_j && record.completed > 0) {
      result.energy_mj = *record.energy_j * 1e3 / static_cast<double>(record.completed);
    }
    result.completed = record.completed;
    result.misses = record.stalled;
    result.queued = real_time_queued(record);
    result.late = record.stalled + real_time_losses(record) + result.queued;
    for (std::size_t p = 0; p < record.pipelines.size(); ++p) {
      const PipelineResult& pipeline = record.pipelines[p];
      const auto& first = choice.plan.tasks[scenario_->classes[p].front().entry];
      const bool has_time = mix_.pipelines[p].offset + first.way() < scenario_->duration;
      const bool waits = has_time && pipeline.completed == 0 && pipeline.queued.value_or(0) > 0;
      result.never_ran += waits || pipeline.never_ran.value_or(false) ? 1 : 0;
      result.misses += shortfall_of(pipeline).dropped + pipeline.deadline_misses.value_or(0);
    }
    return result;
  }

  /// Tasks that all runs so far have submitted: what they have taken.
  [[nodiscard]] std::int64_t tasks_run() const { return tasks_run_; }

 private:
  /// So long at least, and until all with a deadline have fired and have had to end once, or for
  /// the most; what fires later does so in the first half, if it has to end in as much again, so
  /// that it is seen what comes of it.
  void end_after(double least_s, double most_s) {
    const Nanos whole = scenario_->duration;
    double seen_s = 0;
    for (const Pipeline& pipeline : mix_.pipelines) {
      if (!pipeline.rate_hz || !pipeline.deadline || pipeline.offset >= whole) continue;
      const double ends_s = to_s(*pipeline.deadline + pipeline.jitter) + 1e-6;
      seen_s = std::max(seen_s, to_s(pipeline.offset) + std::max(1 / *pipeline.rate_hz, ends_s));
    }
    const double horizon_s = std::min(std::clamp(seen_s, least_s, most_s), 60.0);
    scenario_->duration = std::min(whole, from_s(horizon_s));
    const Nanos half = scenario_->duration / 2;
    for (Pipeline& pipeline : mix_.pipelines) {
      if (!pipeline.rate_hz || pipeline.offset >= whole) continue;
      const Nanos needs =
          pipeline.deadline ? *pipeline.deadline + pipeline.jitter + Nanos(1) : Nanos::zero();
      if (needs > half || pipeline.offset + needs < scenario_->duration) continue;
      pipeline.offset %= half;
    }
  }

  const ModeSetup& setup_;
  Mix mix_;
  std::optional<Scenario> scenario_;
  bool joules_known_;
  std::int64_t tasks_run_ = 0;
};

/// What is known of some units only cannot be compared: nothing may look free.
void forget_joules(Work& work) {
  for (PipelineWork& pipeline : work.pipelines) {
    for (TaskWork& task : pipeline.tasks) {
      for (UnitWork& unit : task.units) unit.energy_j.reset();
    }
  }
}

/// What counts, most important first; less is better.
constexpr std::size_t kKeys = 8;
using Keys = std::array<double, kKeys>;
constexpr std::size_t kAim = 5;  ///< The objective's own figure, behind what has to be kept.

Keys keys(const TrialResult& of, const Goals& goals) {
  const double missing =
      std::max(0.0, 1 - of.rate_per_ms / goals.min_rate_per_ms.value_or(of.rate_per_ms));
  const auto late = static_cast<double>(of.late - of.queued);
  const auto queued = static_cast<double>(of.queued);
  const auto misses = static_cast<double>(of.misses);
  const auto never = static_cast<double>(of.never_ran);
  const double slowness = of.rate_per_ms > 0 ? 1 / of.rate_per_ms : 1e300;
  switch (goals.objective) {
    case Objective::kEnergy:
      return {late, queued, misses, never, missing, of.energy_mj, slowness, of.latency_ms};
    case Objective::kLatency:
      return {late, queued, misses, never, missing, of.latency_ms, slowness, of.energy_mj};
    case Objective::kRate:
      break;
  }
  return {late, queued, misses, never, missing, slowness, of.energy_mj, of.latency_ms};
}

/// @param counted  So many of them.
bool is_better(const Keys& a, const Keys& b, std::size_t counted = kKeys) {
  for (std::size_t i = 0; i < counted; ++i) {
    const double alike = i < kAim ? 0 : kAlike * std::abs(b[i]);
    if (a[i] < b[i] - alike) return true;
    if (a[i] > b[i] + alike) return false;
  }
  return false;
}

/// Nobody can be frugal with joules that nobody knows.
Goals goals_of(const ModeSetup& setup, const ScheduleOptions& options, Objective objective) {
  const bool blind = objective == Objective::kEnergy && !joules_known(setup);
  return {.objective = blind ? Objective::kRate : objective,
          .min_rate_per_ms = options.min_rate_per_ms,
          .most_w = setup.policy_setup.budget.window_j};
}

class Planning {
 public:
  Planning(const ModeSetup& setup, const ScheduleOptions& options, Objective objective,
           std::int64_t most_tasks)
      : setup_(setup),
        most_tasks_(most_tasks),
        goals_(goals_of(setup, options, objective)),
        trial_(setup, kTrial),
        choice_{setup.policy_setup.budget, setup.scenario.in_flight} {}

  BudgetChoice run() {
    begin();
    best_ = trial_.run(choice_);
    if (best_.misses == 0) least_ = keys(best_, goals_)[kAim];
    if (best_.misses > 0) move_units();
    fit_queues();
    if (goals_.min_rate_per_ms) spare();
    BudgetPlan several = choice_.plan;
    // One call at a time may be late, or too slow, where several are not.
    if (protect(setup_.scenario, choice_.plan) && falls_behind(trial_.run(choice_))) {
      choice_.plan = std::move(several);
      protect(setup_.scenario, choice_.plan, false);
    }
    return std::move(choice_);
  }

 private:
  void begin() {
    const Scenario& run = setup_.scenario;
    for (BudgetPlan::Task& task : choice_.plan.tasks) task.tolerates.reset();
    Work work = work_of(run, setup_.mode.policy.cloud_use, Taken::kMean);
    if (!joules_known(setup_)) forget_joules(work);
    assign(work, goals_, choice_.plan);
    measure_ways(run, choice_.plan);
    choose_in_flight();
  }

  [[nodiscard]] bool own_in_flight(std::size_t pipeline) const {
    return setup_.scenario.mix.pipelines[pipeline].frames && !setup_.in_flight_given;
  }

  /// As many as have room on the units, and find an image buffer.
  void choose_in_flight() {
    const Mix& mix = setup_.scenario.mix;
    // For more than one frame of each loop.
    std::int64_t buffers = mix.image_buffers.value_or(std::int64_t{1} << 60U);
    std::int64_t loops = 0;  // That share them.
    for (const Pipeline& each : mix.pipelines) {
      buffers -= image_buffers_of(each);
      loops += each.frames && each.has_image_input() ? 1 : 0;
    }
    for (std::size_t p = 0; p < choice_.in_flight.size(); ++p) {
      if (!own_in_flight(p)) continue;
      std::int64_t room = 0;
      for (const BudgetPlan::Task& task : choice_.plan.tasks) {
        if (task.pipeline != p) continue;
        std::int64_t own = 0;
        for (const UnitId unit : task.units) own += task.capacity[unit];
        room = std::max(room, own);
      }
      const bool has_images = mix.pipelines[p].has_image_input();
      if (has_images) room = std::min(room, 1 + buffers / loops--);
      choice_.in_flight[p] = static_cast<int>(std::clamp<std::int64_t>(room, 1, 1000));
      if (has_images) buffers -= choice_.in_flight[p] - 1;
    }
  }

  /// By more than one call of each task, which may be under way when a trial ends.
  [[nodiscard]] bool falls_behind(const TrialResult& result) const {
    const auto tasks = static_cast<std::int64_t>(choice_.plan.tasks.size());
    return result.misses > best_.misses || result.late > best_.late ||
           result.completed + tasks < best_.completed;
  }

  [[nodiscard]] bool may_try() const { return trial_.tasks_run() < most_tasks_; }

  [[nodiscard]] bool better(const TrialResult& a, const TrialResult& b) const {
    const auto first = keys(a, goals_);
    const auto second = keys(b, goals_);
    // Small losses do not add up.
    if (first[kAim] > least_ * (1 + kSlack) && first[kAim - 1] >= second[kAim - 1] &&
        std::equal(first.begin(), first.begin() + kAim - 1, second.begin())) {
      return false;
    }
    return is_better(first, second);
  }

  /// Takes the choice if it is better than what there is.
  bool consider(BudgetChoice choice) {
    const TrialResult result = trial_.run(choice);
    if (!better(result, best_)) return false;
    best_ = result;
    if (best_.misses == 0) least_ = std::min(least_, keys(best_, goals_)[kAim]);
    choice_ = std::move(choice);
    return true;
  }

  /// Tasks with a deadline that is missed: another unit for each, as long as that helps.
  void move_units() {
    for (bool moved = true; moved && best_.misses > 0;) {
      moved = false;
      for (std::size_t entry = 0; entry < choice_.plan.tasks.size(); ++entry) {
        const std::size_t units = choice_.plan.tasks[entry].units.size();
        if (!choice_.plan.tasks[entry].pinned) continue;
        for (std::size_t i = 1; i < units && best_.misses > 0 && may_try(); ++i) {
          BudgetChoice other = choice_;
          auto& order = other.plan.tasks[entry].units;
          std::rotate(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(i),
                      order.begin() + static_cast<std::ptrdiff_t>(i) + 1);
          measure_ways(setup_.scenario, other.plan);
          moved = consider(std::move(other)) || moved;
        }
        if (best_.misses == 0 || !may_try()) continue;
        BudgetChoice spread = choice_;  // Over all units that may serve it.
        spread.plan.tasks[entry].pinned = false;
        moved = consider(std::move(spread)) || moved;
      }
    }
  }

  /// Longer and shorter queues, more and fewer frames in flight, while that is better.
  void fit_queues() {
    for (bool changed = true; changed && may_try();) {
      changed = false;
      for (std::size_t entry = 0; entry < choice_.plan.tasks.size(); ++entry) {
        if (!queues_matter(entry)) continue;
        for (const UnitId unit : std::vector(choice_.plan.tasks[entry].units)) {
          for (const int by : {1, -1}) changed = change_capacity(entry, unit, by) || changed;
        }
      }
      for (std::size_t p = 0; p < choice_.in_flight.size(); ++p) {
        if (!own_in_flight(p)) continue;
        for (const int by : {1, -1}) changed = change_in_flight(p, by) || changed;
      }
    }
  }

  /// Where nothing has to go first, a queue may be longer than what is served.
  [[nodiscard]] bool queues_matter(std::size_t entry) const {
    const BudgetPlan& plan = choice_.plan;
    return plan.pipelines[plan.tasks[entry].pipeline].real_time &&
           std::ranges::none_of(plan.pipelines,
                                [](const auto& each) { return each.deadline.has_value(); });
  }

  bool change_capacity(std::size_t entry, UnitId unit, int by) {
    return repeat([&](BudgetChoice& other) {
      BudgetPlan::Task& task = other.plan.tasks[entry];
      task.capacity[unit] += by;
      if (own_in_flight(task.pipeline)) {
        other.in_flight[task.pipeline] = std::max(1, other.in_flight[task.pipeline] + by);
      }
      const bool any = std::ranges::any_of(task.capacity, [](int each) { return each > 0; });
      return any && task.capacity[unit] >= 0 && task.capacity[unit] <= 1000;
    });
  }

  bool change_in_flight(std::size_t pipeline, int by) {
    return repeat([&](BudgetChoice& other) { return (other.in_flight[pipeline] += by) >= 1; });
  }

  /// As long as that is better. @param change  bool(BudgetChoice&): false if it cannot be.
  /// @return  Whether it was at all.
  template <typename Change>
  bool repeat(const Change& change) {
    bool changed = false;
    while (may_try()) {
      BudgetChoice other = choice_;
      if (!change(other) || !consider(std::move(other))) break;
      changed = true;
    }
    return changed;
  }

  /// More than the rate that is wanted: the dearest units get less of it, by halving.
  void spare() {
    if (goals_.objective != Objective::kEnergy) return;
    for (std::size_t entry = 0; entry < choice_.plan.tasks.size(); ++entry) {
      if (choice_.plan.tasks[entry].pinned) continue;
      std::vector<UnitId> units = choice_.plan.tasks[entry].units;  // The dearest first.
      const auto& window_j = choice_.plan.tasks[entry].window_j;
      std::ranges::stable_sort(units, std::greater{}, [&](UnitId unit) { return window_j[unit]; });
      for (const UnitId unit : units) {
        if (choice_.plan.tasks[entry].capacity[unit] > 0) spare_unit(entry, unit);
      }
    }
  }

  void spare_unit(std::size_t entry, UnitId unit) {
    constexpr int kHalvings = 10;
    double enough = 1;
    double too_little = 0;
    for (int i = 0; i < kHalvings && may_try(); ++i) {
      BudgetChoice other = choice_;
      const double share = (enough + too_little) / 2;
      other.plan.tasks[entry].share[unit] = share;
      const TrialResult result = trial_.run(other);
      const bool keeps = result.misses <= best_.misses &&
                         result.rate_per_ms >= *goals_.min_rate_per_ms * (1 + kMargin) &&
                         result.energy_mj <= best_.energy_mj;
      (keeps ? enough : too_little) = share;
      if (!keeps) continue;
      best_ = result;
      choice_ = std::move(other);
    }
  }

  const ModeSetup& setup_;
  std::int64_t most_tasks_;
  Goals goals_;
  Trial trial_;
  BudgetChoice choice_;
  TrialResult best_;
  double least_ = 1e300;  ///< Of the objective's figure, the least that was taken.
};

/// Of @p plan, what holds while the unit is away: it comes last, where another may serve.
void put_last(BudgetPlan& plan, UnitId away) {
  for (BudgetPlan::Task& task : plan.tasks) {
    const auto found = std::ranges::find(task.units, away);
    if (found == task.units.end() || task.units.size() == 1) continue;
    std::rotate(found, found + 1, task.units.end());
    task.capacity[away] = 0;
  }
}

Objective objective_of(const ScheduleOptions& options) {
  return options.objective.value_or(Objective::kRate);
}

/// What the mode may follow, and what it comes to.
struct Candidate {
  BudgetChoice choice;
  TrialResult result;
};

bool serves_all(const Scenario& scenario, const Policy& policy) {
  return std::ranges::all_of(scenario.classes, [&policy](const auto& pipeline) {
    return std::ranges::all_of(pipeline, [&policy](const TaskClass& kind) {
      return policy.takers(kind, kind.eligible) != 0;
    });
  });
}

/// The plan of each objective, that of the options first, and modes that plan nothing; those know
/// no cap and suspend no call between slices.
std::vector<Candidate> candidates_of(const ModeSetup& setup, const ScheduleOptions& options) {
  std::vector<Candidate> candidates;
  Trial trial(setup, kJudged);
  const auto add_plan = [&](Objective objective, std::int64_t most_tasks) {
    BudgetChoice choice = Planning(setup, options, objective, most_tasks).run();
    const auto same = std::ranges::find(candidates, choice, &Candidate::choice);
    if (same != candidates.end()) return;
    TrialResult result = trial.run(choice);
    result.name = "plan for " + std::string(to_string(objective));
    candidates.push_back({std::move(choice), std::move(result)});
  };
  add_plan(objective_of(options), kMostTasks);
  for (const auto objective : {Objective::kRate, Objective::kEnergy, Objective::kLatency}) {
    if (objective != objective_of(options)) add_plan(objective, kMostTasksBeside);
  }
  if (options.power_cap_w) return candidates;
  Trial unsliced(setup, kJudged, false);
  for (const PolicyInfo* basic : {&policy::edf, &policy::ect}) {
    if (!serves_all(setup.scenario, *basic->make(setup.policy_setup))) continue;
    BudgetChoice choice{candidates.front().choice.plan, setup.scenario.in_flight, basic};
    TrialResult result = unsliced.run(choice);
    result.name = basic->name;
    candidates.push_back({std::move(choice), std::move(result)});
  }
  return candidates;
}

/// What the mode follows, and what that comes to.
std::pair<PlannedBudget, TrialResult> take_best(const ModeSetup& setup,
                                                const ScheduleOptions& options) {
  const Goals goals = goals_of(setup, options, objective_of(options));
  auto candidates = candidates_of(setup, options);
  Candidate* best = &candidates.front();
  for (Candidate& each : candidates) {
    // What plans nothing guarantees nothing: the last of the figures is no reason to follow it.
    const std::size_t counted = each.choice.follows == nullptr ? kKeys : kKeys - 1;
    if (is_better(keys(each.result, goals), keys(best->result, goals), counted)) best = &each;
  }
  best->result.taken = true;
  PlannedBudget planned{.choice = std::move(best->choice)};
  for (const Candidate& each : candidates) planned.tried.push_back(each.result);
  return {std::move(planned), best->result};
}

}  // namespace

void plan_for_losses(ModeSetup& setup, const ScheduleOptions& options) {
  if (setup.scenario.mix.fires_once() || setup.policy_setup.follows != nullptr) return;
  const BudgetPlan& whole = setup.policy_setup.budget;
  std::vector<BudgetPlan> without(setup.scenario.platform.units.size());
  for (UnitId away = 0; away < without.size(); ++away) {
    const bool serves = std::ranges::any_of(whole.tasks, [away](const BudgetPlan::Task& task) {
      return task.units.size() > 1 && std::ranges::find(task.units, away) != task.units.end();
    });
    if (!serves) continue;
    ModeSetup other{.mode = setup.mode,
                    .scenario = setup.scenario,
                    .slots = setup.slots,
                    .policy_setup = setup.policy_setup,
                    .policy = nullptr,
                    .weights_from = {},
                    .in_flight_given = true};
    for (auto& pipeline : other.scenario.classes) {
      for (TaskClass& kind : pipeline) {
        const UnitMask others = kind.eligible & ~unit_bit(away);
        if (others != 0) kind.eligible = others;
      }
    }
    put_last(other.policy_setup.budget, away);
    without[away] = Planning(other, options, objective_of(options), kMostTasksBeside).run().plan;
  }
  setup.policy_setup.budget_without = std::move(without);
  setup.policy = setup.mode.policy.make(setup.policy_setup);
}

PlannedBudget plan_budget(const ModeSetup& setup, const ScheduleOptions& options) {
  return take_best(setup, options).first;
}

void follow(const PlannedBudget& planned, ModeSetup& setup) {
  setup.scenario.in_flight = planned.choice.in_flight;
  setup.policy_setup.budget = planned.choice.plan;
  setup.policy_setup.follows = planned.choice.follows;
  setup.policy_setup.plan = planned.plan;
  if (planned.choice.follows != nullptr) setup.scenario.keep_calls_whole();
  setup.policy = setup.mode.policy.make(setup.policy_setup);
}

PlannedBudget plan_once(const ModeSetup& setup, const ScheduleOptions& options) {
  const BudgetPlan& budget = setup.policy_setup.budget;
  PlannedBudget once{.choice = {budget, setup.scenario.in_flight},
                     .plan = plan_mix(setup.scenario, shortened_plan)};
  const auto is_urgent = [](const auto& pipeline) { return pipeline.deadline.has_value(); };
  if (budget.tasks.size() > kMostOnce || std::ranges::none_of(budget.pipelines, is_urgent)) {
    return once;
  }
  const TrialResult result = Trial(setup, kJudged).run(once.choice, once.plan);
  if (result.misses == 0) return once;
  const auto [planned, taken] = take_best(setup, options);
  const bool fewer = std::pair(taken.late, taken.misses) < std::pair(result.late, result.misses);
  return fewer ? planned : once;
}

}  // namespace pirt
