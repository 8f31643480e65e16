// The filter's dense products beside Eigen's, at sizes that end within a strip or a panel.
#include "workloads/slam/filter/dense_update.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>

namespace pirt::slam {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Symmetric and positive definite, to the bit.
MatrixXd covariance(Eigen::Index n) {
  const MatrixXd a = MatrixXd::Random(n, n);
  const MatrixXd square = a * a.transpose() + static_cast<double>(n) * MatrixXd::Identity(n, n);
  return 0.5 * (square + square.transpose());
}

TEST(DenseUpdate, IsThatOfEigen) {
  std::srand(1);
  for (const Eigen::Index n : {1, 7, 8, 15, 33, 64, 117}) {
    for (const Eigen::Index m : {1, 2, 3, 4, 5, 8, 9, 12, 31, 66}) {
      const MatrixXd before = covariance(n);
      const MatrixXd h = MatrixXd::Random(m, n);
      const VectorXd residual = VectorXd::Random(m);
      const MatrixXd gain = before * h.transpose();
      const MatrixXd innovation = h * gain + MatrixXd::Identity(m, m);
      MatrixXd after = before;
      const auto correction = dense_update(after, innovation, gain, residual);
      ASSERT_TRUE(correction);
      const Eigen::LLT<MatrixXd> cholesky(innovation);
      const VectorXd wanted = gain * cholesky.solve(residual);
      const MatrixXd left = before - gain * cholesky.solve(gain.transpose());
      EXPECT_LT((*correction - wanted).norm(), 1e-10 * (1 + wanted.norm())) << n << ", " << m;
      EXPECT_LT((after - left).norm(), 1e-10 * before.norm()) << n << ", " << m;
      EXPECT_EQ(after, after.transpose().eval()) << n << ", " << m;
    }
  }
}

TEST(DenseUpdate, ReadsTheLowerTriangleOfTheInnovationOnly) {
  const Eigen::Index n = 20;
  const Eigen::Index m = 10;
  const MatrixXd before = covariance(n);
  const MatrixXd h = MatrixXd::Random(m, n);
  const MatrixXd gain = before * h.transpose();
  const MatrixXd innovation = h * gain + MatrixXd::Identity(m, m);
  const VectorXd residual = VectorXd::Ones(m);
  MatrixXd one = before;
  MatrixXd other = before;
  const MatrixXd lower = innovation.triangularView<Eigen::Lower>();
  EXPECT_EQ(dense_update(one, innovation, gain, residual),
            dense_update(other, lower, gain, residual));
  EXPECT_EQ(one, other);
}

TEST(DenseUpdate, LeavesTheCovarianceWhereNothingCanBeFactoredOrSaid) {
  const MatrixXd before = covariance(9);
  const MatrixXd gain = before.leftCols(2);
  MatrixXd after = before;
  MatrixXd innovation(2, 2);
  innovation << 1, 2, 2, 1;
  EXPECT_FALSE(dense_update(after, innovation, gain, VectorXd::Ones(2)));
  innovation << std::numeric_limits<double>::quiet_NaN(), 0, 0, 1;
  EXPECT_FALSE(dense_update(after, innovation, gain, VectorXd::Ones(2)));
  EXPECT_FALSE(dense_update(after, MatrixXd::Identity(2, 2), gain,
                            VectorXd::Constant(2, std::numeric_limits<double>::infinity())));
  EXPECT_EQ(after, before);
}

}  // namespace
}  // namespace pirt::slam
