#include "workloads/planning/plan_path.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <numbers>

namespace pirt::planning {
namespace {

/// The longest path fits in 63 bits. A diagonal's rounding is 2^-38 at most, which can mistake
/// which of two paths is shorter only beyond 2e5 diagonal moves, and then by less than 1e-6 cells.
constexpr std::int64_t kStraight = std::int64_t{1} << 37;
constexpr std::int64_t kDiagonal = 194'368'031'998;  // sqrt(2) * 2^37

constexpr unsigned kAllDirections = (1U << kDirections) - 1;

int sign(int value) { return (value > 0) - (value < 0); }

}  // namespace

std::string_view to_string(PathStatus status) {
  switch (status) {
    case PathStatus::kFound:
      return "found";
    case PathStatus::kStartBlocked:
      return "start_blocked";
    case PathStatus::kGoalBlocked:
      return "goal_blocked";
    case PathStatus::kUnreachable:
      break;
  }
  return "unreachable";
}

double path_length(std::span<const Cell> cells) {
  std::int64_t straight = 0;
  std::int64_t diagonal = 0;
  for (std::size_t i = 1; i < cells.size(); ++i) {
    const bool both = cells[i].x != cells[i - 1].x && cells[i].y != cells[i - 1].y;
    ++(both ? diagonal : straight);
  }
  return static_cast<double>(straight) + std::numbers::sqrt2 * static_cast<double>(diagonal);
}

PathPlanner::PathPlanner(const PreparedMap& map) : map_(&map), nodes_(map.size()) {}

Path PathPlanner::plan(Cell start, Cell goal) {
  expanded_ = 0;
  Path path;
  if (!map_->passable(start)) return path.status = PathStatus::kStartBlocked, path;
  if (!map_->passable(goal)) return path.status = PathStatus::kGoalBlocked, path;
  if (!map_->connected(start, goal)) return path.status = PathStatus::kUnreachable, path;

  if (++query_ == 0) {  // The count has gone round: what is here could pass for this query's.
    std::ranges::fill(nodes_, Node{});
    query_ = 1;
  }
  goal_ = goal;
  heap_.clear();
  const auto first = static_cast<std::uint32_t>(map_->index(start));
  const auto last = static_cast<std::uint32_t>(map_->index(goal));
  nodes_[first] = {0, first, query_, kAllDirections, 0};
  push({estimate(start), first});
  while (true) {
    const std::uint32_t cell = pop().cell;
    if (cell == last) break;
    if (nodes_[cell].pending != 0) expand(cell);
  }
  path.status = PathStatus::kFound;
  path.cells = trace();
  path.length = path_length(path.cells);
  return path;
}

void PathPlanner::expand(std::uint32_t from) {
  ++expanded_;
  Node& node = nodes_[from];
  unsigned directions = node.pending;
  node.done = static_cast<std::uint8_t>(node.done | directions);
  node.pending = 0;
  for (; directions != 0; directions &= directions - 1) {
    follow(from, std::countr_zero(directions));
  }
}

/// To the next jump point in @p direction, and before it to the goal, or to the cell of a diagonal
/// from which the goal is straight ahead.
void PathPlanner::follow(std::uint32_t from, int direction) {
  const GridMove step = kGridMoves[static_cast<std::size_t>(direction)];
  const Cell at = map_->cell(from);
  const int jump = map_->jump(from, direction);
  const int x = goal_.x - at.x;
  const int y = goal_.y - at.y;
  if (sign(x) == step.x && sign(y) == step.y) {
    const int steps = direction < 4 ? std::abs(x + y) : std::min(std::abs(x), std::abs(y));
    if (steps <= std::abs(jump)) {
      reach(from, direction, steps);
      // A jump point beyond is on no shorter way to the goal.
      if (direction < 4) return;
    }
  }
  if (jump > 0) reach(from, direction, jump);
}

void PathPlanner::reach(std::uint32_t from, int direction, int steps) {
  const GridMove step = kGridMoves[static_cast<std::size_t>(direction)];
  const Cell at = map_->cell(from);
  const Cell to{at.x + step.x * steps, at.y + step.y * steps};
  const auto cell = static_cast<std::uint32_t>(map_->index(to));
  const Length g = nodes_[from].g + (direction < 4 ? kStraight : kDiagonal) * steps;
  Node& node = nodes_[cell];
  const bool known = node.query == query_;
  if (known && g > node.g) return;

  // Onwards as it came; a diagonal also along its parts, a straight move round corners.
  unsigned onwards = 1U << direction;
  if (direction < 4) {
    onwards |= map_->forced(to, direction);
  } else {
    for (const int part : parts_of(direction)) onwards |= 1U << part;
  }
  if (known && g == node.g) {
    // As long as another path to here: follow what that one did not.
    onwards &= ~unsigned{node.done} & ~unsigned{node.pending};
    if (onwards == 0) return;
    node.pending = static_cast<std::uint8_t>(node.pending | onwards);
  } else {
    node = {g, from, query_, static_cast<std::uint8_t>(onwards), 0};
  }
  push({node.g + estimate(to), cell});
}

/// The length without obstacles, which no path is shorter than.
PathPlanner::Length PathPlanner::estimate(Cell from) const {
  const int x = std::abs(goal_.x - from.x);
  const int y = std::abs(goal_.y - from.y);
  return kStraight * std::max(x, y) + (kDiagonal - kStraight) * std::min(x, y);
}

void PathPlanner::push(Entry entry) {
  heap_.push_back(entry);
  std::ranges::push_heap(heap_, std::ranges::greater{}, &Entry::f);
}

PathPlanner::Entry PathPlanner::pop() {
  std::ranges::pop_heap(heap_, std::ranges::greater{}, &Entry::f);
  const Entry entry = heap_.back();
  heap_.pop_back();
  return entry;
}

std::vector<Cell> PathPlanner::trace() const {
  std::vector<Cell> cells = {goal_};
  auto at = static_cast<std::uint32_t>(map_->index(goal_));
  while (nodes_[at].parent != at) {
    at = nodes_[at].parent;
    const Cell to = map_->cell(at);
    while (cells.back() != to) {
      const Cell back = cells.back();
      cells.push_back({back.x + sign(to.x - back.x), back.y + sign(to.y - back.y)});
    }
  }
  std::ranges::reverse(cells);
  return cells;
}

}  // namespace pirt::planning
