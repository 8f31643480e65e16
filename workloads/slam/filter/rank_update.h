// The filter's most expensive product, for the processor at hand.
#pragma once

#include <Eigen/Core>

namespace pirt::slam {

/// covariance -= w * w^T. Symmetric before and after, to the bit.
void subtract_square(Eigen::MatrixXd& covariance, const Eigen::MatrixXd& w);

}  // namespace pirt::slam
