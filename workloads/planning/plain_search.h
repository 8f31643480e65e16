// Shortest paths without any preparation: what plan_path is checked and measured against.
#pragma once

#include "workloads/planning/plan_path.h"

namespace pirt::planning {

/// A* over the cells with the octile estimate, or Dijkstra's algorithm (no estimate): a binary heap
/// of (f, cell), lazily updated; moves as PreparedMap has them.
/// @param passable  [height, width] of passable_cells().
enum class PlainSearch : std::uint8_t { kAStar, kDijkstra };
[[nodiscard]] Path plan_plainly(PlainSearch search, int width, int height,
                                std::span<const std::uint8_t> passable, Cell start, Cell goal);

}  // namespace pirt::planning
