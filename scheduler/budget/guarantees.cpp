#include "scheduler/budget/guarantees.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <set>

#include "scheduler/services/recall.h"

namespace pirt {
namespace {

constexpr Nanos kNoLimit = Nanos::max();

/// How many multiples of the period lie in a time, both ends included.
std::int64_t count_in(Nanos time, Nanos period) {
  return time < Nanos::zero() ? 0 : time / period + 1;
}

/// Rounded down, so that no firing is forgotten.
Nanos period_of(double rate_hz) { return Nanos(static_cast<std::int64_t>(1e9 / rate_hz)); }

/// A task of a pipeline with a rate and a deadline, on the unit that serves it.
struct Analysed {
  std::uint32_t entry = 0;
  std::size_t pipeline = 0;
  UnitId unit = 0;
  Nanos period{0};
  Nanos takes{0};
  Nanos slice{0};      ///< Of these, until it can be suspended at most.
  Nanos deadline{0};   ///< From its firing.
  Nanos slack{0};      ///< From its firing to when it has to start.
  Nanos tolerates{0};  ///< At most so long others hold its unit when it is ready.
  Nanos late{0};       ///< From the nominal time to its firing, at most.
  Nanos ready{0};      ///< From its firing to when it can start, at most.
  Nanos response{0};   ///< From its firing to its end, at most.
};

class Analysis {
 public:
  /// @param given  The plan with the capacities that it has if nothing is guaranteed.
  Analysis(const Scenario& scenario, const BudgetPlan& plan, const BudgetPlan& given)
      : scenario_(scenario),
        plan_(plan),
        given_(given),
        before_(plan.tasks.size()),
        units_(plan.pipelines.size(), 0),
        obstacles_(plan.pipelines.size()),
        others_(scenario.platform.units.size(), Nanos::zero()) {
    for (std::size_t p = 0; p < scenario.classes.size(); ++p) {
      const auto& classes = scenario.classes[p];
      for (std::size_t t = 0; t < classes.size(); ++t) {
        add(p, classes[t].entry);
        if (!plan_.pipelines[p].is_periodic()) continue;  // Of others nobody asks.
        auto& before = before_[classes[t].entry];
        for (const std::size_t each : scenario.mix.pipelines[p].waits_for(t)) {
          const std::uint32_t entry = classes[each].entry;
          before.insert(entry);
          before.insert(before_[entry].begin(), before_[entry].end());
        }
      }
    }
    for (std::size_t p = 0; p < obstacles_.size(); ++p) {
      const Pipeline& its = scenario.mix.pipelines[p];
      if (its.deadline) obstacles_[p] = its.rate_hz ? obstacle(p) : "closed loop";
    }
    do {
      spread_obstacles();
    } while (find_wanted_back());
  }

  std::vector<Guarantee> run() {
    std::vector<Guarantee> results(scenario_.mix.pipelines.size());
    std::vector<bool> done(results.size(), false);
    for (std::size_t p = 0; p < results.size(); ++p) {
      if (!plan_.pipelines[p].is_periodic()) continue;
      results[p].not_analysed = obstacles_[p];
      results[p].analysed = obstacles_[p].empty();
      if (!results[p].analysed || done[p]) continue;
      tasks_ = together_with(p);
      const auto responses = settled_responses();
      for (const Analysed& each : tasks_) {
        done[each.pipeline] = true;
        if (responses) results[each.pipeline].response = (*responses)[each.pipeline];
      }
    }
    return results;
  }

  /// Sets how long others may hold the units of @p plan's tasks, where those units then serve one
  /// call at a time. @return  Whether one of them served several.
  bool protect(BudgetPlan& plan) {
    bool served_several = false;
    std::vector<bool> done(plan.tasks.size(), false);
    for (const Analysed& first : all_) {
      if (done[first.entry]) continue;
      tasks_ = together_with(first.pipeline);
      for (const Analysed& each : tasks_) done[each.entry] = true;
      if (!share_slack()) continue;
      // Of those that keep no deadline, too: others count on how late they are.
      for (const Analysed& each : tasks_) {
        for (BudgetPlan::Task& task : plan.tasks) {
          int& capacity = task.capacity[each.unit];
          served_several = served_several || capacity > 1;
          capacity = std::min(capacity, 1);
        }
        if (each.tolerates == kNoLimit) continue;
        plan.tasks[each.entry].ready = each.ready;
        plan.tasks[each.entry].tolerates = each.tolerates;
      }
    }
    return served_several;
  }

