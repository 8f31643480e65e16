// Map generation as a workload: what its tensors mean, and those tensors of a robot's own problem.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "workloads/mapping/bundle_adjust.h"
#include "workloads/mapping/specs.h"
#include "workloads/model/workload.h"

namespace pirt::mapping {

/// "bundle_adjust", on the host only (host_function.h): cameras and points moved until the points
/// are seen where they were seen; the focal lengths and distortions are calibrated and stay, as do
/// cameras that are said to be fixed (robot_options()). Inputs seen_by i32 [<=50000,2]
/// (camera, point), pixels f64 [<=50000,2], cameras f64 [<=100,9] and points f64 [<=5000,3], as
/// bal.h has them, fixed u8 [<=100], one a camera, priors f64 [<=100,8], none or one a camera
/// (PosePrior: centre, weight, turn, weight; of weights 0 none), and pairs i32 [<=200,2] (from, to)
/// with relative f64 [<=200,8] (RelativePose: turn, move, weights). Outputs poses f64
/// [<=100,6] (rotation and translation of bal.h), points f64 [<=5000,3], costs f64 [2] (initial and
/// final) and noise f64 [2] (the inliers' RMS and the noise in px), of BundleSummary. Measured with
/// a generated problem of 16 images and 200 points, 1 px of noise, 2 % outliers, the first two
/// cameras fixed where they are. Verified: as the function without tensors to 1e-6 of each output's
/// peak; the cost is that of the outputs, lower than before, and the noise of what lies within 4 px
/// within 5 % of 1 px.
[[nodiscard]] std::vector<Workload> all();

/// bundle_adjust's inputs of a problem.
/// @param fixed  Cameras that stay as they are.
/// @param priors, relative  Where cameras are expected.
/// @throws Error{kBadInput} if it has more of something than there is room for, or a camera is
/// fixed or expected that it has not.
[[nodiscard]] std::vector<Tensor> bundle_inputs(const BalProblem& problem,
                                                std::span<const std::int32_t> fixed,
                                                std::span<const PosePrior> priors = {},
                                                std::span<const RelativePose> relative = {});
/// Moves @p problem's cameras and points to where the outputs have them.
void take_outputs(std::span<const Tensor> outputs, BalProblem& problem);

}  // namespace pirt::mapping
