#include "scheduler/mix/dependency_order.h"

#include <algorithm>
#include <functional>
#include <queue>

#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// What is not placed has a predecessor that is not either, so that walking back meets a cycle.
std::vector<std::size_t> cycle_of(const std::vector<std::vector<std::size_t>>& predecessors,
                                  const std::vector<bool>& placed) {
  std::vector<std::size_t> path;
  std::vector<bool> on_path(placed.size(), false);
  auto at = static_cast<std::size_t>(std::ranges::find(placed, false) - placed.begin());
  while (!on_path[at]) {
    on_path[at] = true;
    path.push_back(at);
    at = *std::ranges::find_if(predecessors[at], [&](std::size_t each) { return !placed[each]; });
  }
  path.erase(path.begin(), std::ranges::find(path, at));
  path.push_back(at);
  std::ranges::reverse(path);
  return path;
}

}  // namespace

DependencyOrder dependency_order(const std::vector<std::vector<std::size_t>>& predecessors) {
  const std::size_t count = predecessors.size();
  std::vector<std::vector<std::size_t>> successors(count);
  std::vector<std::size_t> pending(count);
  std::priority_queue<std::size_t, std::vector<std::size_t>, std::greater<>> ready;
  for (std::size_t i = 0; i < count; ++i) {
    pending[i] = predecessors[i].size();
    if (pending[i] == 0) ready.push(i);
    for (const std::size_t each : predecessors[i]) successors[each].push_back(i);
  }
  DependencyOrder result;
  std::vector<bool> placed(count, false);
  while (!ready.empty()) {
    const std::size_t first = ready.top();
    ready.pop();
    placed[first] = true;
    result.order.push_back(first);
    for (const std::size_t each : successors[first]) {
      if (--pending[each] == 0) ready.push(each);
    }
  }
  if (result.order.size() < count) result.cycle = cycle_of(predecessors, placed);
  return result;
}

std::string cycle_text(const std::vector<std::size_t>& cycle,
                       const std::vector<std::string>& names) {
  std::vector<std::string> loop;
  for (const std::size_t each : cycle) loop.push_back(names[each]);
  return "the tasks wait for each other: " + join(loop, " -> ");
}

}  // namespace pirt
