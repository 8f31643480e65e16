#include "workloads/planning/plain_search.h"

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <limits>
#include <numbers>
#include <queue>
#include <utility>

namespace pirt::planning {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

struct Search {
  int width, height;
  std::span<const std::uint8_t> passable;
  std::vector<double> lengths = {};
  std::vector<std::size_t> parents = {};

  [[nodiscard]] std::size_t index(Cell cell) const {
    return static_cast<std::size_t>(cell.y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(cell.x);
  }
  [[nodiscard]] Cell cell(std::size_t at) const {
    const auto row = static_cast<std::size_t>(width);
    return {static_cast<int>(at % row), static_cast<int>(at / row)};
  }
  [[nodiscard]] bool free(Cell cell) const {
    return cell.x >= 0 && cell.y >= 0 && cell.x < width && cell.y < height &&
           passable[index(cell)] != 0;
  }
  [[nodiscard]] bool can_step(Cell from, GridMove step) const {
    return free({from.x + step.x, from.y + step.y}) && free({from.x + step.x, from.y}) &&
           free({from.x, from.y + step.y});
  }
};

double octile(Cell a, Cell b) {
  const int x = std::abs(a.x - b.x);
  const int y = std::abs(a.y - b.y);
  return std::max(x, y) + (std::numbers::sqrt2 - 1) * std::min(x, y);
}

bool run(Search& search, PlainSearch kind, Cell start, Cell goal) {
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  std::vector<bool> closed(search.passable.size());
  search.lengths.assign(search.passable.size(), kFar);
  search.parents.resize(search.passable.size());
  const auto estimate = [&](Cell from) {
    return kind == PlainSearch::kAStar ? octile(from, goal) : 0;
  };
  search.lengths[search.index(start)] = 0;
  open.emplace(estimate(start), search.index(start));
  while (!open.empty()) {
    const std::size_t at = open.top().second;
    open.pop();
    if (closed[at]) continue;
    closed[at] = true;
    if (at == search.index(goal)) return true;
    const Cell from = search.cell(at);
    for (std::size_t d = 0; d < kDirections; ++d) {
      if (!search.can_step(from, kGridMoves[d])) continue;
      const Cell to{from.x + kGridMoves[d].x, from.y + kGridMoves[d].y};
      const double length = search.lengths[at] + (d < 4 ? 1 : std::numbers::sqrt2);
      if (length >= search.lengths[search.index(to)]) continue;
      search.lengths[search.index(to)] = length;
      search.parents[search.index(to)] = at;
      open.emplace(length + estimate(to), search.index(to));
    }
  }
  return false;
}

}  // namespace

Path plan_plainly(PlainSearch kind, int width, int height, std::span<const std::uint8_t> passable,
                  Cell start, Cell goal) {
  Search search{width, height, passable};
  Path path;
  if (!search.free(start)) return path.status = PathStatus::kStartBlocked, path;
  if (!search.free(goal)) return path.status = PathStatus::kGoalBlocked, path;
  if (!run(search, kind, start, goal)) return path;
  path.status = PathStatus::kFound;
  for (std::size_t at = search.index(goal); at != search.index(start); at = search.parents[at]) {
    path.cells.push_back(search.cell(at));
  }
  path.cells.push_back(start);
  std::ranges::reverse(path.cells);
  path.length = path_length(path.cells);
  return path;
}

}  // namespace pirt::planning
