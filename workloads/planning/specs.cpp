#include "workloads/planning/specs.h"

namespace pirt::planning {
namespace {

// What a robot on a map can be: far beyond any, and near enough that nothing overflows.
constexpr Range kFarM{-1e7, 1e7}, kFarCell{-1e6, 1e6}, kTurned{-1e6, 1e6};
constexpr Range kSpeed{-100, 100}, kTurnRate{-1000, 1000}, kRadius{0, 1e4}, kCellM{1e-6, 1e6};

constexpr std::int64_t kCells = std::int64_t{kMapWidth} * kMapHeight;

Workload make(const char* name, const char* text) {
  Workload w;
  w.name = w.kernel = name;
  w.description = text;
  w.tags = {"planning"};
  w.frames = kFrames;
  return w;
}

}  // namespace

std::vector<Workload> specs() {
  std::vector<Workload> all;
  all.push_back(make("plan_path", "a shortest path on an occupancy grid of 640x320 cells"));
  all[0].inputs = {{"grid", Element::kU8, {kMapHeight, kMapWidth}},
                   {"radius", Element::kF64, {1}, false, {kRadius}},
                   {"start", Element::kI32, {2}, false, {kFarCell}},
                   {"goal", Element::kI32, {2}, false, {kFarCell}}};
  all[0].outputs = {{"status", Element::kI32, {1}},
                    {"path", Element::kI32, {kCells, 2}, true},
                    {"length", Element::kF64, {1}}};
  all.push_back(
      make("avoid_obstacles", "a velocity command on a window of 160x160 cells, among people"));
  all[1].inputs = {
      {"window", Element::kU8, {kWindowSide, kWindowSide}},
      {"place", Element::kF64, {3}, false, {kFarM, kFarM, kCellM}},
      {"robot", Element::kF64, {5}, false, {kFarM, kFarM, kTurned, kSpeed, kTurnRate}},
      {"target", Element::kF64, {2}, false, {kFarM}},
      {"moving", Element::kF64, {kMostMoving, 5}, true, {kFarM, kFarM, kSpeed, kSpeed, kRadius}}};
  all[1].outputs = {{"command", Element::kF64, {2}}};
  return all;
}

}  // namespace pirt::planning
