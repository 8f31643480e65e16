// Which topics of a recording are its cameras, its IMU and its truth.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/sequence/recorded_calibration.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

/// Positions of topics.
struct RecordedTopics {
  std::vector<std::size_t> cameras = {};  ///< One or two, left first.
  std::vector<std::size_t> imus = {};     ///< None, one, or gyroscope and accelerometer.
  std::optional<std::size_t> truth = {};
};

/// Those that are chosen, else by their types, their first messages and their names; what is left
/// out is said.
/// @throws Error{kBadInput} naming the topics that there are if one is missing or several could be
/// meant.
[[nodiscard]] RecordedTopics find_topics(const Recording& recording, const ReadOptions& options,
                                         const RecordedCalibrations& calibrations,
                                         std::vector<std::string>& warnings);

}  // namespace pirt
