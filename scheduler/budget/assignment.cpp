#include "scheduler/budget/assignment.h"

#include <algorithm>

#include "scheduler/bounds/linear_program.h"

namespace pirt {
namespace {

using Terms = LinearProgram::Terms;

/// Calls a millisecond of each task on each unit that may serve it, then firings a millisecond of
/// each pipeline.
class Programme {
 public:
  enum class Cost : std::uint8_t { kRate, kEnergy };
  enum class Urgent : std::uint8_t { kAll, kAsManyAsFit };

  Programme(const Work& work, const std::vector<bool>& urgent, const Goals& goals, Cost cost,
            Urgent fits)
      : work_(work) {
    for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
      for (const TaskWork& task : work.pipelines[p].tasks) {
        firsts_.push_back(next_);
        for (const UnitWork& each : task.units) {
          // Energy counts for little beside the rate, so that it breaks ties alone.
          const double energy_mj = each.energy_j.value_or(0) * 1e3;
          program_.add_variable(cost == Cost::kEnergy ? energy_mj : 1e-6 * energy_mj);
          ++next_;
        }
      }
    }
    for (std::size_t p = 0; p < work.pipelines.size(); ++p) {
      const auto& per_ms = work.pipelines[p].per_ms;
      const auto tasks = static_cast<double>(work.pipelines[p].tasks.size());
      const int firings = program_.add_variable(cost == Cost::kRate ? -tasks : 0,
                                                per_ms.value_or(LinearProgram::kUnlimited));
      firings_.push_back(firings);
      if (urgent[p] && per_ms && fits == Urgent::kAll) {
        program_.add_row({{firings, 1.0}}, *per_ms, *per_ms);
      }
    }
    add_tasks();
    add_units();
    if (goals.most_w) add_power(*goals.most_w);
  }

  void at_least(double tasks_per_ms) {
    program_.add_row(all_tasks(), tasks_per_ms, LinearProgram::kUnlimited);
  }
  /// No pipeline less often than in the other solution, up to a little.
  void keep_pipelines(const std::vector<double>& values) {
    for (const int each : firings_) {
      program_.add_row({{each, 1.0}}, 0.999 * values[static_cast<std::size_t>(each)],
                       LinearProgram::kUnlimited);
    }
  }

  [[nodiscard]] std::optional<std::vector<double>> solve() const {
    auto solution = program_.solve();
    return solution ? std::optional(std::move(solution->values)) : std::nullopt;
  }

  [[nodiscard]] Assignment read(const std::vector<double>& values) const {
    Assignment result;
    std::size_t entry = 0;
    for (const PipelineWork& pipeline : work_.pipelines) {
      for (const TaskWork& task : pipeline.tasks) {
        auto& row = result.calls_per_ms.emplace_back(work_.units.size(), 0.0);
        for (std::size_t i = 0; i < task.units.size(); ++i) {
          row[task.units[i].unit] = values[static_cast<std::size_t>(firsts_[entry]) + i];
          result.rate_per_ms += row[task.units[i].unit];
        }
        ++entry;
      }
    }
    return result;
  }

 private:
  [[nodiscard]] Terms all_tasks() const {
    Terms terms;
    for (std::size_t p = 0; p < firings_.size(); ++p) {
      terms.emplace_back(firings_[p], static_cast<double>(work_.pipelines[p].tasks.size()));
    }
    return terms;
  }

  template <typename Function>
  void for_each_choice(const Function& function) const {
    std::size_t entry = 0;
    for (std::size_t p = 0; p < work_.pipelines.size(); ++p) {
      for (const TaskWork& task : work_.pipelines[p].tasks) {
        int variable = firsts_[entry++];
        for (const UnitWork& each : task.units) function(each, variable++);
      }
    }
  }

  /// Each task once a firing.
  void add_tasks() {
    std::size_t entry = 0;
    for (std::size_t p = 0; p < work_.pipelines.size(); ++p) {
      for (const TaskWork& task : work_.pipelines[p].tasks) {
        Terms terms = {{firings_[p], -1.0}};
        for (std::size_t i = 0; i < task.units.size(); ++i) {
          terms.emplace_back(firsts_[entry] + static_cast<int>(i), 1.0);
        }
        program_.add_row(std::move(terms), 0.0, 0.0);
        ++entry;
      }
    }
  }

  void add_units() {
    for (UnitId unit = 0; unit < work_.units.size(); ++unit) {
      Terms busy, held;
      for_each_choice([&](const UnitWork& each, int variable) {
        if (each.server_ms[unit] > 0) busy.emplace_back(variable, each.server_ms[unit]);
        if (each.unit == unit) held.emplace_back(variable, each.total_ms);
      });
      program_.add_row(std::move(busy), -LinearProgram::kUnlimited, work_.units[unit].servers);
      if (const auto& slots = work_.units[unit].slots) {
        program_.add_row(std::move(held), -LinearProgram::kUnlimited, *slots);
      }
    }
  }

  void add_power(double most_w) {
    Terms terms;
    for_each_choice([&](const UnitWork& each, int variable) {
      terms.emplace_back(variable, each.energy_j.value_or(0) * 1e3);
    });
    program_.add_row(std::move(terms), -LinearProgram::kUnlimited, most_w);
  }

  const Work& work_;
  LinearProgram program_;
  int next_ = 0;
  std::vector<int> firsts_;   ///< By entry: its first variable.
  std::vector<int> firings_;  ///< By pipeline.
};

}  // namespace

std::optional<Assignment> assign(const Work& work, const std::vector<bool>& urgent,
                                 const Goals& goals) {
  using Cost = Programme::Cost;
  for (const auto fits : {Programme::Urgent::kAll, Programme::Urgent::kAsManyAsFit}) {
    const Programme fastest(work, urgent, goals, Cost::kRate, fits);
    const auto most = fastest.solve();
    if (!most) continue;
    const Assignment fast = fastest.read(*most);
    if (fast.rate_per_ms <= 0) continue;
    Programme cheapest(work, urgent, goals, Cost::kEnergy, fits);
    const bool closed = std::ranges::none_of(
        work.pipelines, [](const PipelineWork& each) { return each.per_ms.has_value(); });
    if (goals.objective == Objective::kEnergy && closed) {
      cheapest.at_least(std::min(goals.min_rate_per_ms.value_or(0.3 * fast.rate_per_ms),
                                 0.999 * fast.rate_per_ms));
    } else {
      cheapest.keep_pipelines(*most);
    }
    const auto least = cheapest.solve();
    return least ? cheapest.read(*least) : fast;
  }
  return std::nullopt;
}

}  // namespace pirt
