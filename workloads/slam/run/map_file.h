// The map of a run as a file, so that another run knows the place.
//
// JSON, version 2: {"schema_version": 2, "kind": "pirt_slam_map", "level": true, "points": [[x, y,
// z, cxx, cxy, cxz, cyy, cyz, czz, sx, sy, sz, "64 hex digits"], ...]}. Metres and metres^2 of the
// map's world, s where the point was seen from when it was described; `level` says that z points up
// (the run had an IMU).
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "workloads/slam/filter/state.h"

namespace pirt::slam {

/// Landmarks and map points of a state; of the setup's known map what the state did not take into
/// the filter, if it found it.
[[nodiscard]] std::string map_text(const State& state, const Setup& setup);

/// For Setup::known.
/// @throws Error{kBadInput} naming the file for another version, a number that is none, a
/// covariance that is none, more than 100000 points, or a map without level for a run with an IMU.
[[nodiscard]] std::shared_ptr<const std::vector<MapPoint>> load_map(
    const std::filesystem::path& file, const Setup& setup);

}  // namespace pirt::slam