 private:
  /// As much time is left to others as no guarantee is lost by: any; or any of what guaranteed
  /// tasks have, and of what the rest has until its next firing all, half and so on; or such a part
  /// of what guaranteed tasks have alone; and what each may wait for a rival anyway. False where
  /// nothing is guaranteed.
  bool share_slack() {
    constexpr std::array kParts = {1.0, 0.5, 0.25, 0.125, 0.0};
    std::vector<Nanos> responses;  // If others held no unit.
    const auto settles_with = [&](const auto& guaranteed, const auto& rest) {
      for (Analysed& each : tasks_) {
        each.tolerates = Nanos::zero();
        const Nanos anyway = blocking_of(each);  // By rivals, which costs nothing more.
        each.tolerates = std::max(anyway, keeps_[each.pipeline] ? guaranteed(each) : rest(each));
        each.ready = each.response = Nanos::zero();
      }
      const auto settled = settled_responses();
      const bool keeps =
          settled && std::ranges::none_of(tasks_, [&](const Analysed& each) {
            return keeps_[each.pipeline] && (*settled)[each.pipeline] > each.deadline;
          });
      if (settled && responses.empty()) responses = *settled;
      return keeps;
    };
    const auto no_limit = [](const Analysed&) { return kNoLimit; };
    const auto none = [](const Analysed&) { return Nanos::zero(); };
    keeps_.assign(scenario_.mix.pipelines.size(), false);
    settles_with(none, none);
    if (responses.empty()) return false;
    for (const Analysed& each : tasks_) {
      keeps_[each.pipeline] = responses[each.pipeline] <= each.deadline;
    }
    const auto keeps = [this](const Analysed& each) -> bool { return keeps_[each.pipeline]; };
    if (std::ranges::none_of(tasks_, keeps)) return false;
    if (settles_with(no_limit, no_limit)) return true;
    const auto part_of = [&](const Analysed& each, Nanos time, double part) {
      const auto tasks = static_cast<double>(scenario_.classes[each.pipeline].size());
      return scaled(time - responses[each.pipeline], part / tasks);
    };
    const auto settles_with_rest = [&](double part) {
      return settles_with(no_limit, [&](const Analysed& each) {
        return part_of(each, each.period - each.late, part);
      });
    };
    if (!std::ranges::all_of(tasks_, keeps) && std::ranges::any_of(kParts, settles_with_rest)) {
      return true;
    }
    return std::ranges::any_of(kParts, [&](double part) {
      return settles_with([&](const Analysed& each) { return part_of(each, each.deadline, part); },
                          none);
    });
  }

  /// The tasks of the pipeline, of those that share a unit with it, and so on.
  [[nodiscard]] std::vector<Analysed> together_with(std::size_t pipeline) const {
    UnitMask units = units_[pipeline];
    for (UnitMask known = 0; known != units;) {
      known = units;
      for (const UnitMask its : units_) {
        if ((its & units) != 0) units |= its;
      }
    }
    std::vector<Analysed> tasks;
    std::ranges::copy_if(all_, std::back_inserter(tasks),
                         [&](const Analysed& task) { return contains(units, task.unit); });
    return tasks;
  }

  /// By pipeline. Absent if some response has no limit, or a firing may not have ended when the
  /// next one comes: that no task waits for one that comes before or after it in its firing would
  /// not hold then.
  std::optional<std::vector<Nanos>> settled_responses() {
    if (!settle()) return std::nullopt;
    std::vector<Nanos> responses(scenario_.mix.pipelines.size(), Nanos::zero());
    for (const Analysed& task : tasks_) {
      auto& response = responses[task.pipeline];
      response = std::max(response, task.response);
      if (response + task.late > task.period) return std::nullopt;
    }
    return responses;
  }

