#include "scheduler/bounds/bounds.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "scheduler/bounds/groups.h"
#include "scheduler/bounds/linear_program.h"
#include "scheduler/services/eligibility.h"

namespace pirt {
namespace {

using Terms = LinearProgram::Terms;

/// What a call costs, as @p taken has it.
UnitWork unit_work(const Scenario& run, const CallPlan& call, UnitId unit, Taken taken) {
  UnitWork work{.unit = unit,
                .server_ms = std::vector<double>(run.platform.units.size(), 0.0),
                .energy_j = call.energy_j(taken)};
  for (const CallStep& step : call.steps) {
    const double ms = to_ms(step.before_scale(taken)) * step.scale;
    work.total_ms += ms;
    if (step.servers < work.server_ms.size()) work.server_ms[step.servers] += ms;
  }
  return work;
}

/// By task: tasks that ask the same of the same units have one number.
std::vector<std::size_t> kinds_of(const PipelineWork& pipeline) {
  std::vector<std::size_t> kinds;
  std::map<std::vector<double>, std::size_t> known;
  for (const TaskWork& task : pipeline.tasks) {
    std::vector<double> key;
    for (const UnitWork& each : task.units) {
      key.push_back(each.unit);
      key.insert(key.end(), each.server_ms.begin(), each.server_ms.end());
      key.insert(key.end(), {each.total_ms, each.energy_j.value_or(-1)});
    }
    kinds.push_back(known.try_emplace(std::move(key), known.size()).first->second);
  }
  return kinds;
}

/// Where the order of tasks costs nothing: those of one kind.
std::vector<TaskGroup> by_kind(const Work& work) {
  std::vector<TaskGroup> groups;
  for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
    const std::size_t begin = groups.size();
    const std::vector<std::size_t> kinds = kinds_of(work.pipelines[p]);
    for (std::size_t t = 0; t < kinds.size(); ++t) {
      const std::size_t group = begin + kinds[t];
      if (group < groups.size()) {
        ++groups[group].tasks;
      } else {
        groups.push_back({.pipeline = p, .units = &work.pipelines[p].tasks[t].units});
      }
    }
  }
  number_variables(groups);
  return groups;
}

/// Where no task may be done more often than those that it comes after. Of one kind and alike are
/// links of a chain without branches, and then what comes after the same and before the same.
std::vector<TaskGroup> by_order(const Work& work) {
  std::vector<TaskGroup> groups;
  for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
    const auto& tasks = work.pipelines[p].tasks;
    const std::vector<std::size_t> kinds = kinds_of(work.pipelines[p]);
    std::vector<int> followers(tasks.size(), 0);
    for (const TaskWork& task : tasks) {
      for (const std::size_t before : task.after) ++followers[before];
    }
    struct Chain {
      std::size_t kind = 0;
      std::set<std::size_t> after = {}, behind = {};  ///< Chains.
      std::vector<std::size_t> tasks = {};
    };
    std::vector<Chain> chains;
    std::vector<std::size_t> chain_of;
    for (std::size_t t = 0; t < tasks.size(); ++t) {
      const auto& after = tasks[t].after;
      const bool goes_on =
          after.size() == 1 && followers[after.front()] == 1 && kinds[after.front()] == kinds[t];
      chain_of.push_back(goes_on ? chain_of[after.front()] : chains.size());
      if (!goes_on) {
        Chain& chain = chains.emplace_back(Chain{.kind = kinds[t]});
        for (const std::size_t before : after) chain.after.insert(chain_of[before]);
        for (const std::size_t before : chain.after) chains[before].behind.insert(chain_of[t]);
      }
      chains[chain_of[t]].tasks.push_back(t);
    }
    std::map<std::tuple<std::size_t, std::set<std::size_t>, std::set<std::size_t>>, std::size_t>
        known;
    std::vector<std::size_t> group_of;
    for (Chain& chain : chains) {
      const auto [found, is_new] = known.try_emplace(
          std::tuple(chain.kind, chain.after, std::move(chain.behind)), groups.size());
      group_of.push_back(found->second);
      if (is_new) {
        groups.push_back({.pipeline = p, .units = &tasks[chain.tasks.front()].units, .tasks = 0});
        for (const std::size_t before : chain.after) groups.back().after.insert(group_of[before]);
      }
      groups[found->second].tasks += static_cast<double>(chain.tasks.size());
    }
  }
  number_variables(groups);
  return groups;
}

