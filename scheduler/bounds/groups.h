// What linear programmes over a Work have in common: groups of tasks, each with a variable for
// every unit that may serve it.
#pragma once

#include <cstddef>
#include <set>
#include <vector>

#include "scheduler/bounds/bounds.h"
#include "scheduler/bounds/linear_program.h"

namespace pirt {

/// Tasks of a pipeline that some solution treats alike, since their average is one as good: of a
/// graph of many tasks the bounds have few such.
struct TaskGroup {
  std::size_t pipeline = 0;
  const std::vector<UnitWork>* units = nullptr;
  double tasks = 1;
  std::set<std::size_t> after = {};  ///< Groups; only where their order counts.
  int first = 0;                     ///< Variable: what each task has on the first unit.

  /// What each task has on all units together.
  void add_whole(double coefficient, LinearProgram::Terms& terms) const {
    for (std::size_t i = 0; i < units->size(); ++i) {
      terms.emplace_back(first + static_cast<int>(i), coefficient);
    }
  }
};

/// Gives the groups their variables, from 0 on.
void number_variables(std::vector<TaskGroup>& groups);

/// By rising variable. @param function  void(const TaskGroup&, const UnitWork&, int variable).
template <typename Function>
void for_each_choice(const std::vector<TaskGroup>& groups, const Function& function) {
  for (const TaskGroup& group : groups) {
    int variable = group.first;
    for (const UnitWork& choice : *group.units) function(group, choice, variable++);
  }
}

/// Server time and slots of each unit: at most its own in @p time_ms and what @p slack adds to it.
/// @param amount  By pipeline: what a variable of 1 stands for there, of each task.
void add_capacity(const Work& work, const std::vector<TaskGroup>& groups,
                  const std::vector<double>& amount, double time_ms,
                  const LinearProgram::Terms& slack, LinearProgram& program);

}  // namespace pirt
