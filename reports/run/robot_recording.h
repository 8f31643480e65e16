// `pirt run-robot --record`: what a run came to as an MCAP recording that Foxglove shows.
#pragma once

#include <string>

#include "reports/run/robot_report.h"

namespace pirt {

/// The bytes of the file. Its messages are JSON, at the stamps of the frames:
///
/// | topic | schema | what |
/// |---|---|---|
/// | /pose | foxglove.PoseInFrame | of the body in `world`, of each frame that has one |
/// | /tf | foxglove.FrameTransform | the same, and of `world` in `map`, where the robot planned |
/// | /trajectory | foxglove.PosesInFrame | all of the way, once, at its beginning |
/// | /path | foxglove.PosesInFrame | what was planned, in `map`, at most once a second |
/// | /detections | foxglove.ImageAnnotations | what the described pictures show, in their pixels |
/// | /latency | pirt.Latency | from a frame's arrival to its pose |
///
/// @source  https://docs.foxglove.dev/docs/sdk/schemas
[[nodiscard]] std::string robot_recording(const RobotRun& run);

}  // namespace pirt