  /// What is not analysed may be in the way of others at any time: nothing can be said of those on
  /// its units either.
  void spread_obstacles() {
    const auto& pipelines = scenario_.mix.pipelines;
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t p = 0; p < pipelines.size(); ++p) {
        for (std::size_t q = 0; q < pipelines.size() && obstacles_[p].empty(); ++q) {
          if (obstacles_[q].empty() || (units_[p] & units_[q]) == 0) continue;
          obstacles_[p] = "on a unit of " + pipelines[q].name + ", which is not";
          changed = true;
        }
      }
    }
    std::erase_if(all_, [&](const Analysed& each) { return !obstacles_[each.pipeline].empty(); });
  }

  /// What may be wanted back from a cloud may come to units of the robot at any time.
  /// @return  Whether that is known of one more pipeline.
  bool find_wanted_back() {
    bool changed = false;
    for (std::size_t p = 0; p < obstacles_.size(); ++p) {
      const UnitMask on = wanted_back_on(p);
      if (on == 0 || (!obstacles_[p].empty() && (on & ~units_[p]) == 0)) continue;
      changed = true;
      units_[p] |= on;
      if (obstacles_[p].empty()) obstacles_[p] = "may be wanted back from the cloud";
    }
    return changed;
  }

  /// The units of the robot that get what the pipeline may want back from a cloud.
  [[nodiscard]] UnitMask wanted_back_on(std::size_t pipeline) {
    const Pipeline& its = scenario_.mix.pipelines[pipeline];
    const UnitMask cloud = cloud_units(scenario_.platform);
    if (!its.deadline || its.real_time || (units_[pipeline] & cloud) == 0) return 0;
    tasks_ = together_with(pipeline);
    const bool settled = obstacles_[pipeline].empty() && settled_responses();
    const auto leads = recall_leads(scenario_, pipeline);
    UnitMask on = 0;
    for (std::size_t t = 0; t < leads.size(); ++t) {
      const TaskClass& kind = scenario_.classes[pipeline][t];
      if (!leads[t] || (units_of(kind.entry) & cloud) == 0) continue;
      const BudgetPlan::Task& task = plan_.tasks[kind.entry];
      const Nanos wanted = *its.deadline - leads[t]->before_deadline;
      const auto is_back = [&](const Analysed& each) {
        return each.entry == kind.entry && each.response < wanted;
      };
      if (settled ? std::ranges::any_of(tasks_, is_back)
                  : never_waits(pipeline) && task.takes(task.units.front()) < wanted) {
        continue;
      }
      const auto here = [cloud](UnitId unit) { return !contains(cloud, unit); };
      on |= unit_bit(*std::ranges::find_if(task.units, here));
    }
    return on;
  }

  /// Whether the unit of the pipeline's one task serves any number of its calls at a time, and no
  /// others that have a deadline.
  [[nodiscard]] bool never_waits(std::size_t pipeline) const {
    const TaskClass& kind = scenario_.classes[pipeline].front();
    const BudgetPlan::Task& task = plan_.tasks[kind.entry];
    const UnitId unit = task.units.front();
    const UnitModel& model = scenario_.platform.units[unit];
    const auto is_served = [](const ServiceStage& stage) { return stage.on.has_value(); };
    return scenario_.classes[pipeline].size() == 1 && task.pinned && !task.state &&
           given_.tasks[kind.entry].capacity[unit] > 1 && !model.slots && !model.measured() &&
           model.link.empty() &&
           std::ranges::none_of(scenario_.services.find(kind.workload, unit)->stages, is_served) &&
           std::ranges::count_if(units_, [unit](UnitMask its) { return contains(its, unit); }) == 1;
  }

  /// Those that the plan may give the task to.
  [[nodiscard]] UnitMask units_of(std::uint32_t entry) const {
    const BudgetPlan::Task& task = plan_.tasks[entry];
    UnitMask mask = unit_bit(task.units.front());
    for (const UnitId unit : task.units) mask |= task.pinned ? UnitMask{0} : unit_bit(unit);
    return mask;
  }

  /// Whether both entries may be ready at a time.
  [[nodiscard]] bool concurrent(std::uint32_t a, std::uint32_t b) const {
    return a != b && !before_[a].contains(b) && !before_[b].contains(a);
  }
  /// Whether both may want their unit at a time.
  [[nodiscard]] bool compete(const Analysed& a, const Analysed& b) const {
    return a.unit == b.unit && concurrent(a.entry, b.entry);
  }

