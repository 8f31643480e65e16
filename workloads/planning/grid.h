// An occupancy grid and its place in the world. Files of grids: map_files.h.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace pirt::planning {

enum class CellState : std::uint8_t { kFree, kOccupied, kUnknown };
/// "free", "occupied", "unknown".
[[nodiscard]] std::string_view to_string(CellState state);

/// Column and row, both from 0; row 0 is the first of the file, the picture's top.
struct Cell {
  int x = 0;
  int y = 0;
  friend bool operator==(const Cell&, const Cell&) = default;
};

/// A point in the frame of the map, in its unit.
struct Point {
  double x = 0;
  double y = 0;
};
[[nodiscard]] inline double distance(Point a, Point b) { return std::hypot(a.x - b.x, a.y - b.y); }

/// More is no map of a robot's surroundings; jump distances have 16 bits.
inline constexpr int kLongestSide = 32'767;
inline constexpr std::int64_t kMostCells = std::int64_t{1} << 25;

/// What a coordinate of the map's frame counts.
enum class Unit : std::uint8_t {
  kCells,  ///< x = column, y = row: maps of Moving AI, which have no size.
  kMetres,
};
/// "cells", "m".
[[nodiscard]] std::string_view to_string(Unit unit);

struct Grid {
  int width = 0;
  int height = 0;
  std::vector<CellState> cells;  ///< [height, width]
  Unit unit = Unit::kCells;
  double resolution = 1;  ///< Side of a cell, in `unit`.
  Point origin;           ///< Of unit kMetres: the lower left corner of the lower left cell.
  double yaw_rad = 0;     ///< Counter-clockwise turn of the grid around `origin`.

  [[nodiscard]] bool contains(Cell cell) const {
    return cell.x >= 0 && cell.y >= 0 && cell.x < width && cell.y < height;
  }
  [[nodiscard]] std::size_t index(Cell cell) const {
    return static_cast<std::size_t>(cell.y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(cell.x);
  }
  [[nodiscard]] CellState at(Cell cell) const { return cells[index(cell)]; }

  /// The cell that @p point lies in, which may be outside; of unit kCells the nearest one.
  /// Coordinates beyond the range of int end at its border.
  [[nodiscard]] Cell cell_of(Point point) const;
  [[nodiscard]] Point centre_of(Cell cell) const;
};

/// For each cell the squared distance between its centre and that of the nearest cell that is not
/// free, in cells; kNoObstacle if there is none. What lies outside the grid is no obstacle.
/// @return  [height, width]
/// @source  Felzenszwalb, Huttenlocher: Distance Transforms of Sampled Functions, 2012; in
/// integers, so that the result is exact.
[[nodiscard]] std::vector<std::int64_t> squared_distances(const Grid& grid);
inline constexpr std::int64_t kNoObstacle = std::int64_t{1} << 40;

/// Where the centre of a disc of @p radius (in the grid's unit, >= 0) may be: free cells whose
/// centre is no closer to the centre of an occupied or unknown cell.
/// @return  [height, width], 1 = may be, 0 = blocked.
[[nodiscard]] std::vector<std::uint8_t> passable_cells(const Grid& grid, double radius);

}  // namespace pirt::planning
