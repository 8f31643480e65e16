#include "workloads/planning/grid.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <span>

namespace pirt::planning {
namespace {

int to_int(double value) {
  constexpr double kLimit = std::numeric_limits<int>::max();
  return static_cast<int>(std::isnan(value) ? -kLimit : std::clamp(value, -kLimit, kLimit));
}

/// Lower envelope of the parabolas (x - i)^2 + f[i], sampled at x = 0 .. n - 1.
class Envelope {
 public:
  explicit Envelope(std::size_t longest) : vertices_(longest), values_(longest) {}

  void transform(std::span<std::int64_t> f) {
    std::size_t count = 0;
    const auto size = static_cast<std::int64_t>(f.size());
    for (std::int64_t i = 0; i < size; ++i) {
      const std::int64_t value = f[static_cast<std::size_t>(i)];
      if (value >= kNoObstacle) continue;
      while (count > 0 && !needed(count, i, value)) --count;
      vertices_[count] = i;
      values_[count++] = value;
    }
    if (count == 0) return;
    std::size_t k = 0;
    for (std::int64_t x = 0; x < size; ++x) {
      while (k + 1 < count && at(k + 1, x) <= at(k, x)) ++k;
      f[static_cast<std::size_t>(x)] = at(k, x);
    }
  }

 private:
  [[nodiscard]] std::int64_t at(std::size_t k, std::int64_t x) const {
    return (x - vertices_[k]) * (x - vertices_[k]) + values_[k];
  }

  /// Whether the last of @p count parabolas is below its neighbours somewhere once that of @p i
  /// comes after it: it begins to be the lowest before the new one overtakes it. Intersections of a
  /// and b are at (b^2 + f(b) - a^2 - f(a)) / (2b - 2a), compared crosswise.
  [[nodiscard]] bool needed(std::size_t count, std::int64_t i, std::int64_t value) const {
    if (count < 2) return true;
    const auto lift = [this](std::size_t k) { return vertices_[k] * vertices_[k] + values_[k]; };
    const std::int64_t last = vertices_[count - 1];
    const std::int64_t before = vertices_[count - 2];
    const std::int64_t begins = lift(count - 1) - lift(count - 2);
    const std::int64_t ends = i * i + value - lift(count - 1);
    return begins * (i - last) < ends * (last - before);
  }

  std::vector<std::int64_t> vertices_, values_;
};

}  // namespace

std::string_view to_string(CellState state) {
  switch (state) {
    case CellState::kFree:
      return "free";
    case CellState::kOccupied:
      return "occupied";
    case CellState::kUnknown:
      break;
  }
  return "unknown";
}

std::string_view to_string(Unit unit) { return unit == Unit::kCells ? "cells" : "m"; }

Cell Grid::cell_of(Point point) const {
  if (unit == Unit::kCells) return {to_int(std::round(point.x)), to_int(std::round(point.y))};
  const double x = point.x - origin.x;
  const double y = point.y - origin.y;
  const double along = std::cos(yaw_rad) * x + std::sin(yaw_rad) * y;
  const double up = std::cos(yaw_rad) * y - std::sin(yaw_rad) * x;
  return {to_int(std::floor(along / resolution)), to_int(height - 1 - std::floor(up / resolution))};
}

Point Grid::centre_of(Cell cell) const {
  if (unit == Unit::kCells) return {static_cast<double>(cell.x), static_cast<double>(cell.y)};
  const double along = (cell.x + 0.5) * resolution;
  const double up = (height - cell.y - 0.5) * resolution;
  return {origin.x + std::cos(yaw_rad) * along - std::sin(yaw_rad) * up,
          origin.y + std::sin(yaw_rad) * along + std::cos(yaw_rad) * up};
}

std::vector<std::int64_t> squared_distances(const Grid& grid) {
  const auto width = static_cast<std::size_t>(grid.width);
  const auto height = static_cast<std::size_t>(grid.height);
  std::vector<std::int64_t> squared(grid.cells.size());
  std::ranges::transform(grid.cells, squared.begin(), [](CellState state) {
    return state == CellState::kFree ? kNoObstacle : std::int64_t{0};
  });
  Envelope envelope(std::max(width, height));
  for (std::size_t y = 0; y < height; ++y) {
    envelope.transform(std::span(squared).subspan(y * width, width));
  }
  std::vector<std::int64_t> column(height);
  for (std::size_t x = 0; x < width; ++x) {
    for (std::size_t y = 0; y < height; ++y) column[y] = squared[y * width + x];
    envelope.transform(column);
    for (std::size_t y = 0; y < height; ++y) squared[y * width + x] = column[y];
  }
  return squared;
}

std::vector<std::uint8_t> passable_cells(const Grid& grid, double radius) {
  assert(radius >= 0);
  const auto squared = squared_distances(grid);
  const double cells = radius / grid.resolution;
  // What is as far as the radius but for the rounding of the division is far enough.
  const double least = cells * cells * (1 - 1e-9);
  std::vector<std::uint8_t> passable(squared.size());
  std::ranges::transform(squared, passable.begin(), [least](std::int64_t distance) {
    return static_cast<std::uint8_t>(distance > 0 && static_cast<double>(distance) >= least);
  });
  return passable;
}

}  // namespace pirt::planning
