#include "scheduler/budget/guarantees.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <set>

namespace pirt {
namespace {

constexpr Nanos kNoLimit = Nanos::max();

/// How many multiples of the period lie in a time, both ends included.
std::int64_t count_in(Nanos time, Nanos period) {
  return time < Nanos::zero() ? 0 : time / period + 1;
}

Nanos period_of(const BudgetPlan::Arrivals& arrivals) {
  return Nanos(static_cast<std::int64_t>(1e9 / *arrivals.rate_hz));
}

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
  Analysis(const Scenario& scenario, const BudgetPlan& plan)
      : scenario_(scenario), plan_(plan), before_(plan.tasks.size()) {
    for (std::size_t p = 0; p < scenario.classes.size(); ++p) {
      const auto& classes = scenario.classes[p];
      for (std::size_t t = 0; t < classes.size(); ++t) {
        add(p, classes[t].entry);
        auto& before = before_[classes[t].entry];
        for (const std::size_t each : scenario.mix.pipelines[p].waits_for(t)) {
          const std::uint32_t entry = classes[each].entry;
          before.insert(entry);
          before.insert(before_[entry].begin(), before_[entry].end());
        }
      }
    }
    obstacles_ = all_obstacles();
    std::erase_if(all_, [&](const Analysed& each) { return !obstacles_[each.pipeline].empty(); });
  }

  std::vector<Guarantee> run() {
    std::vector<Guarantee> results(scenario_.mix.pipelines.size());
    for (std::size_t p = 0; p < results.size(); ++p) {
      if (!is_periodic(p)) continue;
      results[p].not_analysed = obstacles_[p];
      results[p].analysed = obstacles_[p].empty();
      if (!results[p].analysed) continue;
      tasks_ = together_with(p);
      if (const auto responses = settled_responses()) results[p].response = (*responses)[p];
    }
    return results;
  }

  /// Sets how long others may hold the units of @p plan's tasks.
  void protect(BudgetPlan& plan) {
    for (const Analysed& each : all_) {  // Their units serve one call at a time here.
      for (BudgetPlan::Task& task : plan.tasks) {
        task.capacity[each.unit] = std::min(task.capacity[each.unit], 1);
      }
    }
    std::vector<bool> done(plan.tasks.size(), false);
    for (const Analysed& first : all_) {
      if (done[first.entry]) continue;
      tasks_ = together_with(first.pipeline);
      for (const Analysed& each : tasks_) done[each.entry] = true;
      if (!share_slack()) continue;
      // Of those that keep no deadline, too: others count on how late they are.
      for (const Analysed& each : tasks_) {
        if (each.tolerates == kNoLimit) continue;
        plan.tasks[each.entry].ready = each.ready;
        plan.tasks[each.entry].tolerates = each.tolerates;
      }
    }
  }

