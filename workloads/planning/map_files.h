// Files of occupancy grids and of queries on them: map_server's of ROS, and the benchmark sets of
// Moving AI. What does not have the form of its format is refused with its place.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "workloads/planning/grid.h"

namespace pirt::planning {

/// A grid of map_server: YAML that names a picture (PGM, PNG) beside it.
///
/// A pixel's occupancy is how dark it is, 0 to 1 (`negate` turns it round): above `occupied_thresh`
/// a cell is occupied, below `free_thresh` free, between them unknown; in mode `raw` the pixel says
/// it in percent, and above 100 it is unknown. In mode `trinary` grey 205, which map_saver writes
/// for unknown, stays unknown whatever the thresholds: many maps are saved with a `free_thresh`
/// (0.25) that would make it free; where `negate` is set, that is grey 50. A pixel that is
/// transparent is unknown in mode `scale`, as map_server has it, and also in `trinary`, where
/// map_server mixes alpha into the grey and may call it free; one that is partly so is free there
/// only if it is both with and without alpha. `raw` knows no alpha.
/// @throws Error{kBadInput} "file:line: ..." for the YAML; naming the picture if it is damaged, has
/// more than 8 bits a channel or more than kMostCells pixels.
/// @source https://wiki.ros.org/map_server, nav2_map_server/src/map_io.cpp
[[nodiscard]] Grid read_ros_map(const std::filesystem::path& yaml);

/// A grid of Moving AI: `type octile`, its height and width, and rows of characters; `.`, `G` and
/// `S` (swamp) can be entered, `@`, `O`, `T` (trees) and `W` (water) cannot.
/// @throws Error{kBadInput} "file:line: ..."
/// @source https://movingai.com/benchmarks/formats.html
[[nodiscard]] Grid read_movingai_map(const std::filesystem::path& file);

/// One of the two, by the file's name: .yaml and .yml, or .map.
/// @throws Error{kBadInput} as they do, and for other names.
[[nodiscard]] Grid read_map(const std::filesystem::path& file);

/// A query of Moving AI's scenarios.
struct ScenarioQuery {
  int line = 0;  ///< Of the file, from 1.
  Cell start, goal;
  double optimal_length = 0;  ///< As published, in cells.
  double rounding = 0;        ///< How far that may be off; 0 with the 8 decimals of newer files.
};

/// @throws Error{kBadInput} "file:line: ..." for what is no scenario, or is one of a map of another
/// size than @p grid.
/// @source https://movingai.com/benchmarks/formats.html, version 1
[[nodiscard]] std::vector<ScenarioQuery> read_scenario(const std::filesystem::path& file,
                                                       const Grid& grid);

}  // namespace pirt::planning
