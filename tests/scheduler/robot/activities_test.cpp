// What a robot does beside localizing: it plans, avoids and recognizes on the same units, and the
// localization stays what it was.
#include "scheduler/robot/activities.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "scheduler/robot/localization.h"
#include "tests/scheduler/support.h"
#include "tests/support/data.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/base/text/text.h"
#include "workloads/base/text/yaml.h"
#include "workloads/planning/map_files.h"
#include "workloads/planning/workloads.h"

namespace pirt {
namespace {

using testing::HasSubstr;

constexpr const char* kTwoUnits = R"(
platform: two
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)";

constexpr const char* kOneUnit = R"(
platform: one
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)";

/// A short flight through a room, and the room's map.
struct Room {
  explicit Room(double duration_s = 2.4) : options(test::scene(4, duration_s)) {
    options.path.rest_s = 0.4;
    options.width = 320;
    options.height = 240;
    sequence = test::remembering(generate_sequence(options));
    const auto floor = floor_map(options);
    test::put(folder.path() / "map.yaml", floor.yaml);
    test::put(folder.path() / "map.pgm", floor.pgm);
    const YamlNode goal = parse_yaml("goal.yaml", floor.goal_yaml);
    const auto number = [&](const char* key, std::size_t i) {
      return goal.at(key).items().at(i).number(-100, 360);
    };
    activities.setup = slam::setup_of(sequence);
    activities.keyframes = 5;
    activities.width = options.width;
    activities.height = options.height;
    activities.planning = {.map = planning::read_map(folder.path() / "map.yaml"),
                           .start = {{number("start", 0), number("start", 1)},
                                     number("start", 2) * std::numbers::pi / 180},
                           .goal = {number("goal", 0), number("goal", 1)}};
  }
  [[nodiscard]] LocalizationOptions localization() const {
    LocalizationOptions run;
    run.setup = slam::setup_of(sequence);
    run.runtime.platform = parse_platform("test.yaml", kTwoUnits, {}, 2);
    run.own_rate = false;
    return run;
  }

  const test::ScratchFolder folder;
  SceneOptions options;
  Sequence sequence;
  ActivityOptions activities;
};

ActivityCounts find(const std::vector<ActivityCounts>& all, const std::string& name) {
  return *std::ranges::find(all, name, &ActivityCounts::name);
}

void expect_done(const Activities& activities, std::size_t poses) {
  for (const ActivityCounts& each : activities.counts()) {
    SCOPED_TRACE(each.name);
    EXPECT_GT(each.completed, 0);
    EXPECT_EQ(each.failed, 0);
    EXPECT_EQ(each.fired, each.completed);
    EXPECT_EQ(each.latencies.size(), static_cast<std::size_t>(each.completed));
  }
  const auto plans = find(activities.counts(), "plan_path");
  EXPECT_EQ(static_cast<std::size_t>(plans.fired + plans.skipped), poses);
  EXPECT_EQ(activities.plans().found, plans.completed);
  const auto [before, after] = activities.adjusted();
  EXPECT_EQ(before.size(),
            5 * static_cast<std::size_t>(find(activities.counts(), "bundle_adjust").completed));
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_EQ(after[i].time, before[i].time);
    EXPECT_LT((after[i].body.position - before[i].body.position).norm(), 0.05);
  }
  // The goal is across the room.
  EXPECT_GT(activities.plans().last_m, 2.0);
  EXPECT_LT(activities.plans().last_m, 16.0);
}

std::size_t poses_of(const LocalizationResult& result) { return result.run.trajectory().size(); }

TEST(Activities, RunLiveBesideTheLocalizationAndChangeNothingOfItButTheMap) {
  Room room;
  room.activities.corrects_map = false;
  auto options = room.localization();
  const auto alone = localize_serially(room.sequence, options);
  for (const char* mode : {"ect", "latency", "throughput", "energy", "advanced"}) {
    SCOPED_TRACE(mode);
    Activities activities(room.activities);
    options.runtime.mode = mode;
    options.companion = &activities;
    const auto live = localize_live(room.sequence, options);
    EXPECT_TRUE(live.problems.empty());
    expect_done(activities, poses_of(live));
    // 2.4 s at 3 Hz.
    const auto seen = find(activities.counts(), "alexnet");
    EXPECT_EQ(seen.fired + seen.skipped, 8);
    EXPECT_EQ(tum_text(live.run.trajectory()), tum_text(alone.run.trajectory()));
  }
}

TEST(Activities, AreLeftForTheNextFrameOnTheOnlyUnit) {
  Room room;
  room.activities.corrects_map = false;
  auto options = room.localization();
  options.runtime.platform = parse_platform("test.yaml", kOneUnit, {}, 2);
  const auto alone = localize_serially(room.sequence, options);
  Activities activities(room.activities);
  options.companion = &activities;
  options.runtime.slices = true;
  options.runtime.trace = (room.folder.path() / "trace.json").string();
  const auto live = localize_live(room.sequence, options);
  EXPECT_TRUE(live.problems.empty());
  expect_done(activities, poses_of(live));
  EXPECT_EQ(tum_text(live.run.trajectory()), tum_text(alone.run.trajectory()));
  EXPECT_THAT(read_file(room.folder.path() / "trace.json"), HasSubstr("\"leave\""));
}

