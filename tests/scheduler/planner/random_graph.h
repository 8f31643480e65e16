// Random task graphs for tests of the planners.
#pragma once

#include <algorithm>
#include <string>

#include "scheduler/planner/graph.h"
#include "workloads/base/math/random.h"

namespace pirt::test {

/// Every task but the first has one to three earlier predecessors; costs are 1 to 20 ms, each
/// unit's its own, and transfers have a mean of ccr times 10.5 ms.
inline TaskGraph random_graph(std::uint64_t seed, std::size_t tasks, UnitId units, double ccr) {
  Random random(seed);
  TaskGraph graph;
  for (std::size_t task = 0; task < tasks; ++task) {
    graph.names.push_back("t" + std::to_string(task));
    auto& row = graph.costs.emplace_back();
    for (UnitId unit = 0; unit < units; ++unit) row.push_back(from_ms(random.uniform(1, 20)));
    const std::size_t wanted = task == 0 ? 0 : 1 + random.below(std::min<std::size_t>(task, 3));
    std::vector<std::size_t> from;
    while (from.size() < wanted) {
      const std::size_t each = random.below(task);
      if (std::ranges::find(from, each) == from.end()) from.push_back(each);
    }
    for (const std::size_t each : from) {
      graph.edges.push_back(
          {.from = each, .to = task, .delay = from_ms(random.uniform(0, 21 * ccr))});
    }
  }
  return graph;
}

}  // namespace pirt::test
