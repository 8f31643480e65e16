// Sequences in recordings of ROS: which topics they are, and writing one.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

/// "left=/cam0/image_raw,imu=none". @throws Error{kBadInput} for another key.
[[nodiscard]] SequenceTopics parse_topics(const std::string& text);

/// A recording, as open_recording() takes one.
///
/// Pictures are sensor_msgs/Image or CompressedImage: the two topics, or the one, by name, left
/// first, whose first messages are grey or coloured pictures of 8 bits; frames are those of the
/// left one, and a picture of the right belongs to the frame that is nearest (stamps.h).
/// Calibrations are the sensor_msgs/CameraInfo beside each (camera_info.h); where sensors sit says
/// /tf_static, or what of /tf never changes, of several robots in the left camera's folder, with
/// the IMU as body, or, without one, the left camera; where a pair's projections say otherwise,
/// they count. An IMU may be two topics, of its gyroscope and its accelerometer. Truth is a pose of
/// the body on a topic that is chosen or has truth in its name, else the only
/// geometry_msgs/PoseStamped that is no goal. Stamps are those of messages; where most of a topic's
/// are 0, the times of recording. Of a clock that begins anew the left camera's longest run counts
/// for all. What cannot be used is left out with a warning; how noisy the IMU is no message says:
/// ImuModel's defaults are taken. A calibration that is given says what CameraInfo would, by the
/// topics that it names, else left first; with the IMU as body.
/// @throws Error{kBadInput} naming the topics that there are if one is missing or several could be
/// meant.
[[nodiscard]] Sequence read_recording(const std::filesystem::path& file,
                                      const ReadOptions& options = {});

/// Writes /cam0/image_raw, /cam0/camera_info, ..., /imu0, /truth and /tf_static, in order of time.
/// @param file      .bag, or .db3.
/// @param progress  As write_euroc.
/// @return  False if @p progress said to stop: nothing is left then.
bool write_recording(const Sequence& sequence, const std::filesystem::path& file,
                     const std::function<bool(std::size_t, std::size_t)>& progress = {});

}  // namespace pirt