 private:
  /// As much of the time that guaranteed tasks have is left to others as no guarantee is lost by:
  /// any, or all that they have alone, half of that and so on. False where nothing is guaranteed.
  bool share_slack() {
    constexpr std::array kParts = {1.0, 0.5, 0.25, 0.125, 0.0};
    std::vector<Nanos> responses;  // If others held no unit.
    const auto settles_with = [&](const auto& tolerates) {
      for (Analysed& each : tasks_) {
        each.tolerates = keeps_[each.pipeline] ? tolerates(each) : Nanos::zero();
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
    keeps_.assign(scenario_.mix.pipelines.size(), false);
    settles_with([](const Analysed&) { return Nanos::zero(); });
    if (responses.empty()) return false;
    for (const Analysed& each : tasks_) {
      keeps_[each.pipeline] = responses[each.pipeline] <= each.deadline;
    }
    if (std::ranges::none_of(keeps_, std::identity{})) return false;
    if (settles_with([](const Analysed&) { return kNoLimit; })) return true;
    return std::ranges::any_of(kParts, [&](double part) {
      return settles_with([&](const Analysed& each) {
        const auto tasks = static_cast<double>(scenario_.classes[each.pipeline].size());
        return scaled(each.deadline - responses[each.pipeline], part / tasks);
      });
    });
  }

  /// The tasks of the pipeline, of those that share a unit with it, and so on.
  [[nodiscard]] std::vector<Analysed> together_with(std::size_t pipeline) const {
    std::set<std::size_t> pipelines = {pipeline};
    UnitMask units = 0;
    for (std::size_t known = 0; known != pipelines.size();) {
      known = pipelines.size();
      for (const Analysed& task : all_) {
        if (pipelines.contains(task.pipeline)) units |= unit_bit(task.unit);
      }
      for (const Analysed& task : all_) {
        if (contains(units, task.unit)) pipelines.insert(task.pipeline);
      }
    }
    std::vector<Analysed> tasks;
    std::ranges::copy_if(all_, std::back_inserter(tasks),
                         [&](const Analysed& task) { return pipelines.contains(task.pipeline); });
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

  /// By pipeline. What is not analysed may be in the way of others at any time: nothing can be said
  /// of those on its units either.
  [[nodiscard]] std::vector<std::string> all_obstacles() const {
    const auto& pipelines = scenario_.mix.pipelines;
    std::vector<std::string> obstacles(pipelines.size());
    std::vector<UnitMask> units(pipelines.size(), 0);
    for (std::size_t p = 0; p < pipelines.size(); ++p) {
      if (!pipelines[p].deadline) continue;
      obstacles[p] = pipelines[p].rate_hz ? obstacle(p) : "closed loop";
      for (const TaskClass& kind : scenario_.classes[p]) units[p] |= units_of(kind.entry);
    }
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t p = 0; p < pipelines.size(); ++p) {
        for (std::size_t q = 0; q < pipelines.size() && obstacles[p].empty(); ++q) {
          if (obstacles[q].empty() || (units[p] & units[q]) == 0) continue;
          obstacles[p] = "on a unit of " + pipelines[q].name + ", which is not";
          changed = true;
        }
      }
    }
    return obstacles;
  }

  /// Those that the plan may give the task to.
  [[nodiscard]] UnitMask units_of(std::uint32_t entry) const {
    const BudgetPlan::Task& task = plan_.tasks[entry];
    UnitMask mask = unit_bit(task.units.front());
    for (const UnitId unit : task.units) mask |= task.pinned ? UnitMask{0} : unit_bit(unit);
    return mask;
  }

  /// Whether both may want their unit at a time.
  [[nodiscard]] bool compete(const Analysed& a, const Analysed& b) const {
    return a.unit == b.unit && a.entry != b.entry && !before_[a.entry].contains(b.entry) &&
           !before_[b.entry].contains(a.entry);
  }

  [[nodiscard]] bool is_periodic(std::size_t pipeline) const {
    return plan_.pipelines[pipeline].is_periodic();
  }

  void add(std::size_t pipeline, std::uint32_t entry) {
    const BudgetPlan::Task& task = plan_.tasks[entry];
    const UnitId unit = task.units.front();
    const Nanos takes = task.takes(unit);
    if (!is_periodic(pipeline)) {
      for (const UnitId each : task.units) {
        if (task.capacity[each] == 0) continue;
        others_.push_back({each, task.slice_on(each) + task.prepare[each]});
      }
      return;
    }
    const auto& arrivals = plan_.pipelines[pipeline];
    all_.push_back({.entry = entry,
                    .pipeline = pipeline,
                    .unit = unit,
                    .period = period_of(arrivals),
                    .takes = takes,
                    .slice = task.slice_on(unit) + task.prepare[unit],
                    .deadline = *arrivals.deadline,
                    .slack = *arrivals.deadline - task.behind - takes,
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
      if (!model.link.empty()) {
        const auto several = [unit](const BudgetPlan::Task& each) {
          return each.capacity[unit] > 1;
        };
        if (std::ranges::any_of(plan_.tasks, several))
          return "several calls at a time: " + model.name;
        if (std::ranges::count(scenario_.platform.units, model.link, &UnitModel::link) > 1) {
          return "shares link " + model.link;
        }
      }
      if (tasks[t].state && shared_state(pipeline, *tasks[t].state)) {
        return "shares state " + scenario_.mix.states[*tasks[t].state].name;
      }
    }
    return "";
  }

  /// Whether a firing may find no image buffer: of each pipeline so many are under way as fire
  /// while one is, if none is late, and a later firing may take an image of one more.
  [[nodiscard]] bool may_find_no_buffer() const {
    const Mix& mix = scenario_.mix;
    std::int64_t used = 0;
    for (std::size_t p = 0; mix.image_buffers && p < mix.pipelines.size(); ++p) {
      if (!mix.pipelines[p].has_image_input()) continue;
      if (!is_periodic(p)) return true;
      const auto& arrivals = plan_.pipelines[p];
      const Nanos lasts = *arrivals.deadline + arrivals.jitter;
      used += (lasts - Nanos(1)) / period_of(arrivals) + 1;
      used += mix.pipelines[p].keeps_image() ? 1 : 0;
    }
    return used > mix.image_buffers.value_or(used);
  }

  /// Whether another task of the workload may be there when the unit serves this one: it is not let
  /// in between two slices (Dispatcher::may_let_in).
  [[nodiscard]] bool meets_own_workload(const TaskClass& kind, UnitId unit) const {
    const auto meets = [&](const TaskClass& other) {
      return other.workload == kind.workload && other.entry != kind.entry &&
             contains(units_of(other.entry), unit) && !before_[kind.entry].contains(other.entry) &&
             !before_[other.entry].contains(kind.entry);
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

  [[nodiscard]] bool shared_state(std::size_t pipeline, std::size_t state) const {
    for (std::size_t p = 0; p < scenario_.mix.pipelines.size(); ++p) {
      if (p == pipeline) continue;
      for (const MixTask& task : scenario_.mix.pipelines[p].tasks) {
        if (task.state == state) return true;
      }
    }
    return false;
  }

  /// Responses make what comes after them ready later, which makes responses longer: until nothing
  /// changes. False if that has no end.
  bool settle() {
    constexpr int kMostRounds = 200;
    for (int round = 0; round < kMostRounds; ++round) {
      bool changed = false;
      for (Analysed& task : tasks_) {
        const Nanos ready = ready_of(task);
        task.ready = std::max(task.ready, ready);
        const Nanos response = response_of(task);
        changed = changed || response != task.response;
        task.response = response;
        if (response == kNoLimit) return false;
      }
      if (!changed) return true;
    }
    return false;
  }

  [[nodiscard]] Nanos ready_of(const Analysed& task) const {
    const auto& classes = scenario_.classes[task.pipeline];
    const auto position = static_cast<std::size_t>(
        std::ranges::find(classes, task.entry, &TaskClass::entry) - classes.begin());
    Nanos ready{0};
    for (const std::size_t each : scenario_.mix.pipelines[task.pipeline].waits_for(position)) {
      const auto before = std::ranges::find(tasks_, classes[each].entry, &Analysed::entry);
      ready = std::max(ready, before->response);
    }
    return ready;
  }

  /// Whether calls of the unit are suspended between slices: by deadline, not by when they have to
  /// start.
  [[nodiscard]] bool suspends_calls(UnitId unit) const {
    return std::ranges::any_of(tasks_, [unit](const Analysed& each) {
      return each.unit == unit && each.slice < each.takes;
    });
  }

  /// Firings of the other, in a busy period, whose tasks may go before @p task, ready @p into it,
  /// or are there before @p until.
  [[nodiscard]] std::int64_t ahead(const Analysed& task, const Analysed& other, Nanos into,
                                   Nanos until) const {
    const Nanos spread = other.late + other.ready;
    Nanos sooner = task.slack - other.slack;
    if (suspends_calls(task.unit)) sooner = std::max(sooner, task.deadline - other.deadline);
    return std::min(count_in(into + sooner + spread, other.period),
                    count_in(until + spread, other.period));
  }

  /// How long the unit may be left idle for one firing of the other while this task waits.
  [[nodiscard]] Nanos idle_for(const Analysed& task, const Analysed& other, Nanos blocking) const {
    Nanos others{0};
    for (const Analysed& each : tasks_) {
      if (compete(each, task) && each.entry != other.entry) others += each.takes;
    }
    if (task.slice + others <= other.slack) return Nanos::zero();
    // Where a slice is too long for the other, the call as a whole has to fit before it.
    return other.late + task.takes + others - other.slack + blocking;
  }

  /// The longest of what may have begun before the task came, which nothing interrupts.
  [[nodiscard]] Nanos blocking_of(const Analysed& task) const {
    Nanos longest{0};
    for (const auto& [unit, takes] : others_) {
      if (unit == task.unit) longest = std::max(longest, std::min(takes, task.tolerates));
    }
    for (const Analysed& other : tasks_) {
      if (compete(other, task)) longest = std::max(longest, other.slice);
    }
    return std::max(longest, Nanos::zero());
  }

  /// From the begin of a busy period, in which the task becomes ready @p into, to its start.
  [[nodiscard]] Nanos start_of(const Analysed& task, Nanos into) const {
    const Nanos blocking = blocking_of(task);
    const Nanos limit = 4 * (task.period + task.slack + blocking + into);
    // Its own firings before it.
    const std::int64_t own = (into + task.late + task.ready) / task.period;
    Nanos start{0};
    while (true) {
      Nanos next = blocking + own * task.takes;
      for (const Analysed& other : tasks_) {
        if (!compete(other, task)) continue;
        // What can be suspended may be until its end.
        const Nanos until = task.slice < task.takes ? start + task.takes : start;
        const std::int64_t firings = ahead(task, other, into, until);
        next += firings * (other.takes + idle_for(task, other, blocking));
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
      const Nanos first = task.slack + other.late + other.ready - other.slack;
      for (std::int64_t k = std::max<std::int64_t>(0, first / other.period);
           places.size() < kMostPlaces; ++k) {
        const Nanos place = k * other.period - first;
        if (place > last) break;
        if (place > Nanos::zero()) places.insert(place);
      }
    }
    if (places.size() >= kMostPlaces) return kNoLimit;
    Nanos longest{0};
    for (const Nanos into : places) {
      const Nanos start = start_of(task, into);
      if (start == kNoLimit) return kNoLimit;
      longest = std::max(longest, start + task.takes - into);
    }
    return task.ready + std::max(longest, task.takes);
  }

  /// The longest time in which the unit always has something of these to do.
  [[nodiscard]] Nanos busy_period(UnitId unit) const {
    constexpr Nanos kLongest = std::chrono::seconds(100);
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
  struct Other {
    UnitId unit = 0;
    Nanos takes{0};
  };
  const Scenario& scenario_;
  const BudgetPlan& plan_;
  std::vector<std::set<std::uint32_t>> before_;  ///< By entry: those that it comes after.
  std::vector<std::string> obstacles_;           ///< By pipeline: all_obstacles().
  std::vector<Analysed> all_;                    ///< Of pipelines without one.
  std::vector<Analysed> tasks_;                  ///< Of these, those that are looked at together.
  std::vector<bool> keeps_;    ///< By pipeline: its deadline, if others held no unit.
  std::vector<Other> others_;  ///< Calls of tasks without rate or deadline, on all their units.
};

}  // namespace

void protect(const Scenario& scenario, BudgetPlan& plan) {
  for (BudgetPlan::Task& task : plan.tasks) task.tolerates.reset();
  Analysis(scenario, plan).protect(plan);
}

std::vector<Guarantee> guarantees_of(const Scenario& scenario, const BudgetPlan& plan) {
  return Analysis(scenario, plan).run();
}

}  // namespace pirt
