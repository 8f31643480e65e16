// The algebra of the filter: rows of a linear measurement, the Kalman update, and taking states in
// and out. Knows nothing of cameras.
#pragma once

#include <span>
#include <vector>

#include "workloads/slam/filter/state.h"

namespace pirt::slam {

/// One piece of a row block: columns [at, at + width) of the error state.
struct JacobianPart {
  int at = 0;
  Eigen::MatrixXd values;  ///< [rows, width]
};

/// residual = sum of parts * error + noise, noise of variance sigma^2 in each row.
struct RowBlock {
  Eigen::VectorXd residual;
  std::vector<JacobianPart> parts;
  double sigma = 1.0;
};

/// What is to be expected of a block's residual, without the noise. f64 [rows,rows]
[[nodiscard]] Eigen::MatrixXd predicted_covariance(const State& state, const RowBlock& block);

/// Squared Mahalanobis distance of a block's residual.
[[nodiscard]] double innovation(const State& state, const RowBlock& block);

/// The 95 % quantile of chi^2 with @p degrees degrees of freedom (1 to 200 and beyond, to 1 %).
/// @source  Wilson and Hilferty, The distribution of chi-square, 1931.
[[nodiscard]] double chi_square_95(int degrees);
/// What is further off than so many times that quantile is no measurement of what it claims to be.
inline constexpr double kGate = 1.5;

/// The upper one of the middle. @param values  At least one.
[[nodiscard]] double median(std::vector<double> values);

/// Corrects the state by all blocks at once.
/// @return  Whether it did: false, and the state as before, where rounding has left no covariance
///          that could be factored.
bool kalman_update(State& state, const std::vector<RowBlock>& blocks);

/// Adds the body's pose as the newest clone; landmarks change over to its rotation error.
void add_clone(State& state, std::int64_t frame);

/// Forgets clone @p index, which may be a milestone, and what tracks saw from it. If it is the
/// newest, landmarks change over to the one before.
void remove_clone(State& state, std::size_t index);

/// @param indices  Of landmarks, rising.
void remove_landmarks(State& state, std::span<const std::size_t> indices);

/// A landmark whose error is solved from its block: residual = parts * error + to_point * f.
struct NewLandmark {
  Landmark landmark;
  RowBlock block;
  Eigen::MatrixXd to_point;  ///< [rows, 3] of full rank; residuals are those of the best position.
};
void add_landmarks(State& state, std::span<const NewLandmark> added);

/// Adds landmarks that are known from elsewhere: the error of their places in the world has @p
/// covariance, f64 [3n,3n], and has nothing to do with the state's.
void add_known_landmarks(State& state, std::span<const Landmark> landmarks,
                         const Eigen::MatrixXd& covariance);

/// Covariance of a place of the world against another world: rotation and position (as the state's
/// errors, about the other world's origin), and scale.
using PlaceCovariance = Eigen::Matrix<double, 7, 7>;
/// Of a world that is off by these at the point @p at of the other world.
[[nodiscard]] PlaceCovariance covariance_at(const Eigen::Vector3d& at,
                                            const Eigen::Vector3d& turn_sigma_rad,
                                            double position_sigma, double scale_sigma);

/// All that the state knows is in another world from now on.
/// @param covariance  Of @p to_world: what all poses and points are then off by together.
void move_world(State& state, const Similarity& to_world, const PlaceCovariance& covariance);

/// The same of a point outside of the filter, but for what the world is off by.
void move_point(MapPoint& point, const Similarity& to_world);

/// Takes a point's own error out of a block: what is left says something of the poses alone.
[[nodiscard]] RowBlock without_point(const RowBlock& block, const Eigen::MatrixXd& to_point);

/// The same information in at most three rows, of a block whose parts all see one point: the
/// last part's [rows,3] times anything. Rows beyond are noise alone; gate them first.
[[nodiscard]] RowBlock in_three_rows(const RowBlock& block);

/// The same information in at most as many rows as the blocks have columns. All have the same
/// sigma.
[[nodiscard]] RowBlock compressed(const std::vector<RowBlock>& blocks, int first_column,
                                  int columns);

}  // namespace pirt::slam
