// An IMU of a recording: one topic, or its gyroscope's and its accelerometer's.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {

/// One of @p topics, or the gyroscope's and the accelerometer's; none of none. What a topic does
/// not have its covariance says, or, where there are several, that the first messages all have
/// zeros. Of those that nobody chose one that cannot be read is left out with a warning.
/// @throws Error{kBadInput} with the remedy if several could be meant, one half is missing, or none
/// can be read.
[[nodiscard]] std::vector<std::size_t> imu_among(const Recording& recording,
                                                 const std::vector<std::size_t>& topics,
                                                 bool are_chosen,
                                                 std::vector<std::string>& warnings);

/// Puts the accelerometer's, between two of them, to the gyroscope's.
/// @param turn  From the accelerometer's axes to the gyroscope's.
void join_samples(std::vector<ImuSample>& samples, const std::vector<ImuSample>& accels,
                  const Eigen::Matrix3d& turn);

}  // namespace pirt
