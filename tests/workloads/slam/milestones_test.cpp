// Poses that stay in the filter, and the points that go with them.
#include "workloads/slam/filter/milestones.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "tests/workloads/slam/support.h"
#include "workloads/slam/filter/map_points.h"

namespace pirt::slam {
namespace {

/// small_state(), whose older pose is a milestone.
State with_milestone(const slam::Setup& setup) {
  State state = small_state(setup);
  state.milestones = 1;
  for (auto& track : state.tracks) track.seen.clear();
  return state;
}

Eigen::Vector3d from_milestone(const State& state, std::size_t milestone,
                               const Eigen::Vector3d& place) {
  return state.clones[milestone].body.inverse() * place;
}

// A point leaves the filter and comes back: where it is against its milestone is known half as well
// as before, and so it is against the world, since the milestone is as uncertain as it was.
TEST(Milestones, APointComesBackWhereItWasAgainstItsMilestone) {
  const slam::Setup setup = one_camera();
  State state = with_milestone(setup);
  const MapPoint left = map_point_of(state, 0);
  EXPECT_EQ(left.milestone, state.clones[0].frame);
  const NewLandmark again = landmark_of(state, left);
  add_landmarks(state, std::span(&again, 1));
  ASSERT_EQ(state.landmarks.size(), 2U);
  EXPECT_EQ(state.landmarks[1].position, state.landmarks[0].position);
  const MapPoint back = map_point_of(state, 1);
  const Eigen::Matrix3d shared = shared_covariance(left);
  EXPECT_GT(shared.trace(), 2 * left.covariance.trace());
  EXPECT_LT((back.covariance - shared).norm(), 1e-6 * shared.norm());
  // The first one is correlated with what told where it is; of the second that is forgotten.
  RowBlock milestone;
  milestone.residual = Eigen::VectorXd::Zero(3);
  milestone.parts.push_back(moves_with(state, left));
  const Eigen::Matrix3d expected = predicted_covariance(state, milestone) + shared;
  EXPECT_LT((landmark_covariance(state, 1) - expected).norm(), 1e-6 * expected.norm());
}

/// A loop closes: the milestone was off.
void move_milestone(State& state) {
  RowBlock moved;
  moved.residual = Eigen::VectorXd::Constant(6, 0.05);
  moved.parts.push_back({State::clone_at(0), Eigen::MatrixXd::Identity(6, 6)});
  moved.sigma = 0.01;
  ASSERT_TRUE(kalman_update(state, {moved}));
}

TEST(Milestones, PointsMoveWithThem) {
  const slam::Setup setup = one_camera();
  State state = with_milestone(setup);
  state.map.push_back(map_point_of(state, 0));
  state.map.push_back(state.map[0]);
  state.map[1].milestone = -1;
  const State before = state;
  move_milestone(state);
  ASSERT_GT((state.clones[0].body.position - before.clones[0].body.position).norm(), 0.01);
  EXPECT_LT((from_milestone(state, 0, state.map[0].position) -
             from_milestone(before, 0, before.map[0].position))
                .norm(),
            1e-9);
  EXPECT_LT((from_milestone(state, 0, state.map[0].seen_from) -
             from_milestone(before, 0, before.map[0].seen_from))
                .norm(),
            1e-9);
  EXPECT_EQ(state.map[1].position, before.map[1].position);
}

/// A robot that goes along x, a metre a frame.
State walk(const slam::Setup& setup, int frames, double until) {
  constexpr double kDepth = 2.0;
  State state;
  state.status = Status::kTracking;
  state.covariance = 1e-4 * Eigen::MatrixXd::Identity(kMotionSize, kMotionSize);
  for (int frame = 0; frame < frames; ++frame) {
    state.motion.position.x() = until * (1 - std::abs(1 - 2.0 * frame / frames));
    // The way to here is off by as much again.
    state.covariance.diagonal().segment<3>(kPositionAt).array() += 1e-4;
    add_clone(state, frame);
    while (std::ssize(state.clones) - state.milestones > 3) leave_window(state, setup, kDepth);
    MapPoint point;
    point.id = frame;
    point.position = state.motion.position + Eigen::Vector3d(0, 2, 0);
    point.seen_from = state.motion.position;
    point.milestone = nearest_milestone(state, point.seen_from);
    state.map.push_back(point);
  }
  return state;
}

// Somebody looks at a stretch of the way; before the points come back, a loop closes.
TEST(CorrectMap, TakesPointsToWhereTheirMilestonesAreNow) {
  const slam::Setup setup = one_camera();
  State state = with_milestone(setup);
  state.map.push_back(map_point_of(state, 0));
  state.map[0].id = 1;
  remove_landmarks(state, std::array<std::size_t, 1>{0});
  state.tracks.clear();
  const State before = state;
  BetterMap better;
  for (const std::int64_t id : {1, 2, 3}) {
    MapPoint point = before.map[0];
    point.id = id;
    point.covariance *= 0.01;
    if (id == 3) point.milestone = 77;
    move_point(point, {1.0, before.clones[0].body.inverse()});
    better.points.push_back(point);
  }
  move_milestone(state);
  const MapChange change = correct_map(state, setup, better);
  EXPECT_EQ(change.replaced, 1);
  EXPECT_EQ(change.added, 1);
  EXPECT_EQ(change.refused, 1) << "its milestone has gone";
  ASSERT_EQ(state.map.size(), 2U);
  ASSERT_GT((state.map[0].position - before.map[0].position).norm(), 0.01);
  for (const MapPoint& point : state.map) {
    EXPECT_EQ(point.milestone, before.map[0].milestone);
    EXPECT_LT((from_milestone(state, 0, point.position) -
               from_milestone(before, 0, before.map[0].position))
                  .norm(),
              1e-9);
    EXPECT_LT(point.covariance.trace(), 0.011 * before.map[0].covariance.trace());
  }
}

// Of a milestone that has drifted against the map's, a point is known less well by that.
TEST(CorrectMap, CountsWhatTwoMilestonesAreOffAgainstEachOther) {
  const slam::Setup setup = one_camera();
  State state = walk(setup, 40, 8.0);
  ASSERT_GT(state.milestones, 2);
  const auto newest = static_cast<std::size_t>(state.milestones) - 1;
  MapPoint mine = state.map.back();
  mine.milestone = state.clones[0].frame;
  mine.covariance = 1e-8 * Eigen::Matrix3d::Identity();
  state.map = {mine};
  MapPoint point = mine;
  point.milestone = state.clones[newest].frame;
  point.covariance = 1e-8 * Eigen::Matrix3d::Identity();
  // Two centimetres, where either says a tenth of a millimetre of its own, and their milestones
  // are off by centimetres.
  point.position.x() += 0.02;
  move_point(point, {1.0, state.clones[newest].body.inverse()});
  EXPECT_EQ(correct_map(state, setup, {.points = {point}}).replaced, 1);
  EXPECT_EQ(state.map[0].position, mine.position) << "it knew better";
  move_point(point, {1.0, state.clones[newest].body});
  point.milestone = mine.milestone;
  move_point(point, {1.0, state.clones[0].body.inverse()});
  EXPECT_EQ(correct_map(state, setup, {.points = {point}}).refused, 1);
}

TEST(Milestones, StandAlongTheWayAndNotWhereOneIs) {
  slam::Setup setup = one_camera();
  setup.most_milestones = 8;
  // Back and forth over 4 metres: one each half metre at most.
  const State near = walk(setup, 200, 4.0);
  EXPECT_GT(near.milestones, 4);
  EXPECT_LE(near.milestones, 8);
  // Farther than so many reach: they stand farther apart, and none has all points.
  const State far = walk(setup, 200, 90.0);
  EXPECT_EQ(far.milestones, 8);
  EXPECT_EQ(far.size(), kMotionSize + kCloneSize * (8 + 3));
  double least = 1e9;
  for (std::size_t i = 0; i < 8; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      least = std::min(least, (far.clones[i].body.position - far.clones[k].body.position).norm());
    }
  }
  EXPECT_GT(least, 3);
  // What was known against one that went is known against another one that is there, less well.
  for (const MapPoint& point : far.map) {
    if (point.milestone < 0) continue;  // of before the first one
    EXPECT_TRUE(std::ranges::any_of(std::span(far.clones).first(8), [&](const Clone& clone) {
      return clone.frame == point.milestone;
    }));
    EXPECT_GE(point.covariance(0, 0), 0);
  }
  EXPECT_TRUE(std::ranges::any_of(
      far.map, [](const MapPoint& point) { return point.covariance(0, 0) > 5e-5; }));
}

TEST(Milestones, ThatAreForgottenLeaveTheirPointsInTheWorld) {
  const slam::Setup setup = one_camera();
  State state = with_milestone(setup);
  state.map.push_back(map_point_of(state, 0));
  RowBlock milestone;
  milestone.residual = Eigen::VectorXd::Zero(3);
  milestone.parts.push_back(moves_with(state, state.map[0]));
  const Eigen::Matrix3d expected = predicted_covariance(state, milestone) + state.map[0].covariance;
  forget_milestones(state);
  EXPECT_EQ(state.milestones, 0);
  EXPECT_EQ(state.clones.size(), 1U);
  EXPECT_EQ(state.map[0].milestone, -1);
  EXPECT_LT((state.map[0].covariance - expected).norm(), 1e-12);
}

TEST(AddMapPoint, TakesRoomWhereMostPointsAre) {
  slam::Setup setup;
  setup.most_map_points = 4;
  State state;
  const auto point = [](std::int64_t id, std::int64_t milestone) {
    MapPoint made;
    made.id = made.last_frame = id;
    made.milestone = milestone;
    return made;
  };
  for (const auto& each : {point(1, 10), point(2, 20), point(3, 20), point(4, 20), point(5, 30)}) {
    add_map_point(state, setup, each);
  }
  std::vector<std::int64_t> ids;
  for (const MapPoint& each : state.map) ids.push_back(each.id);
  EXPECT_EQ(ids, (std::vector<std::int64_t>{1, 3, 4, 5}));
}

}  // namespace
}  // namespace pirt::slam
