#include "workloads/planning/changing_map.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "workloads/base/error.h"

namespace pirt::planning {
namespace {

constexpr int kTile = 32;  ///< Side of what is found anew at a time, in cells.

int tiles(int cells) { return (cells + kTile - 1) / kTile; }

/// What no radius exceeds that is not all of the map.
int reach_of(const Grid& grid, double radius) {
  const double most = std::max(grid.width, grid.height);
  return static_cast<int>(std::min(std::ceil(radius / grid.resolution), most)) + 1;
}

Grid part_of(const Grid& grid, const CellBox& box) {
  Grid part;
  part.width = box.end.x - box.begin.x;
  part.height = box.end.y - box.begin.y;
  part.resolution = grid.resolution;
  part.cells.reserve(static_cast<std::size_t>(part.width) * static_cast<std::size_t>(part.height));
  for (int y = box.begin.y; y < box.end.y; ++y) {
    const auto row = grid.cells.begin() + static_cast<std::ptrdiff_t>(grid.index({box.begin.x, y}));
    part.cells.insert(part.cells.end(), row, row + part.width);
  }
  return part;
}

}  // namespace

void check_cells(std::span<const std::uint8_t> cells) {
  const auto wrong = std::ranges::find_if(cells, [](std::uint8_t cell) {
    return cell > static_cast<std::uint8_t>(CellState::kUnknown);
  });
  if (wrong == cells.end()) return;
  throw_bad_input(fmt::format("a cell of the grid is {}; 0 is free, 1 occupied and 2 unknown",
                              static_cast<int>(*wrong)));
}

ChangingMap::ChangingMap(Grid grid, double radius)
    : grid_(std::move(grid)),
      radius_(radius),
      reach_(reach_of(grid_, radius)),
      columns_(tiles(grid_.width)),
      marked_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(tiles(grid_.height))),
      prepared_(grid_, radius) {}

bool ChangingMap::become(std::span<const std::uint8_t> cells) {
  static_assert(sizeof(CellState) == 1);
  const auto width = static_cast<std::size_t>(grid_.width);
  const auto row_of = [&](int y) { return static_cast<std::size_t>(y) * width; };
  const auto differs = [&](std::size_t begin, std::size_t size) {
    return std::memcmp(grid_.cells.data() + begin, cells.data() + begin, size) != 0;
  };
  std::ranges::fill(marked_, std::uint8_t{0});
  bool any = false;
  for (int y = 0; y < grid_.height; ++y) {
    if (!differs(row_of(y), width)) continue;
    check_cells(cells.subspan(row_of(y), width));
    any = true;
    for (int x = 0; x < grid_.width; ++x) {
      if (differs(row_of(y) + static_cast<std::size_t>(x), 1)) mark(y, x);
    }
  }
  if (!any) return false;
  std::memcpy(grid_.cells.data(), cells.data(), grid_.cells.size());
  if (4 * std::ranges::count(marked_, 1) > std::ssize(marked_)) {
    prepared_ = PreparedMap(grid_, radius_);
    return true;
  }
  for (std::size_t i = 0; i < marked_.size(); ++i) {
    const int tile = static_cast<int>(i);
    if (marked_[i] != 0) take_tile(tile % columns_ * kTile, tile / columns_ * kTile);
  }
  prepared_.settle();
  return true;
}

/// The tiles where the robot may be no more, or again, for a cell that is another.
void ChangingMap::mark(int row, int column) {
  const auto last = [](int at, int reach, int size) {
    return std::min(at + reach, size - 1) / kTile;
  };
  for (int y = std::max(row - reach_, 0) / kTile; y <= last(row, reach_, grid_.height); ++y) {
    for (int x = std::max(column - reach_, 0) / kTile; x <= last(column, reach_, grid_.width);
         ++x) {
      marked_[static_cast<std::size_t>(y * columns_ + x)] = 1;
    }
  }
}

/// From the cells of its surroundings, which are all that count within it.
void ChangingMap::take_tile(int left, int top) {
  const CellBox tile{{left, top},
                     {std::min(left + kTile, grid_.width), std::min(top + kTile, grid_.height)}};
  const CellBox around{
      {std::max(tile.begin.x - reach_, 0), std::max(tile.begin.y - reach_, 0)},
      {std::min(tile.end.x + reach_, grid_.width), std::min(tile.end.y + reach_, grid_.height)}};
  const auto passable = passable_cells(part_of(grid_, around), radius_);
  const int width = around.end.x - around.begin.x;
  std::vector<std::uint8_t> inside;
  for (int y = tile.begin.y; y < tile.end.y; ++y) {
    const auto row = passable.begin() + std::ptrdiff_t{y - around.begin.y} * width +
                     (tile.begin.x - around.begin.x);
    inside.insert(inside.end(), row, row + (tile.end.x - tile.begin.x));
  }
  prepared_.change(tile, inside);
}

}  // namespace pirt::planning
