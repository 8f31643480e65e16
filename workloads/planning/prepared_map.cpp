#include "workloads/planning/prepared_map.h"

#include <limits>

namespace pirt::planning {
namespace {

constexpr unsigned bit(int direction) { return 1U << direction; }

/// The cells of a grid in the order in which those that lie in @p step come before.
template <typename Visit>
void visit_against(GridMove step, int width, int height, const Visit& visit) {
  for (int row = 0; row < height; ++row) {
    const int y = step.y > 0 ? height - 1 - row : row;
    for (int column = 0; column < width; ++column) {
      visit(Cell{step.x > 0 ? width - 1 - column : column, y});
    }
  }
}

Cell moved(Cell cell, GridMove step) { return {cell.x + step.x, cell.y + step.y}; }

/// One step more than from the next cell.
std::int16_t one_more(int jump) {
  return static_cast<std::int16_t>(jump > 0 ? jump + 1 : jump - 1);
}

}  // namespace

PreparedMap::PreparedMap(const Grid& grid, double radius)
    : PreparedMap(grid.width, grid.height, passable_cells(grid, radius)) {}

PreparedMap::PreparedMap(int width, int height, std::span<const std::uint8_t> passable)
    : width_(width), height_(height), jumps_(passable.size()) {
  label_regions(passable);
  for (int direction = 0; direction < 4; ++direction) measure_straight(direction);
  for (int direction = 4; direction < kDirections; ++direction) measure_diagonal(direction);
}

/// By straight moves alone: a diagonal one has two of them beside it.
void PreparedMap::label_regions(std::span<const std::uint8_t> passable) {
  regions_.assign(passable.size(), 0);
  std::int32_t regions = 0;
  std::vector<std::size_t> open;
  for (std::size_t seed = 0; seed < passable.size(); ++seed) {
    if (passable[seed] == 0 || regions_[seed] != 0) continue;
    regions_[seed] = ++regions;
    open.assign(1, seed);
    while (!open.empty()) {
      const Cell from = cell(open.back());
      open.pop_back();
      for (std::size_t d = 0; d < 4; ++d) {
        const Cell to = moved(from, kGridMoves[d]);
        if (!contains(to) || passable[index(to)] == 0 || regions_[index(to)] != 0) continue;
        regions_[index(to)] = regions;
        open.push_back(index(to));
      }
    }
  }
}

unsigned PreparedMap::forced(Cell cell, int direction) const {
  const GridMove step = kGridMoves[static_cast<std::size_t>(direction)];
  unsigned directions = 0;
  for (const int side : {(direction + 1) % 4, (direction + 3) % 4}) {
    const Cell beside = moved(cell, kGridMoves[static_cast<std::size_t>(side)]);
    if (!passable(beside) || passable({beside.x - step.x, beside.y - step.y})) continue;
    // The diagonal between the two is d + 4 of the one that the other follows.
    const int before = side == (direction + 1) % 4 ? direction : side;
    directions |= bit(side) | bit(before + 4);
  }
  return directions;
}

void PreparedMap::measure_straight(int direction) {
  const auto d = static_cast<std::size_t>(direction);
  visit_against(kGridMoves[d], width_, height_, [&](Cell at) {
    const Cell next = moved(at, kGridMoves[d]);
    if (!passable(at) || !passable(next)) return;
    jumps_[index(at)][d] =
        forced(next, direction) != 0 ? std::int16_t{1} : one_more(jumps_[index(next)][d]);
  });
}

void PreparedMap::measure_diagonal(int direction) {
  const auto d = static_cast<std::size_t>(direction);
  const auto parts = parts_of(direction);
  const auto a = static_cast<std::size_t>(parts[0]);
  const auto b = static_cast<std::size_t>(parts[1]);
  visit_against(kGridMoves[d], width_, height_, [&](Cell at) {
    const Cell next = moved(at, kGridMoves[d]);
    if (!passable(at) || !passable(next) || !passable(moved(at, kGridMoves[a])) ||
        !passable(moved(at, kGridMoves[b]))) {
      return;
    }
    const auto& beyond = jumps_[index(next)];
    const bool jump_point = beyond[a] > 0 || beyond[b] > 0;
    jumps_[index(at)][d] = jump_point ? std::int16_t{1} : one_more(beyond[d]);
  });
}

std::optional<Cell> PreparedMap::nearest_passable(Cell to) const {
  std::optional<Cell> best;
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (std::size_t i = 0; i < regions_.size(); ++i) {
    if (regions_[i] == 0) continue;
    const Cell at = cell(i);
    const std::int64_t x = std::int64_t{at.x} - to.x;
    const std::int64_t y = std::int64_t{at.y} - to.y;
    if (x * x + y * y >= least) continue;
    least = x * x + y * y;
    best = at;
  }
  return best;
}

}  // namespace pirt::planning
