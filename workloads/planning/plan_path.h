// The shortest path of a robot on a prepared map.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "workloads/planning/prepared_map.h"

namespace pirt::planning {

enum class PathStatus : std::uint8_t {
  kFound,
  kStartBlocked,  ///< The start is an obstacle, unknown, too close to one, or outside.
  kGoalBlocked,
  kUnreachable,  ///< No path leads from one to the other.
};
/// "found", "start_blocked", "goal_blocked", "unreachable".
[[nodiscard]] std::string_view to_string(PathStatus status);

struct Path {
  PathStatus status = PathStatus::kUnreachable;
  std::vector<Cell> cells;  ///< From start to goal, each a neighbour of the one before.
  double length = 0;        ///< Between the centres of cells, in cells.
};

/// Straight moves plus sqrt(2) times the diagonal ones.
[[nodiscard]] double path_length(std::span<const Cell> cells);

/// Finds shortest paths by A* over jump points. It keeps the memory of its search (24 bytes a
/// cell) from query to query, so that a query costs what it visits and nothing for the rest of the
/// map. One thread at a time may use it; many may share a map.
class PathPlanner {
 public:
  /// @param map  Outlives the planner.
  explicit PathPlanner(const PreparedMap& map);

  /// Both ends may be any cells.
  [[nodiscard]] Path plan(Cell start, Cell goal);
  /// Jump points taken from the queue by the last query.
  [[nodiscard]] std::int64_t expanded() const { return expanded_; }

 private:
  /// Lengths in integers, so that those of equal length are equal: 2^-37 of a cell.
  using Length = std::int64_t;
  struct Node {
    Length g = 0;
    std::uint32_t parent = 0;
    std::uint32_t query = 0;   ///< What is here is of this query; otherwise as if not here.
    std::uint8_t pending = 0;  ///< Directions, as bits, that are to be followed from here,
    std::uint8_t done = 0;     ///< and that were.
  };
  struct Entry {
    Length f;
    std::uint32_t cell;
  };

  void expand(std::uint32_t from);
  void follow(std::uint32_t from, int direction);
  void reach(std::uint32_t from, int direction, int steps);
  [[nodiscard]] Length estimate(Cell from) const;
  void push(Entry entry);
  Entry pop();
  [[nodiscard]] std::vector<Cell> trace() const;

  const PreparedMap* map_;
  std::vector<Node> nodes_;
  std::vector<Entry> heap_;
  std::uint32_t query_ = 0;
  Cell goal_;
  std::int64_t expanded_ = 0;
};

}  // namespace pirt::planning
