// Shortest paths: published lengths, Dijkstra's on seeded queries, and what every path keeps.
#include "workloads/planning/plan_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "tests/support/data.h"
#include "workloads/base/math/random.h"
#include "workloads/planning/map_files.h"
#include "workloads/planning/plain_search.h"

namespace pirt::planning {
namespace {

/// Rows of '.' (free), '#' (occupied), '?' (unknown).
Grid grid_of(const std::vector<std::string>& rows) {
  Grid grid;
  grid.width = static_cast<int>(rows.front().size());
  grid.height = static_cast<int>(rows.size());
  for (const auto& row : rows) {
    for (const char c : row) {
      grid.cells.push_back(c == '.'   ? CellState::kFree
                           : c == '#' ? CellState::kOccupied
                                      : CellState::kUnknown);
    }
  }
  return grid;
}

Path plan(const Grid& grid, Cell start, Cell goal, double radius = 0) {
  const PreparedMap map(grid, radius);
  return PathPlanner(map).plan(start, goal);
}

/// Each cell passable, each move one that PreparedMap allows, ends and length as they should be.
void expect_valid(const Path& path, const PreparedMap& map, Cell start, Cell goal) {
  ASSERT_EQ(path.status, PathStatus::kFound);
  ASSERT_EQ(path.cells.front(), start);
  ASSERT_EQ(path.cells.back(), goal);
  for (const Cell cell : path.cells) ASSERT_TRUE(map.passable(cell));
  for (std::size_t i = 1; i < path.cells.size(); ++i) {
    const Cell from = path.cells[i - 1];
    const Cell to = path.cells[i];
    ASSERT_EQ(std::max(std::abs(from.x - to.x), std::abs(from.y - to.y)), 1);
    ASSERT_TRUE(map.passable({from.x, to.y}) && map.passable({to.x, from.y})) << "a corner is cut";
  }
  EXPECT_EQ(path.length, path_length(path.cells));
}

TEST(PlanPath, GoesRoundACornerWithoutCuttingIt) {
  // Down, right: the diagonal past '#' would touch its corner.
  const auto path = plan(grid_of({".#", ".."}), {0, 0}, {1, 1});
  EXPECT_EQ(path.length, 2);
  EXPECT_EQ(path.cells, (std::vector<Cell>{{0, 0}, {0, 1}, {1, 1}}));
}

TEST(PlanPath, TakesDiagonalsWhereBothSidesAreFree) {
  EXPECT_DOUBLE_EQ(plan(grid_of({"...", "...", "..."}), {0, 0}, {2, 1}).length,
                   1 + std::numbers::sqrt2);
}

TEST(PlanPath, UnknownCellsAreBlocked) {
  EXPECT_EQ(plan(grid_of({".?."}), {0, 0}, {2, 0}).status, PathStatus::kUnreachable);
}

TEST(PlanPath, SaysWhyThereIsNoPath) {
  const auto grid = grid_of({".#..", "##.."});
  EXPECT_EQ(plan(grid, {1, 0}, {3, 0}).status, PathStatus::kStartBlocked);
  EXPECT_EQ(plan(grid, {3, 0}, {1, 1}).status, PathStatus::kGoalBlocked);
  EXPECT_EQ(plan(grid, {3, 0}, {4, 0}).status, PathStatus::kGoalBlocked) << "outside";
  EXPECT_EQ(plan(grid, {0, 0}, {3, 0}).status, PathStatus::kUnreachable);
  EXPECT_EQ(plan(grid_of({"##", "##"}), {0, 0}, {1, 1}).status, PathStatus::kStartBlocked);
}

TEST(PlanPath, AQueryFromACellToItselfHasLengthZero) {
  const auto path = plan(grid_of({"."}), {0, 0}, {0, 0});
  EXPECT_EQ(path.status, PathStatus::kFound);
  EXPECT_EQ(path.length, 0);
  EXPECT_EQ(path.cells.size(), 1U);
}

TEST(PlanPath, KeepsTheRadiusFromObstaclesByTheDistanceOfCentres) {
  const auto grid = grid_of({".....", ".....", "..#..", ".....", "....."});
  // A radius of 2 allows (0, 2), two cells away, and refuses (1, 1), sqrt(2) away.
  const PreparedMap map(grid, 2);
  EXPECT_TRUE(map.passable({0, 2}));
  EXPECT_TRUE(map.passable({1, 0}));
  EXPECT_FALSE(map.passable({1, 1}));
  EXPECT_FALSE(map.passable({1, 2}));
  EXPECT_TRUE(PreparedMap(grid, 0).passable({1, 2}));
}

TEST(PlanPath, GivesThePublishedLengthsOfMovingAi) {
  PIRT_DATA_OR_SKIP(folder, "maps-movingai");
  const auto grid = read_map(folder / "room-64-64-8.map");
  const auto queries = read_scenario(folder / "room-64-64-8.map.scen", grid);
  ASSERT_EQ(queries.size(), 50U);
  const PreparedMap map(grid, 0);
  PathPlanner planner(map);
  for (const auto& query : queries) {
    const auto path = planner.plan(query.start, query.goal);
    expect_valid(path, map, query.start, query.goal);
    EXPECT_NEAR(path.length, query.optimal_length, 1e-6) << "line " << query.line;
  }
}

/// Cells of random density, in rooms now and then: what jump points get wrong shows in corners.
Grid random_grid(Random& random) {
  Grid grid;
  grid.width = 1 + static_cast<int>(random.below(40));
  grid.height = 1 + static_cast<int>(random.below(40));
  const double density = random.uniform(0, 0.5);
  for (int i = 0; i < grid.width * grid.height; ++i) {
    const bool blocked = random.uniform() < density;
    grid.cells.push_back(!blocked               ? CellState::kFree
                         : random.below(2) == 0 ? CellState::kOccupied
                                                : CellState::kUnknown);
  }
  return grid;
}

Cell random_cell(Random& random, const Grid& grid) {
  return {static_cast<int>(random.below(static_cast<std::uint64_t>(grid.width))),
          static_cast<int>(random.below(static_cast<std::uint64_t>(grid.height)))};
}

Cell random_passable(Random& random, const PreparedMap& map) {
  while (true) {
    const Cell cell = map.cell(random.below(map.size()));
    if (map.passable(cell)) return cell;
  }
}

TEST(PlanPath, EqualsDijkstraOnRandomGrids) {
  Random random(7);
  for (int round = 0; round < 2000; ++round) {
    const auto grid = random_grid(random);
    const double radius = random.below(2) == 0 ? 0 : random.uniform(0, 2.5);
    const PreparedMap map(grid, radius);
    const auto passable = passable_cells(grid, radius);
    PathPlanner planner(map);
    for (int query = 0; query < 10; ++query) {
      const Cell start = random_cell(random, grid);
      const Cell goal = random_cell(random, grid);
      const auto path = planner.plan(start, goal);
      const auto expected =
          plan_plainly(PlainSearch::kDijkstra, grid.width, grid.height, passable, start, goal);
      ASSERT_EQ(path.status, expected.status) << "round " << round;
      if (expected.status != PathStatus::kFound) continue;
      expect_valid(path, map, start, goal);
      ASSERT_NEAR(path.length, expected.length, 1e-9) << "round " << round;
    }
  }
}

TEST(PlanPath, EqualsDijkstraOnTheDepotWithInflation) {
  PIRT_DATA_OR_SKIP(folder, "maps-nav2");
  const auto grid = read_map(folder / "depot.yaml");
  ASSERT_EQ(grid.width, 604);
  ASSERT_EQ(grid.height, 307);
  std::vector<Cell> blocked;
  for (std::size_t i = 0; i < grid.cells.size(); ++i) {
    if (grid.cells[i] == CellState::kFree) continue;
    blocked.push_back({static_cast<int>(i) % grid.width, static_cast<int>(i) / grid.width});
  }
  Random random(1);
  int found = 0;
  for (const double radius : {0.0, 0.22, 0.4, 1.0}) {
    const PreparedMap map(grid, radius);
    const auto passable = passable_cells(grid, radius);
    PathPlanner planner(map);
    for (int query = 0; query < 50; ++query) {
      const Cell start = random_passable(random, map);
      const Cell goal = random_passable(random, map);
      const auto path = planner.plan(start, goal);
      const auto expected =
          plan_plainly(PlainSearch::kDijkstra, grid.width, grid.height, passable, start, goal);
      ASSERT_EQ(path.status, expected.status);
      if (expected.status != PathStatus::kFound) continue;
      ++found;
      expect_valid(path, map, start, goal);
      EXPECT_NEAR(path.length, expected.length, 1e-6);
      // The radius, from the file's cells and not from the inflation: every fifth cell will do.
      for (std::size_t i = 0; i < path.cells.size(); i += 5) {
        const Point at = grid.centre_of(path.cells[i]);
        for (const Cell obstacle : blocked) {
          const Point is = grid.centre_of(obstacle);
          ASSERT_GE(std::hypot(at.x - is.x, at.y - is.y), radius - 1e-9);
        }
      }
    }
  }
  EXPECT_GT(found, 100);
}

TEST(Distances, AreThoseToTheNearestBlockedCell) {
  Random random(3);
  for (int round = 0; round < 200; ++round) {
    const auto grid = random_grid(random);
    const auto squared = squared_distances(grid);
    for (int y = 0; y < grid.height; ++y) {
      for (int x = 0; x < grid.width; ++x) {
        std::int64_t least = kNoObstacle;
        for (int v = 0; v < grid.height; ++v) {
          for (int u = 0; u < grid.width; ++u) {
            if (grid.at({u, v}) == CellState::kFree) continue;
            least = std::min(least, std::int64_t{(x - u) * (x - u) + (y - v) * (y - v)});
          }
        }
        ASSERT_EQ(squared[grid.index({x, y})], least);
      }
    }
  }
}

TEST(Grid, PlacesCellsInTheMapsFrame) {
  Grid grid;
  grid.width = 4;
  grid.height = 2;
  grid.unit = Unit::kMetres;
  grid.resolution = 0.5;
  grid.origin = {-1, 2};
  // The lower left cell is the first of the last row.
  EXPECT_EQ(grid.cell_of({-0.9, 2.1}), (Cell{0, 1}));
  EXPECT_EQ(grid.cell_of({-0.4, 2.6}), (Cell{1, 0}));
  EXPECT_EQ(grid.cell_of({-1.1, 2.1}), (Cell{-1, 1}));
  EXPECT_DOUBLE_EQ(grid.centre_of({0, 1}).x, -0.75);
  EXPECT_DOUBLE_EQ(grid.centre_of({0, 1}).y, 2.25);
  // A quarter turn to the left: what was right of the origin is above it.
  grid.yaw_rad = std::numbers::pi / 2;
  EXPECT_NEAR(grid.centre_of({3, 1}).x, -1.25, 1e-12);
  EXPECT_NEAR(grid.centre_of({3, 1}).y, 3.75, 1e-12);
  EXPECT_EQ(grid.cell_of({-1.25, 3.75}), (Cell{3, 1}));
}

}  // namespace
}  // namespace pirt::planning
