// Maps of earlier runs: found where they are, and never where they are not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>

#include "tests/support/long.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/base/math/random.h"
#include "workloads/slam/filter/map_points.h"
#include "workloads/slam/filter/steps.h"
#include "workloads/slam/run/map_file.h"
#include "workloads/slam/run/pipeline.h"
#include "workloads/slam/views/places.h"
#include "workloads/slam/workload/recording.h"

namespace pirt::slam {
namespace {

using Map = std::vector<MapPoint>;

Descriptor descriptor_of(std::uint64_t seed) {
  Random random(seed);
  Descriptor descriptor;
  for (auto& byte : descriptor) byte = static_cast<std::uint8_t>(random.below(256));
  return descriptor;
}

TEST(MatchPlaces, KnowsAPointThatIsInTheMapTwiceAndNoneThatLooksLikeAnother) {
  const Eigen::Vector3d eye(0, 0, 0);
  const std::array points = {Eigen::Vector3d(0, 0, 4), Eigen::Vector3d(0, 0.01, 4),
                             Eigen::Vector3d(1, 0, 4), Eigen::Vector3d(-1, 0, 4)};
  const std::array looks = {descriptor_of(1), descriptor_of(2), descriptor_of(3)};
  // The first look is that of one point, twice there; the second that of two.
  const std::vector<KnownPlace> places = {{&looks[0], &points[0], &eye},
                                          {&looks[0], &points[1], &eye},
                                          {&looks[1], &points[2], &eye},
                                          {&looks[1], &points[3], &eye}};
  Features features;
  for (const auto& look : looks) {
    features.pixels.emplace_back(0, 0);
    features.scores.push_back(1);
    features.descriptors.push_back(look);
  }
  const auto matches = match_places(features, places, 100);
  ASSERT_EQ(matches.size(), 1U);
  EXPECT_EQ(matches[0].feature, 0U);
  EXPECT_LE(matches[0].place, 1U);
}

MapPoint point_at(std::int64_t id, const Eigen::Vector3d& position, double variance) {
  MapPoint point;
  point.id = id;
  point.position = position;
  point.covariance = variance * Eigen::Matrix3d::Identity();
  return point;
}

TEST(CorrectMap, ReplacesWhatItKnowsAddsWhatItDoesNotAndRefusesWhatCannotBe) {
  const slam::Setup setup;
  State state;
  state.landmarks.resize(1);
  state.landmarks[0].id = 1;
  state.tracks.resize(1);
  state.tracks[0].id = 2;
  state.map = {point_at(3, {1, 0, 0}, 0.04), point_at(4, {2, 0, 0}, 1e-6),
               point_at(5, {3, 0, 0}, 0.01)};
  const auto before = state;
  const auto change =
      correct_map(state, setup,
                  {.points = {point_at(1, {9, 9, 9}, 1e-4), point_at(2, {9, 9, 9}, 1e-4),
                              point_at(3, {1.1, 0, 0}, 1e-4), point_at(4, {2.05, 0, 0}, 0.01),
                              point_at(5, {5, 0, 0}, 0.01), point_at(6, {7, 0, 0}, 0.01)}});
  EXPECT_EQ(change.replaced, 2);
  EXPECT_EQ(change.refused, 1);
  EXPECT_EQ(change.added, 1);
  EXPECT_EQ(state.landmarks[0].position, before.landmarks[0].position);
  ASSERT_EQ(state.map.size(), 4U);
  // Of two that may have the same errors, what the better one says: not less than it is sure of.
  EXPECT_NEAR(state.map[0].position.x(), 1.1, 1e-9);
  EXPECT_NEAR(state.map[0].covariance(0, 0), 1e-4, 1e-12);
  EXPECT_EQ(state.map[1].position, before.map[1].position) << "it knew better";
  EXPECT_EQ(state.map[2].position, before.map[2].position) << "two metres where 14 cm are likely";
  EXPECT_EQ(state.map[3].id, 6);
}

TEST(CorrectMap, MovesPointsOfTheWorldInWhichTheRunBegan) {
  const slam::Setup setup;
  State state;
  state.in_map = true;
  state.map_from_start = {1, {rotation_of({0, 0, 0.5}), {1, 2, 3}}};
  const auto old_world = point_at(1, {1, 0, 0}, 0.01);
  const auto new_world = point_at(2, {1, 0, 0}, 0.01);
  correct_map(state, setup, {.points = {old_world}, .in_map = false});
  correct_map(state, setup, {.points = {new_world}, .in_map = true});
  ASSERT_EQ(state.map.size(), 2U);
  EXPECT_EQ(state.map[0].position, state.map_from_start * old_world.position);
  EXPECT_EQ(state.map[1].position, new_world.position);
}

TEST(CorrectMap, KeepsTheMapsBound) {
  slam::Setup setup;
  setup.most_map_points = 2;
  State state;
  BetterMap better;
  for (int i = 0; i < 5; ++i) {
    better.points.push_back(point_at(i, {1.0 * i, 0, 0}, 0.01));
    better.points.back().last_frame = i;
  }
  EXPECT_EQ(correct_map(state, setup, better).added, 5);
  ASSERT_EQ(state.map.size(), 2U);
  EXPECT_EQ(state.map[0].id, 3);
  EXPECT_EQ(state.map[1].id, 4);
}

/// What a flight without pictures comes to.
struct Flight {
  State last;
  std::optional<int> found;  ///< Frame in which the map was.
  double rms_m = 0;          ///< Against truth in the map's world, since then.
  bool always_tracks = true;
};

Flight fly(const Recording& recording, const Setup& setup, int frames,
           const Pose& map_from_truth = {}) {
  Flight flight;
  State& state = flight.last;
  double squares = 0;
  int count = 0;
  for (int i = 0; i < frames; ++i) {
    begin_frame(state, setup, recording.samples(i), recording.time_of(i));
    if (!sees(state, setup)) continue;
    const Features features = recording.features(i, 1);
    update_pose(state, setup, recording.tracks(state, i, 1), features);
    extend_map(state, setup, features);
    if (i > 30) flight.always_tracks = flight.always_tracks && state.status == Status::kTracking;
    if (!state.in_map) continue;
    if (!flight.found) flight.found = i;
    const Pose truth = map_from_truth * recording.truth_at(i);
    squares += (state.motion.position - truth.position).squaredNorm();
    ++count;
  }
  if (count > 0) flight.rms_m = std::sqrt(squares / count);
  return flight;
}

constexpr int kFrames = 125;  // 5 s

std::shared_ptr<const Map> map_of(const State& state, const Setup& setup) {
  const test::ScratchFolder folder;
  test::put(folder.path() / "map", map_text(state, setup));
  return load_map(folder.path() / "map", setup);
}

/// What is mirrored along an axis.
std::shared_ptr<const Map> mirrored(const Map& map, Eigen::Index axis) {
  Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity();
  mirror(axis, axis) = -1;
  auto made = std::make_shared<Map>(map);
  for (MapPoint& point : *made) {
    point.position = mirror * point.position;
    point.seen_from = mirror * point.seen_from;
    point.covariance = mirror * point.covariance * mirror;
  }
  return made;
}

/// As many points anywhere, of any look.
std::shared_ptr<const Map> random_map(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  auto made = std::make_shared<Map>(count);
  for (MapPoint& point : *made) {
    for (int i = 0; i < 3; ++i) point.position(i) = random.uniform(-4, 4);
    point.covariance = 1e-4 * Eigen::Matrix3d::Identity();
    point.descriptor = descriptor_of(random.below(1U << 30U));
  }
  return made;
}

class KnownMap : public testing::Test {
 protected:
  KnownMap() { known_ = map_of(fly(first_, first_.setup(), kFrames).last, first_.setup()); }
  [[nodiscard]] slam::Setup with(std::shared_ptr<const Map> map) const {
    slam::Setup setup = first_.setup();
    setup.known = std::move(map);
    return setup;
  }
  const Recording first_;
  std::shared_ptr<const Map> known_;
};

TEST_F(KnownMap, IsFoundAndWhatWasTrackedMovesIntoItsWorld) {
  ASSERT_GT(known_->size(), 100U);
  const Flight flight = fly(first_, with(known_), kFrames);
  ASSERT_TRUE(flight.found.has_value());
  EXPECT_LT(*flight.found, 25) << "at rest, before a wall with a few points beside it";
  EXPECT_TRUE(flight.always_tracks);
  EXPECT_LT(flight.rms_m, 0.06);
  EXPECT_FALSE(flight.last.taken.empty()) << "its points correct the state";
  EXPECT_TRUE(std::ranges::is_sorted(flight.last.taken));
  // Saved again it has each of its points once.
  const std::size_t own = flight.last.landmarks.size() + flight.last.map.size();
  EXPECT_EQ(map_of(flight.last, with(known_))->size(),
            known_->size() - flight.last.taken.size() + own);
}

TEST_F(KnownMap, OfAnotherPlaceIsNeverFoundAndTheRunGoesOnAsWithoutIt) {
  constexpr int kEnough = 75;  // where the right one is found in 25
  const Flight without = fly(first_, first_.setup(), kEnough);
  const Flight other_room = fly(Recording({.room_seed = 2}), Recording().setup(), kFrames);
  const std::array maps = {map_of(other_room.last, first_.setup()),
                           random_map(300, 5),
                           mirrored(*known_, 0),
                           mirrored(*known_, 1),
                           mirrored(*known_, 2),
                           std::make_shared<const Map>()};
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const Flight flight = fly(first_, with(maps[i]), kEnough);
    EXPECT_FALSE(flight.found.has_value()) << i;
    EXPECT_TRUE(flight.always_tracks) << i;
    EXPECT_EQ(flight.last.covariance, without.last.covariance) << i;
    EXPECT_EQ(map_text(flight.last, with(maps[i])), map_text(without.last, first_.setup())) << i;
  }
}

/// The same place by pictures: a map of one flight, and other flights through the same room.
struct Rooms {
  static Sequence sequence(std::uint64_t path, std::uint64_t room, double duration_s,
                           double rest_s) {
    SceneOptions options = test::scene(path, duration_s);
    options.path.rest_s = rest_s;
    options.room_seed = room;
    return generate_sequence(options);
  }
  static RunResult run(const Sequence& sequence, std::shared_ptr<const Map> known = {}) {
    RunOptions options;
    options.setup = setup_of(sequence);
    options.setup.known = std::move(known);
    return run_serially(sequence, options);
  }
};

// Run by `ctest -C long -L long`: 20 flights through a room whose map is known, from a rest or in
// motion, and 20 each with maps that are none of it; otherwise one each, of a part of the room.
TEST(SlamMaps, AMapIsFoundByEachFlightThroughItsRoomAndByNoOther) {
  const int flights = test::repeats(1, 20);
  const double mapped_s = test::long_tests() ? 40.0 : 6.0;
  const auto first = Rooms::sequence(1, 1, mapped_s, 2.0);
  const auto made = Rooms::run(first);
  const slam::Setup setup = setup_of(first);
  const auto known = map_of(made.last, setup);
  const Similarity to_truth = align(made.trajectory(), first.truth, Alignment::kSe3);
  auto elsewhere = Rooms::sequence(99, 99, mapped_s, 2.0);
  if (!test::long_tests()) elsewhere.frames.resize(100);
  const auto other = map_of(Rooms::run(elsewhere).last, setup);
  int found = 0;
  for (int i = 0; i < flights; ++i) {
    const auto seed = static_cast<std::uint64_t>(test::long_tests() ? 2 + i : 1);
    const auto sequence = test::remembering(Rooms::sequence(seed, 1, 5.0, i % 2 == 0 ? 1.0 : 0.0));
    const auto right = Rooms::run(sequence, known);
    double squares = 0;
    int count = 0;
    double after_s = 1e9;
    for (const auto& frame : right.frames) {
      const auto truth = truth_at(sequence.truth, frame.pose.time);
      if (!frame.in_map || !truth) continue;
      after_s = std::min(after_s, to_s(frame.pose.time - right.frames.front().pose.time));
      squares += (to_truth * frame.pose.body.position - truth->position).squaredNorm();
      ++count;
    }
    const double rms_m = count > 0 ? std::sqrt(squares / count) : 1e9;
    std::printf("flight %d: found after %.2f s, RMS %.4f m\n", i, after_s, rms_m);
    if (after_s <= 2.0 && rms_m < 0.03) ++found;
    for (const auto& wrong :
         {other, mirrored(*known, i % 2), random_map(300, seed), mirrored(*known, 1 - i % 2)}) {
      if (!test::long_tests() && wrong->size() == 300) break;
      EXPECT_FALSE(Rooms::run(sequence, wrong).last.in_map) << i;
    }
  }
  EXPECT_GE(found, flights - flights / 20);
}

// Run by `ctest -C long -L long`: ten times around the corridor, with what was lost from view known
// again and without; otherwise its first seconds. Half-size pictures, for the time.
TEST(SlamRing, DriftEndsWhereTheRobotHasBeenBefore) {
  SceneOptions options = test::scene(1, test::long_tests() ? 575.0 : 6.0);
  options.path.shape = PathShape::kRing;
  options.path.rest_s = 1;
  options.width = 320;
  options.height = 240;
  auto sequence = generate_sequence(options);
  if (!test::long_tests()) sequence = test::remembering(sequence);  // what fits into memory
  std::array<double, 2> ends{};
  for (const bool recognizes : {false, true}) {
    RunOptions run;
    run.setup = setup_of(sequence);
    run.setup.recognize = recognizes;
    const auto result = run_serially(sequence, run);
    const auto poses = result.trajectory();
    const auto error = evaluate(poses, sequence.truth, Alignment::kSe3);
    const auto last = truth_at(sequence.truth, poses.back().time);
    ASSERT_TRUE(last.has_value());
    const auto to_truth = align(poses, sequence.truth, Alignment::kStartYaw);
    ends[recognizes ? 1 : 0] = (to_truth * poses.back().body.position - last->position).norm();
    std::printf("%s map: RMS %.3f m, %.3f %% of %.1f m; at the end off by %.3f m\n",
                recognizes ? "with" : "without", error.ate_rms_m,
                100 * error.ate_rms_m / error.path_m, error.path_m, ends[recognizes ? 1 : 0]);
    EXPECT_EQ(result.frames.back().status, Status::kTracking);
    if (recognizes || !test::long_tests()) {
      EXPECT_LE(error.ate_rms_m, (test::long_tests() ? 0.001 : 0.01) * error.path_m);
    }
  }
  if (test::long_tests()) {
    EXPECT_LT(ends[1], 0.3 * ends[0]);
  }
}

}  // namespace
}  // namespace pirt::slam