  void add(std::size_t pipeline, std::uint32_t entry) {
    const BudgetPlan::Task& task = plan_.tasks[entry];
    if (plan_.pipelines[pipeline].deadline) units_[pipeline] |= units_of(entry);
    if (!plan_.pipelines[pipeline].is_periodic()) {
      for (const UnitId each : task.units) {
        if (task.capacity[each] == 0) continue;
        others_[each] = std::max(others_[each], task.holds(each));
        if (task.can_be_suspended(each)) sliced_ |= unit_bit(each);
      }
      return;
    }
    const UnitId unit = task.units.front();
    const auto& arrivals = plan_.pipelines[pipeline];
    all_.push_back({.entry = entry,
                    .pipeline = pipeline,
                    .unit = unit,
                    .period = period_of(*arrivals.rate_hz),
                    .takes = task.takes(unit),
                    .slice = task.holds(unit),
                    .deadline = *arrivals.deadline,
                    .slack = *arrivals.deadline - task.way(),
                    .tolerates = task.tolerates.value_or(kNoLimit),
                    .late = arrivals.jitter});
  }

  /// Why nothing can be said of the pipeline; empty if something can.
  [[nodiscard]] std::string obstacle(std::size_t pipeline) const {
    const Pipeline& its = scenario_.mix.pipelines[pipeline];
    if (its.has_image_input() && may_find_no_buffer()) return "may find no image buffer";
    if (its.expires && *its.expires < *its.deadline) return "its tasks may expire";
    const auto& tasks = its.tasks;
    for (std::size_t t = 0; t < tasks.size(); ++t) {
      const BudgetPlan::Task& planned = plan_.tasks[scenario_.classes[pipeline][t].entry];
      if (!planned.pinned) return "served by several units";
      const UnitId unit = planned.units.front();
      const TaskClass& kind = scenario_.classes[pipeline][t];
      const Service* service = scenario_.services.find(kind.workload, unit);
      if (service != nullptr && !service->doubts.empty()) {
        return "rests on an uncertain figure: " + scenario_.services.workloads[kind.workload] +
               " on " + scenario_.platform.units[unit].name;
      }
      const UnitModel& model = scenario_.platform.units[unit];
      if (service != nullptr && service->slices.size() > 1 && meets_own_workload(kind, unit)) {
        const std::string& workload = scenario_.services.workloads[kind.workload];
        return fmt::format("calls of {} on {} let none of {} in", workload, model.name, workload);
      }
      if (shares_servers(unit)) return "served on another's cores: " + model.name;
      if (model.servers != 1) return "several servers: " + model.name;
      const auto several = [unit](const BudgetPlan::Task& each) { return each.capacity[unit] > 1; };
      if (std::ranges::any_of(plan_.tasks, several)) {
        return "several calls at a time: " + model.name;
      }
      if (!model.link.empty() &&
          std::ranges::count(scenario_.platform.units, model.link, &UnitModel::link) > 1) {
        return "shares link " + model.link;
      }
      if (tasks[t].state && is_shared(*tasks[t].state)) {
        return "shares state " + scenario_.mix.states[*tasks[t].state].name;
      }
    }
    return "";
  }

  /// Whether a firing may find no image buffer, if none is late.
  [[nodiscard]] bool may_find_no_buffer() const {
    const Mix& mix = scenario_.mix;
    std::int64_t used = 0;
    for (std::size_t p = 0; mix.image_buffers && p < mix.pipelines.size(); ++p) {
      if (mix.pipelines[p].has_image_input() && !plan_.pipelines[p].is_periodic()) return true;
      used += image_buffers_of(mix.pipelines[p]);
    }
    return used > mix.image_buffers.value_or(used);
  }

  /// Whether another task of the workload may be there when the unit serves this one: it is not let
  /// in between two slices (Dispatcher::let_in).
  [[nodiscard]] bool meets_own_workload(const TaskClass& kind, UnitId unit) const {
    const auto meets = [&](const TaskClass& other) {
      return other.workload == kind.workload && contains(units_of(other.entry), unit) &&
             concurrent(other.entry, kind.entry);
    };
    return std::ranges::any_of(scenario_.classes, [&](const std::vector<TaskClass>& classes) {
      return std::ranges::any_of(classes, meets);
    });
  }