/// Each task of a pipeline with firings is done once a firing, in parts on the units; most often
/// all of it where it is fastest.
void add_completeness(const std::vector<TaskGroup>& groups, LinearProgram& program) {
  for (const TaskGroup& group : groups) {
    Terms terms;
    group.add_whole(1.0, terms);
    const auto best =
        std::ranges::min_element(*group.units, {}, &UnitWork::total_ms) - group.units->begin();
    const int guess = terms[static_cast<std::size_t>(best)].first;
    program.add_row(terms, 1.0, 1.0, guess);
  }
}

}  // namespace

void number_variables(std::vector<TaskGroup>& groups) {
  int next = 0;
  for (TaskGroup& group : groups) {
    group.first = next;
    next += static_cast<int>(group.units->size());
  }
}

void add_capacity(const Work& work, const std::vector<TaskGroup>& groups,
                  const std::vector<double>& amount, double time_ms, const Terms& slack,
                  LinearProgram& program) {
  for (UnitId unit = 0; unit < work.units.size(); ++unit) {
    Terms busy = slack;
    Terms held = slack;
    for (auto& term : busy) term.second *= work.units[unit].servers;
    for (auto& term : held) term.second *= work.units[unit].slots.value_or(0);
    for_each_choice(groups, [&](const TaskGroup& group, const UnitWork& choice, int variable) {
      const double calls = amount[group.pipeline] * group.tasks;
      if (choice.server_ms[unit] > 0) busy.emplace_back(variable, calls * choice.server_ms[unit]);
      if (choice.unit == unit) held.emplace_back(variable, calls * choice.total_ms);
    });
    program.add_row(busy, -LinearProgram::kUnlimited, time_ms * work.units[unit].servers);
    if (work.units[unit].slots) {
      program.add_row(held, -LinearProgram::kUnlimited, time_ms * *work.units[unit].slots);
    }
  }
}

Work work_of(const Scenario& run, CloudUse cloud_use, Taken taken) {
  Work work;
  for (const UnitModel& unit : run.platform.units) {
    work.units.push_back({static_cast<double>(unit.servers), unit.slots});
    work.idle_w += unit.standing_w();
  }
  const UnitMask cloud = cloud_units(run.platform);
  for (std::size_t p = 0; p < run.mix.pipelines.size(); ++p) {
    const Pipeline& pipeline = run.mix.pipelines[p];
    PipelineWork& out = work.pipelines.emplace_back();
    if (pipeline.rate_hz) {
      // Firing begins at 0: one more than the rate alone gives.
      const double duration_ms = to_ms(run.duration);
      out.per_ms = *pipeline.rate_hz / 1e3 + 1.0 / duration_ms;
    }
    const std::vector<TaskPlan> plans = plan_tasks(run, p);
    for (std::size_t t = 0; t < pipeline.tasks.size(); ++t) {
      const TaskClass& kind = run.classes[p][t];
      TaskWork& task = out.tasks.emplace_back();
      task.after = pipeline.tasks[t].after;
      const bool may_leave =
          cloud_use == CloudUse::kAll || (cloud_use == CloudUse::kNotRealTime && !kind.real_time);
      const UnitMask here = kind.eligible & ~cloud;
      const UnitMask eligible = may_leave || here == 0 ? kind.eligible : here;
      for (UnitId unit = 0; unit < run.platform.units.size(); ++unit) {
        if (!contains(eligible, unit)) continue;
        task.units.push_back(unit_work(run, plans[t].calls[unit], unit, taken));
      }
    }
  }
  return work;
}

