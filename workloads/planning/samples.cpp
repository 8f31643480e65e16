#include "workloads/planning/samples.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "workloads/base/math/random.h"
#include "workloads/planning/specs.h"

namespace pirt::planning {
namespace {

constexpr double kCellM = 0.05;
constexpr int kRoom = 160;     // cells: 8 m
constexpr int kHalfDoor = 12;  // 1.2 m in all
/// Half of the way across a room that is kept free: a robot of 40 cm and what queries vary.
constexpr int kHalfAisle = 20;
constexpr int kVaried = 10;
constexpr int kRooms = (kMapWidth / kRoom) * (kMapHeight / kRoom);
constexpr int kPresent = 3;  ///< Obstacles at a time that come and go.

Grid free_grid(int width, int height) {
  Grid grid;
  grid.width = width;
  grid.height = height;
  grid.unit = Unit::kMetres;
  grid.resolution = kCellM;
  grid.cells.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                    CellState::kFree);
  return grid;
}

void fill(Grid& grid, Cell first, int width, int height, CellState state) {
  for (int y = first.y; y < first.y + height; ++y) {
    for (int x = first.x; x < first.x + width; ++x) grid.cells[grid.index({x, y})] = state;
  }
}

int between(Random& random, int low, int high) {
  return low + static_cast<int>(random.below(static_cast<std::uint64_t>(high - low) + 1));
}

/// Somewhere in a square of @p side cells that begins at @p first.
void add_box(Grid& grid, Random& random, Cell first, int side) {
  const int width = between(random, 8, side / 2);
  const int height = between(random, 8, side / 2);
  const CellState state = random.below(4) == 0 ? CellState::kUnknown : CellState::kOccupied;
  fill(grid,
       {first.x + between(random, 0, side - width), first.y + between(random, 0, side - height)},
       width, height, state);
}

Cell middle_of(int room) {
  const int columns = kMapWidth / kRoom;
  return {room % columns * kRoom + kRoom / 2, room / columns * kRoom + kRoom / 2};
}

Cell near_middle(Random& random, int room) {
  const Cell middle = middle_of(room);
  const int x = middle.x + between(random, -kVaried, kVaried);
  return {x, middle.y + between(random, -kVaried, kVaried)};
}

Grid rooms(std::uint64_t seed) {
  Random random(derive_seed(seed, "plan_path map"));
  Grid grid = free_grid(kMapWidth, kMapHeight);
  for (int top = 0; top < kMapHeight; top += kRoom) {
    for (int left = 0; left < kMapWidth; left += kRoom) {
      // A wall to the left and one above, each with a door unless it is the map's border.
      fill(grid, {left, top}, 2, kRoom, CellState::kOccupied);
      fill(grid, {left, top}, kRoom, 2, CellState::kOccupied);
      const int door = kRoom / 2 - kHalfDoor;
      if (left > 0) fill(grid, {left, top + door}, 2, 2 * kHalfDoor, CellState::kFree);
      if (top > 0) fill(grid, {left + door, top}, 2 * kHalfDoor, 2, CellState::kFree);
      const int corner = kRoom / 2 - kHalfAisle;
      for (const int x : {left + 2, left + kRoom - corner}) {
        for (const int y : {top + 2, top + kRoom - corner})
          add_box(grid, random, {x, y}, corner - 2);
      }
    }
  }
  fill(grid, {kMapWidth - 2, 0}, 2, kMapHeight, CellState::kOccupied);
  fill(grid, {0, kMapHeight - 2}, kMapWidth, 2, CellState::kOccupied);
  return grid;
}

/// Somebody who stands in the way between a room's middle and one of its doors, to the side, so
/// that there is room to pass; nowhere near where queries begin and end.
void add_person(Grid& grid, std::uint64_t seed, int number) {
  constexpr int kSide = 8;
  Random random(
      derive_seed(hash_u64(seed, static_cast<std::uint64_t>(number)), "plan_path obstacle"));
  const Cell middle = middle_of(static_cast<int>(random.below(kRooms)));
  const bool far = random.below(2) == 0;
  const bool left = random.below(2) == 0;
  const int along = between(random, 2 * kHalfAisle - kVaried, kRoom / 2 - kHalfAisle);
  const int first = far ? along : -along - kSide;
  const int beside = left ? -kHalfAisle : kHalfAisle - kSide;
  const bool across = random.below(2) == 0;
  fill(grid, {middle.x + (across ? first : beside), middle.y + (across ? beside : first)}, kSide,
       kSide, CellState::kOccupied);
}

}  // namespace

PlanSample plan_sample(std::uint64_t seed, int query) {
  Random random(derive_seed(hash_u64(seed, static_cast<std::uint64_t>(query)), "plan_path query"));
  const auto from = random.below(kRooms);
  const auto to = (from + 1 + random.below(kRooms - 1)) % kRooms;
  PlanSample sample{.grid = rooms(seed), .start = {}, .goal = {}};
  for (int i = 0; i < kPresent; ++i) add_person(sample.grid, seed, (query + i) % kFrames);
  sample.start = near_middle(random, static_cast<int>(from));
  sample.goal = near_middle(random, static_cast<int>(to));
  return sample;
}

AvoidSample avoid_sample(std::uint64_t seed, int moment) {
  constexpr int kPeople = 12;
  constexpr double kSideM = kWindowSide * kCellM;
  Random random(derive_seed(hash_u64(seed, static_cast<std::uint64_t>(moment)), "avoid_obstacles"));
  AvoidSample sample{
      .window = free_grid(kWindowSide, kWindowSide), .robot = {}, .moving = {}, .target = {}};
  const int corner = kWindowSide / 2 - 2 * kHalfAisle;
  for (const int x : {0, kWindowSide - corner}) {
    for (const int y : {0, kWindowSide - corner}) {
      add_box(sample.window, random, {x, y}, corner);
    }
  }
  const Point middle{kSideM / 2, kSideM / 2};
  sample.robot = {.position = middle,
                  .heading_rad = random.uniform(-std::numbers::pi, std::numbers::pi),
                  .speed_mps = random.uniform(0, 0.8),
                  .turn_rate_rps = random.uniform(-0.5, 0.5)};
  while (sample.moving.size() < kPeople) {
    const Point at{random.uniform(0, kSideM), random.uniform(0, kSideM)};
    if (distance(at, middle) < 2) continue;
    const double towards = random.uniform(-std::numbers::pi, std::numbers::pi);
    const double speed = random.uniform(0.3, 1.0);
    sample.moving.push_back(
        {at, {speed * std::cos(towards), speed * std::sin(towards)}, random.uniform(0.2, 0.3)});
  }
  const double bearing = random.uniform(-std::numbers::pi, std::numbers::pi);
  sample.target = {middle.x + 3 * std::cos(bearing), middle.y + 3 * std::sin(bearing)};
  return sample;
}

}  // namespace pirt::planning