  /// Whether some call of the unit works on another's servers, or one of another's on its own.
  [[nodiscard]] bool shares_servers(UnitId unit) const {
    if (scenario_.platform.units[unit].shares_cores) return true;
    for (const auto& row : scenario_.services.entries) {
      for (UnitId by = 0; by < row.size(); ++by) {
        if (!row[by].service) continue;
        for (const ServiceStage& stage : row[by].service->stages) {
          if (stage.on && *stage.on != by && (by == unit || *stage.on == unit)) return true;
        }
      }
    }
    return false;
  }

  /// Whether tasks of several pipelines hold the state.
  [[nodiscard]] bool is_shared(std::size_t state) const {
    return std::ranges::count_if(scenario_.mix.pipelines, [state](const Pipeline& each) {
             return std::ranges::any_of(
                 each.tasks, [state](const MixTask& task) { return task.state == state; });
           }) > 1;
  }

  /// Responses make what comes after them ready later, which makes responses longer: until that
  /// changes nothing. False if it has no end.
  bool settle() {
    constexpr int kMostRounds = 200;
    for (int round = 0; round < kMostRounds; ++round) {
      bool changed = false;
      for (Analysed& task : tasks_) {
        for (const Analysed& other : tasks_) {
          if (!before_[task.entry].contains(other.entry)) continue;
          changed = changed || other.response > task.ready;
          task.ready = std::max(task.ready, other.response);
        }
        task.response = response_of(task);
        if (task.response == kNoLimit) return false;
      }
      if (!changed) return true;
    }
    return false;
  }

  /// Whether calls of the unit are suspended between slices: by deadline, not by when they have to
  /// start.
  [[nodiscard]] bool suspends_calls(UnitId unit) const {
    return contains(sliced_, unit) || std::ranges::any_of(tasks_, [unit](const Analysed& each) {
             return each.unit == unit && each.slice < each.takes;
           });
  }

  /// Firings of the other until so long after the task's may go before it.
  [[nodiscard]] Nanos reach_of(const Analysed& task, const Analysed& other) const {
    Nanos later = task.slack - other.slack;
    if (suspends_calls(task.unit)) later = std::max(later, task.deadline - other.deadline);
    return later + other.late + other.ready;
  }

  /// One that may want a task's unit at the same time.
  struct Rival {
    const Analysed* other;
    Nanos reach{0};  ///< As reach_of has it.
    Nanos delay{0};  ///< Of the task, by one firing of the other that goes before it.
  };
  [[nodiscard]] std::vector<Rival> rivals_of(const Analysed& task, Nanos blocking) const {
    std::vector<Rival> rivals;
    Nanos all{0};
    for (const Analysed& each : tasks_) {
      if (!compete(each, task)) continue;
      rivals.push_back({.other = &each, .reach = reach_of(task, each)});
      all += each.takes;
    }
    for (auto& [other, reach, delay] : rivals) {
      delay = other->takes;
      const Nanos others = all - other->takes;
      if (task.slice + others <= other->slack) continue;
      // Where a slice is too long for the other, the call as a whole has to fit before it: so long
      // the unit may be left idle for one firing.
      delay += other->late + task.takes + others - other->slack + blocking;
    }
    return rivals;
  }

  /// The longest of what may have begun before the task came, which nothing interrupts.
  [[nodiscard]] Nanos blocking_of(const Analysed& task) const {
    Nanos longest = std::min(others_[task.unit], task.tolerates);
    for (const Analysed& other : tasks_) {
      if (compete(other, task)) longest = std::max(longest, other.slice);
    }
    return longest;
  }

  /// From the begin of a busy period, in which the task becomes ready @p into, to its start.
  [[nodiscard]] static Nanos start_of(const Analysed& task, Nanos into, Nanos blocking,
                                      const std::vector<Rival>& rivals) {
    const Nanos limit = std::min(kLongest, 4 * (task.period + task.slack + blocking + into));
    // Its own firings before it.
    const std::int64_t own = (into + task.late + task.ready) / task.period;
    Nanos start{0};
    while (true) {
      Nanos next = blocking + own * task.takes;
      // What can be suspended may be until its end.
      const Nanos until = task.slice < task.takes ? start + task.takes : start;
      for (const auto& [other, reach, delay] : rivals) {
        next += delay * std::min(count_in(into + reach, other->period),
                                 count_in(until + other->late + other->ready, other->period));
      }
      if (next <= start) return start;
      if (next > limit) return kNoLimit;
      start = next;
    }
  }

