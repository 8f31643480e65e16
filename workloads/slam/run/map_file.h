// The map of a run as a file, so that another run knows the place.
//
// JSON, version 1: {"schema_version": 1, "kind": "pirt_slam_map", "level": true, "points": [[x, y,
// z, cxx, cxy, cxz, cyy, cyz, czz, "64 hex digits"], ...]}. Metres and metres^2 of the map's world;
// `level` says that z points up (the run had an IMU).
#pragma once

#include <filesystem>
#include <string>

#include "workloads/slam/filter/state.h"

namespace pirt::slam {

/// Landmarks and map points of a state.
[[nodiscard]] std::string map_text(const State& state, const Setup& setup);

/// A state to start from: it knows the map, and seeks its place in it.
/// @throws Error{kBadInput} naming the file for another version, a number that is none, a
/// covariance that is none, more than 100000 points, or a map without level for a run with an IMU.
[[nodiscard]] State load_map(const std::filesystem::path& file, const Setup& setup);

}  // namespace pirt::slam
