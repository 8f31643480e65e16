// Bundle adjustment: cameras and points moved until the points are seen where they were seen.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/mapping/bal.h"

namespace pirt::mapping {

/// What an error counts. None: its square; Huber: beyond `loss_px` its size; Cauchy: beyond it the
/// logarithm of its square, so that outliers hardly pull.
enum class Loss : std::uint8_t { kNone, kHuber, kCauchy };
/// "none", "huber", "cauchy".
[[nodiscard]] std::string_view to_string(Loss loss);
/// The names of all, in their order.
[[nodiscard]] std::vector<std::string> loss_names();

/// Where a camera is expected and how it is turned, by somebody who does not look at the pictures.
struct PosePrior {
  std::int32_t camera = 0;
  std::array<double, 3> centre = {};
  double px_per_unit = 0;  ///< An error's weight: as much as one of so many pixels for each unit.
  std::array<double, 3> turn = {};  ///< The camera's rotation, as bal.h has it.
  double px_per_rad = 0;
};

/// How a camera is expected to stand against another, by somebody who does not look at these
/// pictures: one of a pair that is mounted together, or the next one on a robot's way.
struct RelativePose {
  std::int32_t from = 0, to = 0;
  std::array<double, 3> turn = {};  ///< x_to = R(turn) x_from + move, as bal.h has cameras.
  std::array<double, 3> move = {};
  double px_per_rad = 0, px_per_unit = 0;  ///< Weights, as PosePrior's.
};

struct BundleOptions {
  Loss loss = Loss::kNone;
  double loss_px = 1;  ///< > 0; about the noise of the observations.
  int most_iterations = 100;
  /// With more than one, sums are taken in another order from run to run, and the last digits
  /// differ.
  int threads = 1;
  /// f, k1 and k2 of all cameras stay as they are: they are calibrated.
  bool fixed_intrinsics = false;
  /// Cameras that stay as they are. Without two of them the whole may move, turn and be scaled,
  /// which no observation tells.
  std::vector<std::int32_t> fixed_cameras = {};
  /// No loss is taken of them, and no cost of the summary counts them.
  std::vector<PosePrior> priors = {};
  std::vector<RelativePose> relative = {};  ///< Likewise.
  /// Told after each iteration the cost that it reached, in px^2; false = stop.
  std::function<bool(int iteration, double cost)> goes_on = {};
};

/// Of a robot's own map: its cameras are calibrated, and some points are taken for others.
[[nodiscard]] inline BundleOptions robot_options() {
  BundleOptions options;
  options.loss = Loss::kCauchy;
  options.fixed_intrinsics = true;
  return options;
}

/// Costs are half the sum of the squares of the observations' residuals, in px^2, whatever the
/// loss.
struct BundleSummary {
  double initial_cost = 0;
  double final_cost = 0;
  int iterations = 0;
  bool converged = false;  ///< Otherwise the iterations ran out, or it was stopped.
  bool stopped = false;  ///< By `goes_on`: the problem is as it was, and only `iterations` is told.
  std::int64_t free_parameters = 0;
  /// Observations nearer than four times the noise, as their median tells it, to where they should
  /// be: without outliers, all but 0.03 %.
  std::int64_t inliers = 0;
  double inlier_rms_px = 0;  ///< Of their residuals, a coordinate.
  /// The noise of an observation, a coordinate: that RMS over sqrt(1 - parameters / residuals),
  /// since each parameter takes up some of it. 0 if there are no more residuals than parameters.
  double noise_px = 0;
};

/// Moves @p problem's cameras and points to the least cost that Levenberg-Marquardt finds from
/// where they are (Ceres, dense Schur complement; sparse from 400 cameras on).
/// @throws Error{kBadInput} if a point lies in the plane of a camera that sees it, so that there is
/// no first step, and for sizes and indices that do not fit. Nothing is changed then.
[[nodiscard]] BundleSummary bundle_adjust(BalProblem& problem, const BundleOptions& options);

}  // namespace pirt::mapping
