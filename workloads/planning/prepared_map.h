// A grid made ready for queries: inflated by the robot's radius, with jump distances and connected
// regions.
//
// Moves go to the 8 neighbours, diagonally only past two cells that can both be entered (no corner
// is cut, as in Moving AI's published lengths).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "workloads/planning/grid.h"

namespace pirt::planning {

/// The directions of moves: 0 to 3 straight, 4 to 7 diagonal; d + 4 lies between d and d + 1.
inline constexpr int kDirections = 8;
struct GridMove {
  int x, y;
};
inline constexpr std::array<GridMove, kDirections> kGridMoves = {
    {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
/// The straight directions that a diagonal one is made of.
[[nodiscard]] constexpr std::array<int, 2> parts_of(int diagonal) {
  return {diagonal - 4, (diagonal - 3) % 4};
}

/// Cells of a grid: the first, and the first beyond.
struct CellBox {
  Cell begin, end;
};

/// Between changes any thread may call it. Takes 21 bytes a cell.
///
/// @source Harabor, Grastien: Online Graph Pruning for Pathfinding on Grid Maps, AAAI 2011, and
/// Improving Jump Point Search, ICAPS 2014 (jump distances computed beforehand: JPS+), in the form
/// that cuts no corners: only straight moves have forced neighbours.
class PreparedMap {
 public:
  /// @param radius  Of the robot, in the grid's unit, >= 0: passable_cells().
  PreparedMap(const Grid& grid, double radius);
  /// @param passable  [height, width] of passable_cells().
  PreparedMap(int width, int height, std::span<const std::uint8_t> passable);

  /// What is passable within @p box from now on; settle() has to follow.
  /// @param passable  [height, width] of the box, which lies inside.
  void change(const CellBox& box, std::span<const std::uint8_t> passable);
  /// After one or more changes: all answers are those of a map prepared anew. Regions and the lines
  /// that changed are measured at once; what follows from these for diagonals is from now on found
  /// by each query on its way, since between two changes it asks for little of it.
  void settle();

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] std::size_t size() const { return regions_.size(); }
  [[nodiscard]] bool contains(Cell cell) const {
    return cell.x >= 0 && cell.y >= 0 && cell.x < width_ && cell.y < height_;
  }
  [[nodiscard]] std::size_t index(Cell cell) const {
    return static_cast<std::size_t>(cell.y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(cell.x);
  }
  [[nodiscard]] Cell cell(std::size_t index) const {
    const auto width = static_cast<std::size_t>(width_);
    return {static_cast<int>(index % width), static_cast<int>(index / width)};
  }

  /// Whether the robot may be there; false outside.
  [[nodiscard]] bool passable(Cell cell) const { return contains(cell) && *framed(cell) != 0; }
  /// Whether a path leads from one to the other; both passable.
  [[nodiscard]] bool connected(Cell a, Cell b) const {
    return regions_[index(a)] == regions_[index(b)];
  }
  /// Steps from @p cell in @p direction to the next jump point, as a positive number; without one,
  /// minus the steps that can be made.
  [[nodiscard]] int jump(std::size_t cell, int direction) const {
    return direction < 4 || diagonals_known_ ? jumps_[cell][static_cast<std::size_t>(direction)]
                                             : walk(cell, direction);
  }
  /// The directions, as bits, in which an optimal path may go on from @p cell when it came by a
  /// straight move in @p direction and a wall beside it has ended; 0 = this is no jump point.
  [[nodiscard]] unsigned forced(Cell cell, int direction) const;

  /// The passable cell nearest to @p to by the distance between centres, the first of the file
  /// among equals; none if there is none.
  [[nodiscard]] std::optional<Cell> nearest_passable(Cell to) const;

 private:
  /// In passable_, which has a frame of blocked cells around it.
  [[nodiscard]] std::ptrdiff_t framed_step(GridMove step) const {
    return std::ptrdiff_t{step.y} * (width_ + 2) + step.x;
  }
  [[nodiscard]] const std::uint8_t* framed(Cell cell) const {
    return passable_.data() + framed_step({cell.x + 1, cell.y + 1});
  }
  void label_regions();
  void measure_straight(int direction, const CellBox& box);
  void measure_diagonal(int direction);
  [[nodiscard]] int walk(std::size_t cell, int direction) const;

  int width_, height_;
  std::vector<std::uint8_t> passable_;
  std::vector<std::int32_t> regions_;  ///< 0 = blocked.
  std::vector<std::array<std::int16_t, kDirections>> jumps_;
  bool diagonals_known_ = false;  ///< Those of jumps_ hold.
  /// Whose straight jumps do not hold: lines that changed, and those beside them.
  std::vector<std::uint8_t> stale_rows_, stale_columns_;
};

}  // namespace pirt::planning