  /// The longest over all places in a busy period where the number of those ahead changes.
  [[nodiscard]] Nanos response_of(const Analysed& task) const {
    std::set<Nanos> places = {Nanos::zero()};
    const Nanos last = busy_period(task.unit);
    if (last == kNoLimit) return kNoLimit;
    for (const Analysed& other : tasks_) {
      if (other.unit != task.unit) continue;
      // Only those above 0 count.
      const Nanos first = reach_of(task, other);
      for (std::int64_t k = std::max<std::int64_t>(0, first / other.period);
           places.size() < kMostPlaces; ++k) {
        const Nanos place = k * other.period - first;
        if (place > last) break;
        if (place > Nanos::zero()) places.insert(place);
      }
    }
    if (places.size() >= kMostPlaces) return kNoLimit;
    const Nanos blocking = blocking_of(task);
    const auto rivals = rivals_of(task, blocking);
    Nanos longest{0};
    for (const Nanos into : places) {
      const Nanos start = start_of(task, into, blocking, rivals);
      if (start == kNoLimit) return kNoLimit;
      longest = std::max(longest, start + task.takes - into);
    }
    return task.ready + std::max(longest, task.takes);
  }

  /// The longest time in which the unit always has something of these to do.
  [[nodiscard]] Nanos busy_period(UnitId unit) const {
    Nanos blocking{0};
    for (const Analysed& task : tasks_) {
      if (task.unit == unit) blocking = std::max(blocking, blocking_of(task));
    }
    Nanos length{1};
    while (true) {
      Nanos next = blocking;
      for (const Analysed& task : tasks_) {
        if (task.unit != unit) continue;
        next += count_in(length - Nanos(1) + task.late + task.ready, task.period) * task.takes;
      }
      if (next <= length) return length;
      if (next > kLongest) return kNoLimit;
      length = next;
    }
  }

  static constexpr std::size_t kMostPlaces = 2000;
  static constexpr Nanos kLongest = std::chrono::seconds(100);  ///< More counts as no limit.
  const Scenario& scenario_;
  const BudgetPlan& plan_;
  const BudgetPlan& given_;
  std::vector<std::set<std::uint32_t>> before_;  ///< By entry with a rate: what it comes after.
  std::vector<UnitMask> units_;         ///< By pipeline: those of its tasks, if it has a deadline.
  std::vector<std::string> obstacles_;  ///< By pipeline: why nothing is said of it; empty = it is.
  std::vector<Analysed> all_;           ///< Of pipelines without one.
  std::vector<Analysed> tasks_;         ///< Of these, those that are looked at together.
  std::vector<bool> keeps_;             ///< By pipeline: its deadline, if others held no unit.
  std::vector<Nanos> others_;  ///< By unit: the longest of a task without rate or deadline.
  UnitMask sliced_ = 0;        ///< Those where such a task can be suspended.
};

}  // namespace

bool protect(const Scenario& scenario, BudgetPlan& plan, bool one_at_a_time) {
  BudgetPlan alone = plan;  // Units without a link may serve one call at a time.
  for (BudgetPlan::Task& task : alone.tasks) {
    if (!one_at_a_time) break;
    for (UnitId unit = 0; unit < task.capacity.size(); ++unit) {
      if (!scenario.platform.units[unit].link.empty()) continue;
      task.capacity[unit] = std::min(task.capacity[unit], 1);
    }
  }
  return Analysis(scenario, alone, plan).protect(plan);
}

std::int64_t image_buffers_of(const Pipeline& pipeline) {
  if (!pipeline.has_image_input()) return 0;
  const std::int64_t kept = pipeline.keeps_image() ? 1 : 0;
  if (!pipeline.rate_hz) return kept + 1;
  const Nanos period = period_of(*pipeline.rate_hz);
  const Nanos lasts = pipeline.deadline.value_or(period) + pipeline.jitter;
  return kept + count_in(lasts - Nanos(1), period);
}

std::vector<Guarantee> guarantees_of(const Scenario& scenario, const BudgetPlan& plan) {
  return Analysis(scenario, plan, plan).run();
}

}  // namespace pirt
