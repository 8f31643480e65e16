// A map that changes between queries, as a robot's does: obstacles appear and go.
#pragma once

#include <cstdint>
#include <span>

#include "workloads/planning/grid.h"
#include "workloads/planning/prepared_map.h"

namespace pirt::planning {

/// Keeps a grid and mends what is prepared of it where cells become others. One thread at a time
/// may use it.
class ChangingMap {
 public:
  /// @param radius  As PreparedMap's.
  ChangingMap(Grid grid, double radius);

  /// @param cells  [height, width] of CellState, the grid's from now on. Where the robot may be is
  ///               found anew in the surroundings of those that are others; where these make up
  ///               more than a quarter of the map, all is prepared anew.
  /// @return       Whether any cell became another.
  /// @throws Error{kBadInput} for what is no CellState; the map is then as it was.
  bool become(std::span<const std::uint8_t> cells);

  [[nodiscard]] const PreparedMap& prepared() const { return prepared_; }
  [[nodiscard]] double radius() const { return radius_; }

 private:
  void mark(int row, int column);
  void take_tile(int left, int top);

  Grid grid_;
  double radius_;
  int reach_;                         ///< Cells further from a changed one are as they were.
  int columns_;                       ///< Of tiles.
  std::vector<std::uint8_t> marked_;  ///< By tile.
  PreparedMap prepared_;
};

/// @throws Error{kBadInput} for a value that is no CellState.
void check_cells(std::span<const std::uint8_t> cells);

}  // namespace pirt::planning
