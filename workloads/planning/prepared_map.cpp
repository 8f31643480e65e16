#include "workloads/planning/prepared_map.h"

#include <algorithm>
#include <cassert>
#include <limits>

namespace pirt::planning {
namespace {

constexpr unsigned bit(int direction) { return 1U << direction; }

/// The cells of a box in the order in which those that lie in @p step come before, rows whole, so
/// that memory is read in its order.
template <typename Visit>
void visit_against(GridMove step, const CellBox& box, const Visit& visit) {
  for (int row = box.begin.y; row < box.end.y; ++row) {
    const int y = step.y > 0 ? box.begin.y + box.end.y - 1 - row : row;
    if (step.x > 0) {
      for (int x = box.end.x - 1; x >= box.begin.x; --x) visit(Cell{x, y});
    } else {
      for (int x = box.begin.x; x < box.end.x; ++x) visit(Cell{x, y});
    }
  }
}

/// One step more than from the next cell.
std::int16_t one_more(int jump) {
  return static_cast<std::int16_t>(jump > 0 ? jump + 1 : jump - 1);
}

Cell moved(Cell cell, GridMove step) { return {cell.x + step.x, cell.y + step.y}; }

/// A straight jump looks at the lines on both sides of its own.
void mark_beside(std::vector<std::uint8_t>& lines, int line) {
  for (int i = std::max(line - 1, 0); i <= std::min(line + 1, static_cast<int>(lines.size()) - 1);
       ++i) {
    lines[static_cast<std::size_t>(i)] = 1;
  }
}

/// Lines that are marked, which they then are no more: the first, and the first beyond.
template <typename Visit>
void for_each_run(std::vector<std::uint8_t>& lines, const Visit& visit) {
  for (auto at = lines.begin(); (at = std::find(at, lines.end(), 1)) != lines.end();) {
    const auto end = std::find(at, lines.end(), 0);
    visit(static_cast<int>(at - lines.begin()), static_cast<int>(end - lines.begin()));
    std::fill(at, end, std::uint8_t{0});
    at = end;
  }
}

/// Runs of passable cells that touch, joined to regions.
class Regions {
 public:
  std::int32_t add() {
    parents_.push_back(static_cast<std::int32_t>(parents_.size()));
    return parents_.back();
  }
  std::int32_t root(std::int32_t run) {
    while (parent(run) != run) run = parent(run) = parent(parent(run));
    return run;
  }
  void join(std::int32_t a, std::int32_t b) { parent(root(a)) = root(b); }