// For long enough that points of the first keyframes are no longer followed.
TEST(Activities, AdjustedPointsComeIntoTheMap) {
  const Room room(4.5);
  auto options = room.localization();
  for (const auto& drive : {localize_live, localize_serially}) {
    Activities activities(room.activities);
    options.companion = &activities;
    const auto result = drive(room.sequence, options);
    expect_done(activities, poses_of(result));
    int corrected = 0;
    for (const auto& frame : result.run.frames) {
      corrected += frame.map_change.replaced + frame.map_change.added;
    }
    EXPECT_GT(corrected, 0);
    EXPECT_EQ(result.run.frames.back().status, slam::Status::kTracking);
  }
}

TEST(Activities, RunWithoutTheRuntimeToo) {
  Room room;
  room.activities.corrects_map = false;
  auto options = room.localization();
  const auto alone = localize_serially(room.sequence, options);
  Activities activities(room.activities);
  options.companion = &activities;
  const auto serial = localize_serially(room.sequence, options);
  expect_done(activities, poses_of(serial));
  EXPECT_EQ(find(activities.counts(), "plan_path").skipped, 0);
  EXPECT_EQ(tum_text(serial.run.trajectory()), tum_text(alone.run.trajectory()));
  EXPECT_GT(serial.busy, alone.busy / 2);
}

TEST(Activities, ThePlansAreThoseOfTheTrueWay) {
  const Room room;
  auto options = room.localization();
  Activities activities(room.activities);
  options.companion = &activities;
  static_cast<void>(localize_live(room.sequence, options));
  // From where the robot truly is in the end, on the same map.
  const auto& planning = *room.activities.planning;
  const planning::PreparedMap map(planning.map, planning.radius_m);
  const auto truth = truth_at(room.sequence.truth, room.sequence.frames.back().time);
  ASSERT_TRUE(truth.has_value());
  const auto from =
      map.nearest_passable(planning.map.cell_of({truth->position.x(), truth->position.y()}));
  const auto path = planning::PathPlanner(map).plan(*from, planning.map.cell_of(planning.goal));
  EXPECT_NEAR(activities.plans().last_m, path.length * planning.map.resolution, 0.25);
}

recognition::ModelOptions model_in(const std::filesystem::path& folder, const char* weights,
                                   const char* layers) {
  recognition::ModelOptions model;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == weights) model.model = entry.path();
    if (entry.path().extension() == layers) model.config = entry.path();
  }
  return model;
}

TEST(Activities, PlanningIsPreparedForTheMap) {
  const Room room;
  const Activities activities(room.activities);
  RuntimeOptions options;
  activities.list_workloads(options);
  const auto& first = *options.first_inputs.at("plan_path");
  const auto& planning = *room.activities.planning;
  const auto expected = planning::plan_inputs(planning.map, planning.radius_m, {0, 0}, {0, 0});
  for (const std::size_t i : {0U, 1U}) {  // The map and the radius.
    EXPECT_TRUE(std::ranges::equal(first[i].bytes(), expected[i].bytes())) << i;
  }
}

TEST(Activities, AUsersModelsTakeThePlaceOfSeededOnes) {
  PIRT_DATA_OR_SKIP(yolo, "yolo-fastest-1.1");
  PIRT_DATA_OR_SKIP(squeezenet, "squeezenet-v1.0-deepcompressed");
  Room room;
  room.activities.model = model_in(yolo, ".weights", ".cfg");
  room.activities.classifier = model_in(squeezenet, ".caffemodel", ".prototxt");
  room.activities.scenes_hz = 1;
  auto options = room.localization();
  std::vector<std::string> all;
  for (const auto& drive : {localize_live, localize_serially}) {
    Activities activities(room.activities);
    options.companion = &activities;
    const auto result = drive(room.sequence, options);
    expect_done(activities, poses_of(result));
    EXPECT_GT(find(activities.counts(), "recognize").completed, 0);
    const auto& scenes = activities.scenes();
    EXPECT_EQ(std::ssize(scenes), find(activities.counts(), "describe").completed);
    const auto first = nlohmann::json::parse(scenes.at(0));
    EXPECT_EQ(first["image"], std::to_string(room.sequence.frames[0].time.count()));
    EXPECT_EQ(first["width"], room.options.width);
    EXPECT_TRUE(first["objects"].is_array());
    EXPECT_EQ(first["labels"].size(), 5U);
    all.push_back(scenes.at(0));
  }
  EXPECT_EQ(all[0], all[1]);
}

// From which their time limits follow.
TEST(Activities, AUsersModelsSayWhatTheirCallsTake) {
  PIRT_DATA_OR_SKIP(yolo, "yolo-fastest-1.1");
  ActivityOptions activities;
  activities.width = 320;
  activities.height = 240;
  activities.keyframes = 0;
  activities.model = model_in(yolo, ".weights", ".cfg");
  RuntimeOptions options;
  options.platform = parse_platform("test.yaml", kTwoUnits, {}, 2);
  Activities(activities).list_workloads(options);
  ASSERT_EQ(options.workloads.size(), 2U);
  for (const ServedWorkload& each : options.workloads) {
    const auto& own = std::get<OwnWorkload>(each);
    SCOPED_TRACE(own.name);
    EXPECT_GT(own.expected.at("cpu"), Nanos::zero());
    EXPECT_EQ(own.expected.at("gpu"), own.expected.at("cpu"));
  }
}

