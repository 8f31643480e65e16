// Maps that change: all answers are those of a map that is prepared anew.
#include "workloads/planning/changing_map.h"

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "workloads/base/math/random.h"
#include "workloads/planning/plan_path.h"
#include "workloads/planning/samples.h"
#include "workloads/planning/specs.h"

namespace pirt::planning {
namespace {

Grid random_grid(Random& random, int longest) {
  Grid grid;
  grid.width = 1 + static_cast<int>(random.below(static_cast<std::uint64_t>(longest)));
  grid.height = 1 + static_cast<int>(random.below(static_cast<std::uint64_t>(longest)));
  const double density = random.uniform(0, 0.4);
  for (int i = 0; i < grid.width * grid.height; ++i) {
    grid.cells.push_back(random.uniform() < density ? CellState::kOccupied : CellState::kFree);
  }
  return grid;
}

std::vector<std::uint8_t> bytes_of(const Grid& grid) {
  std::vector<std::uint8_t> bytes;
  for (const CellState cell : grid.cells) bytes.push_back(static_cast<std::uint8_t>(cell));
  return bytes;
}

/// A rectangle of at most @p side cells becomes one state.
void change(Grid& grid, Random& random, int side) {
  const auto below = [&](int bound) {
    return static_cast<int>(random.below(static_cast<std::uint64_t>(bound)));
  };
  const Cell first{below(grid.width), below(grid.height)};
  const int width = 1 + below(std::min(side, grid.width - first.x));
  const int height = 1 + below(std::min(side, grid.height - first.y));
  const auto state = static_cast<CellState>(random.below(3));
  for (int y = first.y; y < first.y + height; ++y) {
    for (int x = first.x; x < first.x + width; ++x) grid.cells[grid.index({x, y})] = state;
  }
}

void expect_same(const PreparedMap& mended, const PreparedMap& anew) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  std::size_t before = 0;
  for (std::size_t i = 0; i < anew.size(); ++i) {
    ASSERT_EQ(mended.passable(anew.cell(i)), anew.passable(anew.cell(i))) << i;
    if (!anew.passable(anew.cell(i))) continue;
    for (int d = 0; d < kDirections; ++d) ASSERT_EQ(mended.jump(i, d), anew.jump(i, d)) << i;
    ASSERT_EQ(mended.connected(anew.cell(i), anew.cell(before)),
              anew.connected(anew.cell(i), anew.cell(before)));
    before = i;
  }
  EXPECT_EQ(mended.nearest_passable({0, 0}), anew.nearest_passable({0, 0}));
}

TEST(ChangingMap, AnswersAsOneThatIsPreparedAnew) {
  Random random(11);
  for (int round = 0; round < 60; ++round) {
    Grid grid = random_grid(random, 150);
    const double radius = random.below(3) == 0 ? 0 : random.uniform(0, 4);
    ChangingMap map(grid, radius);
    for (int i = 0; i < 6; ++i) {
      for (std::uint64_t n = random.below(4) + 1; n > 0; --n) change(grid, random, 12);
      map.become(bytes_of(grid));
      expect_same(map.prepared(), PreparedMap(grid, radius));
      if (HasFatalFailure()) FAIL() << "round " << round << ", change " << i;
    }
  }
}

TEST(ChangingMap, ADoorThatClosesDividesAndOneThatOpensJoins) {
  Grid grid;
  grid.width = 101, grid.height = 20;
  grid.cells.assign(2020, CellState::kFree);
  for (int y = 0; y < 20; ++y) grid.cells[grid.index({50, y})] = CellState::kOccupied;
  ChangingMap map(grid, 0);
  PathPlanner planner(map.prepared());
  EXPECT_EQ(planner.plan({0, 0}, {100, 0}).status, PathStatus::kUnreachable);
  grid.cells[grid.index({50, 19})] = CellState::kFree;
  EXPECT_TRUE(map.become(bytes_of(grid)));
  const Path path = planner.plan({0, 19}, {100, 19});
  EXPECT_EQ(path.status, PathStatus::kFound);
  EXPECT_EQ(path.length, 100);
  EXPECT_FALSE(map.become(bytes_of(grid))) << "nothing is another";
  grid.cells[grid.index({50, 19})] = CellState::kUnknown;
  EXPECT_TRUE(map.become(bytes_of(grid)));
  EXPECT_EQ(planner.plan({0, 19}, {100, 19}).status, PathStatus::kUnreachable);
}

TEST(ChangingMap, StaysAsItWasWhereACellIsNone) {
  Random random(2);
  Grid grid = random_grid(random, 40);
  ChangingMap map(grid, 0);
  auto cells = bytes_of(grid);
  cells.front() = cells.front() == 0 ? 1 : 0;
  cells.back() = 7;
  EXPECT_NE(test::bad_input([&] { map.become(cells); }), "");
  expect_same(map.prepared(), PreparedMap(grid, 0));
  EXPECT_FALSE(map.become(bytes_of(grid)));
}

// What plan_path is measured with: neighbouring frames differ by what appears and what goes, and a
// robot of 40 cm finds a way in each.
TEST(PlanSamples, ChangeAsTheMapOfARobotDoes) {
  constexpr int kPersonCells = 8 * 8;
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    for (int frame = 0; frame < kFrames; ++frame) {
      const PlanSample sample = plan_sample(seed, frame);
      const PlanSample next = plan_sample(seed, (frame + 1) % kFrames);
      int differ = 0;
      for (std::size_t i = 0; i < sample.grid.cells.size(); ++i) {
        differ += sample.grid.cells[i] != next.grid.cells[i] ? 1 : 0;
      }
      EXPECT_GT(differ, 0);
      EXPECT_LE(differ, 2 * kPersonCells);
      const PreparedMap map(sample.grid, 0.4);
      EXPECT_EQ(PathPlanner(map).plan(sample.start, sample.goal).status, PathStatus::kFound)
          << "seed " << seed << ", frame " << frame;
    }
  }
}

}  // namespace
}  // namespace pirt::planning
