// imu_propagate: the state moves on by what the IMU measured.
#pragma once

#include <span>

#include "workloads/slam/filter/state.h"

namespace pirt::slam {

/// Moves state and covariance from state.time to @p until.
///
/// @param samples  Rising stamps; those within the time are integrated, the one after it
///                 interpolates. Where they end or leave a gap, the last goes on, with the noise of
///                 an unknown motion. Without an IMU (setup.imu absent) they are not read: turn and
///                 velocity go on, with noise.
/// @source  Trapezoids on SO(3); the error's transition as in Barrau and Bonnabel, TAC 2017, with
/// biases.
void imu_propagate(State& state, const Setup& setup, std::span<const ImuSample> samples,
                   Nanos until);

}  // namespace pirt::slam
