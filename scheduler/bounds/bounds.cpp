#include "scheduler/bounds/bounds.h"

#include <algorithm>

#include "scheduler/bounds/linear_program.h"
#include "scheduler/services/eligibility.h"
#include "scheduler/services/transfers.h"

namespace pirt {
namespace {

using Terms = LinearProgram::Terms;

/// The least that a call can cost: drawn times at their lowest.
UnitWork unit_work(const Scenario& run, const MixTask& task, WorkloadId workload, UnitId unit) {
  const Service& service = *run.services.find(workload, unit);
  UnitWork work{.unit = unit, .server_ms = std::vector<double>(run.platform.units.size(), 0.0)};
  for (const ServiceStage& stage : service.stages) {
    const double ms = to_ms(stage.time.low) * stage.scale;
    work.total_ms += ms;
    if (!stage.on) continue;
    work.server_ms[*stage.on] += ms;
  }
  work.energy_j = call_energy_j(run.platform, service,
                                [](const ServiceStage& stage) { return stage.time.low; });
  if (const Link* link = link_of(run.platform, unit)) {
    const CallBytes bytes = call_bytes(task);
    const Nanos sending = sending_time(*link, bytes.in) + sending_time(*link, bytes.out);
    if (work.energy_j) *work.energy_j += link->active_w * to_s(sending);
    work.total_ms += to_ms(sending);
  }
  return work;
}

/// One variable for each (pipeline, task, unit), in that order.
template <typename Function>
void for_each_choice(const Work& work, const Function& function) {
  int variable = 0;
  for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
    for (std::size_t t = 0; t < work.pipelines[p].tasks.size(); ++t) {
      for (const UnitWork& choice : work.pipelines[p].tasks[t].units) {
        function(p, t, choice, variable++);
      }
    }
  }
}

/// The variables of each task: by pipeline and task, the first and how many.
class TaskVariables {
 public:
  explicit TaskVariables(const Work& work) {
    int next = 0;
    for (const PipelineWork& pipeline : work.pipelines) {
      auto& row = ranges_.emplace_back();
      for (const TaskWork& task : pipeline.tasks) {
        const int count = static_cast<int>(task.units.size());
        row.push_back({next, count});
        next += count;
      }
    }
  }

  /// Those of one task, with @p coefficient each.
  void add(std::size_t pipeline, std::size_t task, double coefficient, Terms& terms) const {
    const Range& range = ranges_[pipeline][task];
    for (int i = 0; i < range.count; ++i) terms.emplace_back(range.first + i, coefficient);
  }

 private:
  struct Range {
    int first, count;
  };
  std::vector<std::vector<Range>> ranges_;
};

/// Server time and slots of each unit: at most its own. @p amount is what a variable of 1 stands
/// for in that pipeline.
void add_capacity(const Work& work, const std::vector<double>& amount, double time_ms,
                  const Terms& slack, LinearProgram& program) {
  for (UnitId unit = 0; unit < work.units.size(); ++unit) {
    Terms busy = slack;
    Terms held = slack;
    for (auto& term : busy) term.second *= work.units[unit].servers;
    for (auto& term : held) term.second *= work.units[unit].slots.value_or(0);
    for_each_choice(work, [&](std::size_t p, std::size_t, const UnitWork& choice, int variable) {
      if (choice.server_ms[unit] > 0)
        busy.emplace_back(variable, amount[p] * choice.server_ms[unit]);
      if (choice.unit == unit) held.emplace_back(variable, amount[p] * choice.total_ms);
    });
    program.add_row(std::move(busy), -LinearProgram::kUnlimited,
                    time_ms * work.units[unit].servers);
    if (work.units[unit].slots) {
      program.add_row(std::move(held), -LinearProgram::kUnlimited,
                      time_ms * *work.units[unit].slots);
    }
  }
}

/// Each task of a pipeline with firings is done once a firing, in parts on the units; most often
/// all of it where it is fastest.
void add_completeness(const Work& work, LinearProgram& program) {
  const TaskVariables variables(work);
  for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
    for (std::size_t t = 0; t < work.pipelines[p].tasks.size(); ++t) {
      Terms terms;
      variables.add(p, t, 1.0, terms);
      const auto& units = work.pipelines[p].tasks[t].units;
      const auto best = std::ranges::min_element(units, {}, &UnitWork::total_ms) - units.begin();
      const int guess = terms[static_cast<std::size_t>(best)].first;
      program.add_row(std::move(terms), 1.0, 1.0, guess);
    }
  }
}

}  // namespace

Work work_of(const Scenario& run, CloudUse cloud_use) {
  Work work;
  for (const UnitModel& unit : run.platform.units) {
    work.units.push_back({static_cast<double>(unit.servers), unit.slots});
    work.idle_w += unit.idle_w;
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
        task.units.push_back(unit_work(run, pipeline.tasks[t], kind.workload, unit));
      }
    }
  }
  return work;
}

std::optional<double> most_tasks_per_ms(const Work& work) {
  LinearProgram program;
  for_each_choice(
      work, [&](std::size_t, std::size_t, const UnitWork&, int) { program.add_variable(-1.0); });
  const TaskVariables variables(work);
  for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
    const PipelineWork& pipeline = work.pipelines[p];
    for (std::size_t t = 0; t < pipeline.tasks.size(); ++t) {
      Terms own;
      variables.add(p, t, 1.0, own);
      if (pipeline.per_ms) program.add_row(own, 0.0, *pipeline.per_ms);
      for (const std::size_t before : pipeline.tasks[t].after) {
        Terms terms = own;
        variables.add(p, before, -1.0, terms);
        program.add_row(std::move(terms), -LinearProgram::kUnlimited, 0.0);
      }
    }
  }
  add_capacity(work, std::vector<double>(work.pipelines.size(), 1.0), 1.0, {}, program);
  const auto least = program.minimum();
  return least ? std::optional(-*least) : std::nullopt;
}

std::optional<double> least_energy_j(const Work& work, const std::vector<double>& firings,
                                     double makespan_ms) {
  LinearProgram program;
  bool known = true;
  for_each_choice(work, [&](std::size_t p, std::size_t, const UnitWork& choice, int) {
    known = known && choice.energy_j;
    program.add_variable(firings[p] * choice.energy_j.value_or(0));
  });
  if (!known) return std::nullopt;
  add_completeness(work, program);
  add_capacity(work, firings, makespan_ms, {}, program);
  const auto least = program.minimum();
  return least ? std::optional(*least + work.idle_w * makespan_ms / 1e3) : std::nullopt;
}

std::optional<double> area_ms(const Work& work, const std::vector<double>& firings) {
  LinearProgram program;
  for_each_choice(
      work, [&](std::size_t, std::size_t, const UnitWork&, int) { program.add_variable(0.0); });
  const int time = program.add_variable(1.0);
  add_completeness(work, program);
  add_capacity(work, firings, 0.0, {{time, -1.0}}, program);
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
