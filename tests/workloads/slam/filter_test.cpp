// The algebra of the SLAM's filter, by hand.
#include "workloads/slam/filter/filter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/workloads/slam/support.h"

namespace pirt::slam {
namespace {

/// A body that knows where it is, and a landmark that was known before.
State at_known_place(const Eigen::Vector3d& place, const Eigen::Matrix3d& own) {
  State state;
  state.covariance.setZero();
  state.motion.position = {1, 2, 0};
  add_clone(state, 0);
  Landmark landmark;
  landmark.position = place;
  add_known_landmarks(state, std::span(&landmark, 1), own);
  return state;
}

TEST(ChiSquare, IsThatOfTables) {
  EXPECT_NEAR(chi_square_95(1), 3.84, 0.12);
  EXPECT_NEAR(chi_square_95(2), 5.99, 0.06);
  EXPECT_NEAR(chi_square_95(10), 18.31, 0.05);
  EXPECT_NEAR(chi_square_95(60), 79.08, 0.1);
}

// Position x has variance 4; measured as 3 with variance 1: gain 4/5, so 2.4 with variance 0.8.
TEST(KalmanUpdate, OneNumberByHand) {
  State state;
  state.covariance(kPositionAt, kPositionAt) = 4;
  RowBlock block;
  block.residual = Eigen::VectorXd::Constant(1, 3.0);
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(1, 3);
  x(0, 0) = 1;
  block.parts.push_back({kPositionAt, x});
  EXPECT_NEAR(innovation(state, block), 9.0 / 5, 1e-12);
  kalman_update(state, {block});
  EXPECT_NEAR(state.motion.position.x(), 2.4, 1e-12);
  EXPECT_NEAR(state.covariance(kPositionAt, kPositionAt), 0.8, 1e-12);
}

// Rounding can leave a covariance that is none: nothing is corrected by it.
TEST(KalmanUpdate, LeavesTheStateAsItIsWhereNothingCanBeFactored) {
  State state;
  state.covariance(kPositionAt, kPositionAt) = -4;
  RowBlock block;
  block.residual = Eigen::VectorXd::Constant(1, 3.0);
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(1, 3);
  x(0, 0) = 1;
  block.parts.push_back({kPositionAt, x});
  EXPECT_FALSE(kalman_update(state, {block}));
  EXPECT_EQ(state.motion.position.x(), 0);
  EXPECT_EQ(state.covariance(kPositionAt, kPositionAt), -4);
}

// Seen from the clone at 4 m: half a metre farther in the inverse of the range is 4 / (1 - 1/8) m,
// and what it is off by there grows with it, along with its square.
TEST(KalmanUpdate, CorrectsALandmarkInItsInverseRange) {
  const Eigen::Vector3d own(0.36, 0.01, 0.01);
  State state = at_known_place({5, 2, 0}, own.asDiagonal());
  RowBlock block;
  block.residual = Eigen::Vector3d(1, 0, 0);
  block.parts.push_back({state.landmark_at(0), Eigen::Matrix3d::Identity()});
  block.sigma = 0.6;
  ASSERT_TRUE(kalman_update(state, {block}));
  const double grows = 1 / 0.875;
  EXPECT_LT((state.landmarks[0].position - Eigen::Vector3d(1 + 4 * grows, 2, 0)).norm(), 1e-12);
  const double across = grows * grows * 0.01 * 0.36 / 0.37;
  const Eigen::Vector3d left(std::pow(grows, 4) * 0.18, across, across);
  EXPECT_LT((landmark_covariance(state, 0) - Eigen::Matrix3d(left.asDiagonal())).norm(), 1e-12);
}

// A loop closes: what is known against the robot moves with it, however far.
TEST(KalmanUpdate, MovesLandmarksWithTheClone) {
  State state;
  state.covariance.setZero();
  state.covariance.block<3, 3>(kPositionAt, kPositionAt) = 4 * Eigen::Matrix3d::Identity();
  add_clone(state, 0);
  Landmark landmark;
  landmark.position = {3, 1, 0};
  add_known_landmarks(state, std::span(&landmark, 1), Eigen::Matrix3d::Zero());
  const int place = State::clone_at(0) + 3;
  const int at = state.landmark_at(0);
  state.covariance.middleRows<3>(at) = state.covariance.middleRows<3>(place);
  state.covariance.middleCols<3>(at) = state.covariance.middleCols<3>(place);
  RowBlock block;
  block.residual = Eigen::Vector3d(-4, 2, 0);
  block.parts.push_back({kPositionAt, Eigen::Matrix3d::Identity()});
  block.sigma = 2;
  ASSERT_TRUE(kalman_update(state, {block}));
  EXPECT_LT((state.clones[0].body.position - Eigen::Vector3d(-2, 1, 0)).norm(), 1e-12);
  EXPECT_LT((state.landmarks[0].position - Eigen::Vector3d(1, 2, 0)).norm(), 1e-12);
  EXPECT_LT((landmark_covariance(state, 0) - position_covariance(state)).norm(), 1e-12);
}

// A world that is turned, moved and scaled: what a picture shows of a point is the same, and the
// errors' covariance is that of the same ellipsoids there.
TEST(MoveWorld, ChangesNothingThatIsSeen) {
  slam::Setup setup = one_camera();
  const State state = small_state(setup);
  const Similarity there{1.7, {rotation_of({0.1, -0.2, 2.0}), {5, -3, 1}}};
  State moved = state;
  move_world(moved, there, PlaceCovariance::Zero());
  Observation seen;
  seen.left = {0.12, -0.04};
  const auto before = rows_of_landmark(state, setup, 0, seen, 1.0);
  // A camera's place on the body is in metres: where the unit of length changes, it does too.
  setup.cameras[0].body_from_camera.position *= there.scale;
  const auto after = rows_of_landmark(moved, setup, 0, seen, 1.0);
  EXPECT_LT((before.residual - after.residual).norm(), 1e-9);
  EXPECT_NEAR(innovation(moved, after), innovation(state, before), 1e-6);
  const Eigen::Matrix3d r = there.scale * there.pose.rotation;
  const Eigen::Matrix3d body = r * position_covariance(state) * r.transpose();
  EXPECT_LT((position_covariance(moved) - body).norm(), 1e-9 * body.norm());
  const Eigen::Matrix3d point = r * landmark_covariance(state, 0) * r.transpose();
  EXPECT_LT((landmark_covariance(moved, 0) - point).norm(), 1e-9 * point.norm());
}

// Known to 3 cm where the body is, and to 0.01 rad in heading: a point 2 m beside it is off by 2 cm
// more, across the way to it.
TEST(MoveWorld, AddsWhatTheOtherWorldsPlaceIsOffBy) {
  State state = at_known_place({3, 2, 0}, Eigen::Matrix3d::Zero());
  move_world(state, {}, covariance_at(state.motion.position, {0, 0, 0.01}, 0.03, 0));
  EXPECT_LT((position_covariance(state) - 9e-4 * Eigen::Matrix3d::Identity()).norm(), 1e-12);
  Eigen::Vector3d expected(9e-4, 9e-4 + 4e-4, 9e-4);
  EXPECT_LT((landmark_covariance(state, 0) - Eigen::Matrix3d(expected.asDiagonal())).norm(), 1e-12);
  EXPECT_NEAR(state.covariance(2, 2), 1e-4, 1e-12);
}

TEST(AddKnownLandmarks, KeepsTheirOwnCovarianceAndNothingOfTheStates) {
  const slam::Setup setup = one_camera();
  State state = small_state(setup);
  Landmark landmark;
  landmark.position = {2, -1, 0.5};
  const Eigen::Matrix3d own = Eigen::Vector3d(1e-4, 2e-4, 3e-4).asDiagonal();
  add_known_landmarks(state, std::span(&landmark, 1), own);
  EXPECT_LT((landmark_covariance(state, 1) - own).norm(), 1e-12);
  EXPECT_EQ(state.size(), kMotionSize + 2 * kCloneSize + 6);
  // The error of its place is that of its column and the newest clone's turn; with the position of
  // the body it has no covariance.
  const int turn = State::clone_at(1);
  const int at = state.landmark_at(1);
  const Eigen::Matrix3d arm = cross_matrix(landmark.position);
  const Eigen::MatrixXd cross =
      state.covariance.block(at, 0, 3, turn) - arm * state.covariance.block(turn, 0, 3, turn);
  EXPECT_LT(cross.norm(), 1e-12);
}

TEST(Clones, ForgettingTheNewestLeavesLandmarksAsUncertainAsTheyWere) {
  const slam::Setup setup = one_camera();
  State state = small_state(setup);
  const Eigen::Matrix3d before = landmark_covariance(state, 0);
  remove_clone(state, 1);
  EXPECT_LT((landmark_covariance(state, 0) - before).norm(), 1e-9 * before.norm());
  EXPECT_EQ(state.size(), kMotionSize + kCloneSize + 3);
  EXPECT_EQ(state.tracks[0].seen.size(), 1U);
}

TEST(Compressed, SaysTheSameInFewerRows) {
  const slam::Setup setup = one_camera();
  const State state = small_state(setup);
  std::vector<RowBlock> blocks;
  for (int i = 0; i < 20; ++i) {
    RowBlock block;
    block.residual = Eigen::VectorXd::Random(4);
    block.parts.push_back({State::clone_at(0), Eigen::MatrixXd::Random(4, kCloneSize)});
    block.parts.push_back({State::clone_at(1), Eigen::MatrixXd::Random(4, kCloneSize)});
    blocks.push_back(block);
  }
  State all = state;
  kalman_update(all, blocks);
  State few = state;
  const RowBlock packed = compressed(blocks, kMotionSize, 2 * kCloneSize);
  EXPECT_EQ(packed.residual.size(), 2 * kCloneSize);
  kalman_update(few, {packed});
  EXPECT_LT((all.covariance - few.covariance).norm(), 1e-9);
  EXPECT_LT((all.motion.position - few.motion.position).norm(), 1e-9);
}

TEST(InThreeRows, SaysTheSameOfAPoint) {
  const slam::Setup setup = one_camera();
  const State state = small_state(setup);
  RowBlock block;
  block.residual = Eigen::VectorXd::Random(4);
  const Eigen::MatrixXd slope = Eigen::MatrixXd::Random(4, 3);
  block.parts.push_back({State::clone_at(1), slope * Eigen::MatrixXd::Random(3, kCloneSize)});
  block.parts.push_back({State::clone_at(0) + 3, -slope});
  block.parts.push_back({kPositionAt, slope});
  const RowBlock few = in_three_rows(block);
  ASSERT_EQ(few.residual.size(), 3);
  State all = state;
  ASSERT_TRUE(kalman_update(all, {block}));
  State reduced = state;
  ASSERT_TRUE(kalman_update(reduced, {few}));
  EXPECT_LT((all.covariance - reduced.covariance).norm(), 1e-9);
  EXPECT_LT((all.motion.position - reduced.motion.position).norm(), 1e-9);
  EXPECT_GT((all.motion.position - state.motion.position).norm(), 1e-6);
}

}  // namespace
}  // namespace pirt::slam