std::optional<double> most_tasks_per_ms(const Work& work) {
  const std::vector<TaskGroup> groups = by_order(work);
  LinearProgram program;
  for_each_choice(groups, [&](const TaskGroup& group, const UnitWork&, int) {
    program.add_variable(-group.tasks);
  });
  for (const TaskGroup& group : groups) {
    Terms own;
    group.add_whole(1.0, own);
    const auto& per_ms = work.pipelines[group.pipeline].per_ms;
    if (per_ms) program.add_row(own, 0.0, *per_ms);
    for (const std::size_t before : group.after) {
      Terms terms = own;
      groups[before].add_whole(-1.0, terms);
      program.add_row(terms, -LinearProgram::kUnlimited, 0.0);
    }
  }
  add_capacity(work, groups, std::vector<double>(work.pipelines.size(), 1.0), 1.0, {}, program);
  const auto least = program.minimum();
  return least ? std::optional(-*least) : std::nullopt;
}

std::optional<double> least_energy_j(const Work& work, const std::vector<double>& firings,
                                     double makespan_ms) {
  const std::vector<TaskGroup> groups = by_kind(work);
  LinearProgram program;
  bool known = true;
  for_each_choice(groups, [&](const TaskGroup& group, const UnitWork& choice, int) {
    known = known && choice.energy_j;
    program.add_variable(firings[group.pipeline] * group.tasks * choice.energy_j.value_or(0));
  });
  if (!known) return std::nullopt;
  add_completeness(groups, program);
  add_capacity(work, groups, firings, makespan_ms, {}, program);
  const auto least = program.minimum();
  return least ? std::optional(*least + work.idle_w * makespan_ms / 1e3) : std::nullopt;
}

std::optional<double> area_ms(const Work& work, const std::vector<double>& firings) {
  const std::vector<TaskGroup> groups = by_kind(work);
  LinearProgram program;
  for_each_choice(groups,
                  [&](const TaskGroup&, const UnitWork&, int) { program.add_variable(0.0); });
  const int time = program.add_variable(1.0);
  add_completeness(groups, program);
  add_capacity(work, groups, firings, 0.0, {{time, -1.0}}, program);
  return program.minimum();
}

double critical_path_ms(const PipelineWork& pipeline) {
  std::vector<double> end;
  for (const TaskWork& task : pipeline.tasks) {
    double start = 0;
    for (const std::size_t before : task.after) start = std::max(start, end[before]);
    const auto fastest = std::ranges::min_element(task.units, {}, &UnitWork::total_ms);
    end.push_back(start + fastest->total_ms);
  }
  return end.empty() ? 0 : std::ranges::max(end);
}

RunBounds bounds_of(const Scenario& run, CloudUse cloud_use, const RunRecord& record) {
  const Work work = work_of(run, cloud_use);
  RunBounds bounds;
  std::vector<double> firings;
  double longest_ms = 0;
  for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
    const PipelineResult& done = record.pipelines[p];
    const double path_ms = critical_path_ms(work.pipelines[p]);
    firings.push_back(static_cast<double>(done.completed));
    bounds.critical_path_ms[done.pipeline] = path_ms;
    if (done.completed > 0) longest_ms = std::max(longest_ms, path_ms);
  }
  bounds.throughput_per_ms = most_tasks_per_ms(work);
  bounds.energy_j = least_energy_j(work, firings, record.makespan_s * 1e3);
  const auto area = area_ms(work, firings);
  // With an open loop the makespan is the duration, which nobody chose a unit for.
  if (area && !run.mix.open_loop()) bounds.makespan_s = std::max(*area, longest_ms) / 1e3;
  return bounds;
}

}  // namespace pirt
