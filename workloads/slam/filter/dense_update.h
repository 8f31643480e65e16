// The filter's most expensive products, for the processor at hand.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace pirt::slam {

/// One update of a Kalman filter by square roots: with S = L L^T and W = P H^T L^-T,
/// covariance -= W W^T, symmetric before and after, to the bit.
/// @param covariance  P, n x n.
/// @param innovation  S = H P H^T + R, m x m; its lower triangle is read.
/// @param gain        P H^T, n x m.
/// @param residual    m.
/// @return The correction W L^-1 residual = P H^T S^-1 residual, n. Absent if S is not positive
///   definite or the correction not finite; the covariance is then as it was.
std::optional<Eigen::VectorXd> dense_update(Eigen::MatrixXd& covariance,
                                            const Eigen::MatrixXd& innovation,
                                            const Eigen::MatrixXd& gain,
                                            const Eigen::VectorXd& residual);

}  // namespace pirt::slam