/// Computes nothing.
class CountingCaller final : public Caller {
 public:
  void call(std::string_view, const std::vector<Tensor>&, const TaskOptions&, Done done) override {
    ++calls;
    done(std::nullopt);
  }
  int calls = 0;
};

TEST(Activities, AreDueAtOnceAfterAClockThatJumpsAhead) {
  ActivityOptions options;
  options.recognition_hz = 1000;
  options.scenes_hz = 0;
  options.keyframes = 0;
  Activities activities(options);
  CountingCaller caller;
  activities.begin(caller);
  const GreyImage picture{16, 16, std::vector<std::uint8_t>(256, 7)};
  const Nanos later = std::chrono::hours(24 * 365 * 56);  // 1.8e12 periods
  for (const Nanos time : {Nanos(0), later, later + Nanos(1), later + from_ms(1)}) {
    activities.arrived(time, picture);
  }
  EXPECT_EQ(caller.calls, 3);
}

// The robot goes a metre ahead; the body's axes lie anyhow in it, as EuRoC's, whose x points up.
TEST(Activities, AheadIsWhereTheLeftCameraLooks) {
  const Room room;
  const MapPose& start = room.activities.planning->start;
  const Eigen::Vector3d expected(start.position.x + std::cos(start.heading_rad),
                                 start.position.y + std::sin(start.heading_rad), 0);
  Eigen::Matrix3d looking;  // a camera's axes in those of a robot, as columns
  looking << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const auto place_after = [&](const ActivityOptions& options, const std::vector<Pose>& way) {
    Activities activities(options);
    CountingCaller caller;
    activities.begin(caller);
    Nanos time{};
    for (const Pose& body : way) {
      slam::FrameResult frame;
      frame.pose = {time += from_ms(50), body};
      frame.status = slam::Status::kTracking;
      activities.localized(frame, [] { return slam::State(); });
    }
    return Eigen::Vector3d(*activities.map_from_world() * way.back().position);
  };
  auto options = room.activities;
  options.keyframes = 0;
  for (const Eigen::Vector3d& turn : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, -1.5, 0.3)}) {
    const Eigen::Matrix3d robot_from_body = rotation_of(turn);
    Pose& mount = options.setup.cameras[0].body_from_camera;
    mount.rotation = robot_from_body.transpose() * looking;
    const Pose begin{rotation_of({0, 0, 2}) * robot_from_body, {4, -1, 0}};
    Pose end = begin;
    end.position += Eigen::Vector3d(std::cos(2), std::sin(2), 0);
    EXPECT_LT((place_after(options, {begin, end}) - expected).norm(), 1e-9);
    // Without an IMU the world is the body's at the beginning, which the first pose need not be of.
    auto blind = options;
    blind.setup.imu.reset();
    const Eigen::Vector3d ahead = robot_from_body.transpose().col(0);
    EXPECT_LT((place_after(blind, {Pose{.position = ahead}}) - expected).norm(), 1e-9);
  }
}

std::string refusal(const ActivityOptions& options) {
  return test::bad_input([&] { const Activities activities(options); });
}

TEST(Activities, RefuseAModelThatDoesNotDetectBeforeTheyBegin) {
  PIRT_DATA_OR_SKIP(yolo, "yolo-fastest-1.1");
  PIRT_DATA_OR_SKIP(squeezenet, "squeezenet-v1.0-deepcompressed");
  const Room room;
  auto options = room.activities;
  options.model = model_in(yolo, ".weights", ".cfg");
  options.model->names = room.folder.path() / "map.yaml";
  EXPECT_THAT(refusal(options), HasSubstr("80 classes"));
  options.model = model_in(squeezenet, ".caffemodel", ".prototxt");
  EXPECT_THAT(refusal(options), HasSubstr("squeezenet"));
  options.model = model_in(yolo, ".weights", ".cfg");
  options.classifier = options.model;
  EXPECT_THAT(refusal(options), HasSubstr("no classifier"));
}

TEST(Activities, RefuseMapsAndPlacesThatAreNoUse) {
  const Room room;
  auto options = room.activities;
  options.planning->goal = {100, 100};
  EXPECT_THAT(refusal(options), HasSubstr("goal"));
  options = room.activities;
  options.planning->map.unit = planning::Unit::kCells;
  EXPECT_THAT(refusal(options), HasSubstr("metres"));
  options = room.activities;
  options.planning->map.yaw_rad = 0.1;
  EXPECT_THAT(refusal(options), HasSubstr("turned"));
  options = room.activities;
  options.model = recognition::ModelOptions{.model = room.folder.path() / "map.yaml"};
  EXPECT_THAT(refusal(options), HasSubstr("map.yaml"));
}

}  // namespace
}  // namespace pirt