 private:
  std::int32_t& parent(std::int32_t run) { return parents_[static_cast<std::size_t>(run)]; }
  std::vector<std::int32_t> parents_;
};

}  // namespace

PreparedMap::PreparedMap(const Grid& grid, double radius)
    : PreparedMap(grid.width, grid.height, passable_cells(grid, radius)) {}

PreparedMap::PreparedMap(int width, int height, std::span<const std::uint8_t> passable)
    : width_(width),
      height_(height),
      passable_((static_cast<std::size_t>(width) + 2) * (static_cast<std::size_t>(height) + 2)),
      regions_(passable.size()),
      jumps_(passable.size()),
      stale_rows_(static_cast<std::size_t>(height), 1),
      stale_columns_(static_cast<std::size_t>(width), 1) {
  change({{0, 0}, {width, height}}, passable);
  settle();
  for (int direction = 4; direction < kDirections; ++direction) measure_diagonal(direction);
  diagonals_known_ = true;
}

void PreparedMap::change(const CellBox& box, std::span<const std::uint8_t> passable) {
  assert(contains(box.begin) && box.end.x <= width_ && box.end.y <= height_);
  const auto width = static_cast<std::size_t>(box.end.x - box.begin.x);
  for (int y = box.begin.y; y < box.end.y; ++y) {
    const auto from = passable.subspan(static_cast<std::size_t>(y - box.begin.y) * width, width);
    std::uint8_t* const to = passable_.data() + (framed({box.begin.x, y}) - passable_.data());
    for (std::size_t x = 0; x < width; ++x) {
      if (to[x] == from[x]) continue;
      to[x] = from[x];
      mark_beside(stale_rows_, y);
      mark_beside(stale_columns_, box.begin.x + static_cast<int>(x));
    }
  }
}

void PreparedMap::settle() {
  for_each_run(stale_rows_, [this](int begin, int end) {
    for (const int direction : {0, 2}) measure_straight(direction, {{0, begin}, {width_, end}});
  });
  for_each_run(stale_columns_, [this](int begin, int end) {
    for (const int direction : {1, 3}) measure_straight(direction, {{begin, 0}, {end, height_}});
  });
  label_regions();
  diagonals_known_ = false;
}

/// By straight moves alone: a diagonal one has two of them beside it. Row by row in runs of
/// passable cells, each joined to those of the row above that it touches.
void PreparedMap::label_regions() {
  struct Run {
    int begin, end;
    std::int32_t region;
  };
  Regions regions;
  regions.add();  // 0 = blocked
  std::vector<Run> runs;
  std::vector<std::size_t> rows = {0};
  std::size_t above = 0;
  for (int y = 0; y < height_; ++y) {
    const std::size_t first = runs.size();
    const std::uint8_t* row = framed({0, y});
    const std::uint8_t* const end = row + width_;
    for (const std::uint8_t* at = row; (at = std::find(at, end, std::uint8_t{1})) != end;) {
      const std::uint8_t* const stop = std::find(at, end, std::uint8_t{0});
      const Run run{static_cast<int>(at - row), static_cast<int>(stop - row), regions.add()};
      while (above < first && runs[above].end <= run.begin) ++above;
      for (std::size_t i = above; i < first && runs[i].begin < run.end; ++i) {
        regions.join(runs[i].region, run.region);
      }
      runs.push_back(run);
      at = stop;
    }
    above = first;
    rows.push_back(runs.size());
  }
  std::ranges::fill(regions_, 0);
  for (int y = 0; y < height_; ++y) {
    for (std::size_t i = rows[static_cast<std::size_t>(y)];
         i < rows[static_cast<std::size_t>(y) + 1]; ++i) {
      const auto begin = regions_.begin() + static_cast<std::ptrdiff_t>(index({runs[i].begin, y}));
      std::fill(begin, begin + (runs[i].end - runs[i].begin), regions.root(runs[i].region));
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

/// @param box  Whole lines in the direction.
void PreparedMap::measure_straight(int direction, const CellBox& box) {
  const auto d = static_cast<std::size_t>(direction);
  const std::ptrdiff_t next = framed_step(kGridMoves[d]);
  const std::ptrdiff_t side = framed_step(kGridMoves[(d + 1) % 4]);
  const std::ptrdiff_t next_jump = std::ptrdiff_t{kGridMoves[d].y} * width_ + kGridMoves[d].x;
  visit_against(kGridMoves[d], box, [&](Cell at) {
    const std::uint8_t* free = framed(at);
    auto* jump = &jumps_[index(at)];
    if (free[0] == 0 || free[next] == 0) {
      (*jump)[d] = 0;
      return;
    }
    // forced(): beside the next cell a wall has ended.
    const bool forced =
        (free[next + side] != 0 && free[side] == 0) || (free[next - side] != 0 && free[-side] == 0);
    (*jump)[d] = forced ? std::int16_t{1} : one_more(jump[next_jump][d]);
  });
}

void PreparedMap::measure_diagonal(int direction) {
  const auto d = static_cast<std::size_t>(direction);
  const auto parts = parts_of(direction);
  const auto a = static_cast<std::size_t>(parts[0]);
  const auto b = static_cast<std::size_t>(parts[1]);
  const std::ptrdiff_t next = framed_step(kGridMoves[d]);
  const std::ptrdiff_t beside_a = framed_step(kGridMoves[a]);
  const std::ptrdiff_t beside_b = framed_step(kGridMoves[b]);
  const std::ptrdiff_t next_jump = std::ptrdiff_t{kGridMoves[d].y} * width_ + kGridMoves[d].x;
  visit_against(kGridMoves[d], {{0, 0}, {width_, height_}}, [&](Cell at) {
    const std::uint8_t* free = framed(at);
    auto* jump = &jumps_[index(at)];
    if (free[0] == 0 || free[next] == 0 || free[beside_a] == 0 || free[beside_b] == 0) {
      (*jump)[d] = 0;
      return;
    }
    const auto& beyond = jump[next_jump];
    (*jump)[d] = beyond[a] > 0 || beyond[b] > 0 ? std::int16_t{1} : one_more(beyond[d]);
  });
}

/// What measure_diagonal would have found, step by step.
int PreparedMap::walk(std::size_t from, int direction) const {
  const auto d = static_cast<std::size_t>(direction);
  const auto parts = parts_of(direction);
  const auto a = static_cast<std::size_t>(parts[0]);
  const auto b = static_cast<std::size_t>(parts[1]);
  const std::ptrdiff_t next = framed_step(kGridMoves[d]);
  const std::ptrdiff_t beside_a = framed_step(kGridMoves[a]);
  const std::ptrdiff_t beside_b = framed_step(kGridMoves[b]);
  const std::ptrdiff_t next_jump = std::ptrdiff_t{kGridMoves[d].y} * width_ + kGridMoves[d].x;
  const std::uint8_t* free = framed(cell(from));
  const auto* jump = &jumps_[from];
  int steps = 0;
  if (free[0] == 0) return 0;
  while (free[next] != 0 && free[beside_a] != 0 && free[beside_b] != 0) {
    ++steps;
    free += next;
    jump += next_jump;
    if ((*jump)[a] > 0 || (*jump)[b] > 0) return steps;
  }
  return -steps;
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
