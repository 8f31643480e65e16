// Generated sequences with exact truth: a room, a path through it, cameras and an IMU with the
// faults of real ones. A function of its options: the same seed gives the same bytes.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "workloads/inputs/scene/path.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

struct SceneOptions {
  PathOptions path;
  std::optional<std::uint64_t> room_seed;  ///< Absent: the path's.
  bool stereo = true;
  double camera_rate_hz = 25.0;
  int width = 640, height = 480;  ///< Pixels.
  double noise_levels = 2.0;      ///< Sigma of the pictures' noise, in grey levels.
  double exposure_ms = 5.0;       ///< Motion blur.
  ImuModel imu;
};

/// Throws Error{kBadInput} naming the option that is out of its range.
void check_options(const SceneOptions& options);

/// Pictures are rendered when asked for; the sequence owns all it needs.
[[nodiscard]] Sequence generate_sequence(const SceneOptions& options);

struct FloorMap {
  std::string yaml, pgm;  ///< Of ROS map_server; the image is named map.pgm.
  /// `goal: [x, y]` and `start: [x, y, heading]`, where the robot begins and its left camera looks:
  /// metres in the map's frame and degrees.
  std::string goal_yaml;
};

/// What a planner may use of the generated room: walls and furniture are occupied. The frame is the
/// truth's.
[[nodiscard]] FloorMap floor_map(const SceneOptions& options);

/// Told after each picture how many there are, of how many; false = stop. One thread at a time.
using WriteProgress = std::function<bool(std::size_t written, std::size_t total)>;

/// Writes @p sequence in EuRoC's layout (mav0/...), pictures by @p threads threads.
/// @param folder  Made here; nothing that exists is touched. Its content appears under this name
///                when it is complete.
/// @param extra   Written beside mav0, by name.
/// @return  False if @p progress said to stop: nothing is left then.
/// @throws Error{kBadInput} if it exists and is not empty, or cannot be written.
bool write_euroc(const Sequence& sequence, const std::filesystem::path& folder, int threads,
                 const std::vector<std::pair<std::string, std::string>>& extra = {},
                 const WriteProgress& progress = {});

}  // namespace pirt
