// The algebra of the filter: rows of a linear measurement, the Kalman update, and taking states in
// and out. Knows nothing of cameras.
#pragma once

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

/// Squared Mahalanobis distance of a block's residual.
[[nodiscard]] double innovation(const State& state, const RowBlock& block);

/// The 95 % quantile of chi^2 with @p degrees degrees of freedom (1 to 200 and beyond, to 1 %).
/// @source  Wilson and Hilferty, The distribution of chi-square, 1931.
[[nodiscard]] double chi_square_95(int degrees);

/// Corrects the state by all blocks at once.
void kalman_update(State& state, const std::vector<RowBlock>& blocks);

/// Adds the body's pose as the newest clone; landmarks change over to its rotation error.
void add_clone(State& state, std::int64_t frame);

/// Forgets clone @p index, and what tracks saw from it. If it is the newest, landmarks change over
/// to the one before.
void remove_clone(State& state, std::size_t index);

void remove_landmark(State& state, std::size_t index);

/// Adds a landmark whose error is solved from @p block: residual = parts * error + to_point * f.
/// @param to_point  [rows, 3] of full rank; residuals are those of the best position.
void add_landmark(State& state, const Landmark& landmark, const RowBlock& block,
                  const Eigen::MatrixXd& to_point);

/// Takes a point's own error out of a block: what is left says something of the poses alone.
[[nodiscard]] RowBlock without_point(const RowBlock& block, const Eigen::MatrixXd& to_point);

/// The same information in at most as many rows as the blocks have columns. All have the same
/// sigma.
[[nodiscard]] RowBlock compressed(const std::vector<RowBlock>& blocks, int first_column,
                                  int columns);

}  // namespace pirt::slam
