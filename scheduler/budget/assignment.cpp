#include "scheduler/budget/assignment.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "scheduler/bounds/groups.h"
#include "scheduler/bounds/linear_program.h"

namespace pirt {
namespace {

using Terms = LinearProgram::Terms;

constexpr double kPart = 1e-3;  ///< Of a task's calls: less elsewhere is nothing.
constexpr double kNone = 1e-6;  ///< Of a task's calls: less than this part is none.

struct Assignment {
  std::vector<std::vector<double>> calls_per_ms;  ///< [entry][unit]
  double rate_per_ms = 0;                         ///< Tasks.
};

/// Calls a millisecond of each task on each unit that may serve it, then firings a millisecond of
/// each pipeline.
class Programme {
 public:
  enum class Cost : std::uint8_t { kRate, kEnergy };
  enum class Urgent : std::uint8_t { kAll, kAsManyAsFit };

  Programme(const Work& work, const BudgetPlan& plan, const Goals& goals, Cost cost, Urgent fits)
      : work_(work) {
    for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
      for (const TaskWork& task : work.pipelines[p].tasks) {
        groups_.push_back({.pipeline = p, .units = &task.units});
      }
    }
    number_variables(groups_);
    for_each_choice(groups_, [&](const TaskGroup&, const UnitWork& choice, int) {
      // Energy counts for little beside the rate, so that it breaks ties alone.
      const double energy_mj = choice.energy_j.value_or(0) * 1e3;
      program_.add_variable(cost == Cost::kEnergy ? energy_mj : 1e-6 * energy_mj);
    });
    for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
      const auto& per_ms = work.pipelines[p].per_ms;
      const auto tasks = static_cast<double>(work.pipelines[p].tasks.size());
      const int firings = program_.add_variable(cost == Cost::kRate ? -tasks : 0,
                                                per_ms.value_or(LinearProgram::kUnlimited));
      firings_.push_back(firings);
      if (plan.pipelines[p].deadline && per_ms && fits == Urgent::kAll) {
        program_.add_row({{firings, 1.0}}, *per_ms, *per_ms);
      }
    }
    for (const TaskGroup& task : groups_) {  // Once a firing.
      Terms terms = {{firings_[task.pipeline], -1.0}};
      task.add_whole(1.0, terms);
      program_.add_row(terms, 0.0, 0.0);
    }
    add_capacity(work, groups_, std::vector<double>(firings_.size(), 1.0), 1.0, {}, program_);
    if (goals.most_w) add_power(*goals.most_w);
  }

  void at_least(double tasks_per_ms) {
    Terms terms;
    for (std::size_t p = 0; p < firings_.size(); ++p) {
      terms.emplace_back(firings_[p], static_cast<double>(work_.pipelines[p].tasks.size()));
    }
    program_.add_row(terms, tasks_per_ms, LinearProgram::kUnlimited);
  }
  /// No pipeline less often than in the other solution, up to a little.
  void keep_pipelines(const std::vector<double>& values) {
    for (const int each : firings_) {
      program_.add_row({{each, 1.0}}, 0.999 * values[static_cast<std::size_t>(each)],
                       LinearProgram::kUnlimited);
    }
  }

  [[nodiscard]] auto solve() const { return program_.solve(); }

  [[nodiscard]] Assignment read(const std::vector<double>& values) const {
    Assignment result;
    for (const TaskGroup& task : groups_) {
      auto& row = result.calls_per_ms.emplace_back(work_.units.size(), 0.0);
      auto calls = values.begin() + task.first;
      for (const UnitWork& choice : *task.units) {
        row[choice.unit] = *calls++;
        result.rate_per_ms += row[choice.unit];
      }
    }
    return result;
  }

 private:
  void add_power(double most_w) {
    Terms terms;
    for_each_choice(groups_, [&](const TaskGroup&, const UnitWork& choice, int variable) {
      terms.emplace_back(variable, choice.energy_j.value_or(0) * 1e3);
    });
    program_.add_row(terms, -LinearProgram::kUnlimited, most_w);
  }

  const Work& work_;
  LinearProgram program_;
  std::vector<TaskGroup> groups_;  ///< Of one task each, in the order of entries.
  std::vector<int> firings_;       ///< By pipeline.
};

/// Absent if no rate above 0 keeps the goals.
std::optional<Assignment> best_assignment(const Work& work, const BudgetPlan& plan,
                                          const Goals& goals) {
  using Cost = Programme::Cost;
  for (const auto fits : {Programme::Urgent::kAll, Programme::Urgent::kAsManyAsFit}) {
    const Programme fastest(work, plan, goals, Cost::kRate, fits);
    const auto most = fastest.solve();
    if (!most) continue;
    const Assignment fast = fastest.read(most->values);
    if (fast.rate_per_ms <= 0) continue;
    Programme cheapest(work, plan, goals, Cost::kEnergy, fits);
    const bool closed = std::ranges::none_of(
        work.pipelines, [](const PipelineWork& each) { return each.per_ms.has_value(); });
    if (goals.objective == Objective::kEnergy && closed) {
      cheapest.at_least(std::min(goals.min_rate_per_ms.value_or(0.3 * fast.rate_per_ms),
                                 0.999 * fast.rate_per_ms));
    } else {
      cheapest.keep_pipelines(most->values);
    }
    const auto least = cheapest.solve();
    return least ? cheapest.read(least->values) : fast;
  }
  return std::nullopt;
}

/// Sets the plan's units, and how long queues may be, by what the programme gives them.
void take_units(const Assignment& assignment, BudgetPlan& plan) {
  for (std::size_t entry = 0; entry < plan.tasks.size(); ++entry) {
    BudgetPlan::Task& task = plan.tasks[entry];
    const auto& calls = assignment.calls_per_ms[entry];
    double all = 0;
    for (const double each : calls) all += each;
    if (all <= 0) continue;
    std::ranges::stable_sort(task.units, std::greater{},
                             [&](UnitId unit) { return std::lround(calls[unit] / all * 1e6); });
    // Its rate is more than one unit is for.
    task.pinned = task.pinned && calls[task.units.front()] > (1 - kPart) * all;
    if (task.pinned) continue;
    for (const UnitId unit : task.units) {
      if (calls[unit] < kNone * all) task.capacity[unit] = 0;
    }
  }
}

}  // namespace

void assign(const Work& work, const Goals& goals, BudgetPlan& plan) {
  if (const auto best = best_assignment(work, plan, goals)) take_units(*best, plan);
}

}  // namespace pirt
