#include "scheduler/robot/activities.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/mapping/keyframes.h"
#include "workloads/mapping/workloads.h"
#include "workloads/planning/map_files.h"
#include "workloads/planning/path_follower.h"
#include "workloads/planning/prepared_map.h"
#include "workloads/planning/workloads.h"
#include "workloads/recognition/detect_objects.h"
#include "workloads/recognition/scene_workload.h"
#include "workloads/recognition/specs.h"
#include "workloads/slam/workload/specs.h"

namespace pirt {

using planning::Cell;
using planning::Grid;
using planning::Point;

namespace {

constexpr int kAlexnetSide = 227;
constexpr double kWindow_m = 6;
constexpr double kAhead_m = 1;

/// Of the robot's axes, x ahead, y left, z up, which are those of its left camera: a body has any.
Eigen::Matrix3d robot_axes(const Pose& body, const slam::Setup& setup) {
  Eigen::Matrix3d ahead;  // in the camera, as columns
  ahead << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return body.rotation * setup.cameras[0].body_from_camera.rotation * ahead;
}

double heading_of(const Eigen::Matrix3d& axes) { return std::atan2(axes(1, 0), axes(0, 0)); }

double turn_between(double from, double to) {
  return std::remainder(to - from, 2 * std::numbers::pi);
}

/// The picture three times, as red, green and blue.
Tensor coloured(const GreyImage& image) {
  Tensor tensor(
      {.name = "image", .element = Element::kU8, .shape = {3, image.height, image.width}});
  auto out = tensor.as<std::uint8_t>().begin();
  for (int i = 0; i < 3; ++i) out = std::ranges::copy(image.pixels, out).out;
  return tensor;
}

std::vector<Point> corners_of(const std::vector<Cell>& cells, const Grid& grid) {
  std::vector<Point> corners;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const bool is_straight = i > 0 && i + 1 < cells.size() &&
                             cells[i].x - cells[i - 1].x == cells[i + 1].x - cells[i].x &&
                             cells[i].y - cells[i - 1].y == cells[i + 1].y - cells[i].y;
    if (!is_straight) corners.push_back(grid.centre_of(cells[i]));
  }
  return corners;
}

/// Whether something that comes @p hz times a second is due at @p time; sets when it is next.
bool is_due(std::optional<Nanos>& next, Nanos time, double hz) {
  if (!next) next = time;
  if (time < *next) return false;
  const Nanos period = from_s(1 / hz);
  *next += ((time - *next) / period + 1) * period;
  return true;
}

/// What a call of the user's models takes here, from which its time limit follows.
std::map<std::string, Nanos> expected_here(const Platform& platform, Nanos takes) {
  std::map<std::string, Nanos> expected;
  for (const UnitModel& unit : platform.units) {
    if (unit.backend == "cpu") expected.emplace(unit.name, takes);
  }
  return expected;
}

}  // namespace

/// One kind of task, of which one is on its way at a time.
class Activities::Activity {
 public:
  /// @param deadline  0 = none: it is not real-time.
  Activity(std::string workload, Nanos deadline) {
    counts_.name = std::move(workload);
    counts_.deadline = deadline;
  }
  void begin(Caller& caller) { caller_ = &caller; }

  /// Whether one may fire now; counts it as skipped otherwise.
  [[nodiscard]] bool is_free() {
    const std::lock_guard lock(mutex_);
    if (busy_) ++counts_.skipped;
    return !busy_;
  }
  /// @param take  Given the outputs, before the next one may fire.
  void fire(const std::vector<Tensor>& inputs,
            std::function<void(std::span<const Tensor>)> take = {}) {
    {
      const std::lock_guard lock(mutex_);
      busy_ = true;
      ++counts_.fired;
    }
    const Nanos asked = clock_.now();
    TaskOptions options{.real_time = counts_.deadline > Nanos::zero()};
    if (options.real_time) options.deadline = counts_.deadline;
    try {
      caller_->call(counts_.name, inputs, options,
                    [this, asked, take = std::move(take)](auto outputs) {
                      const Nanos took = clock_.now() - asked;
                      std::string problem;
                      try {
                        if (outputs && take) take(*outputs);
                      } catch (const std::exception& error) {
                        problem = error.what();
                      }
                      end(outputs && problem.empty(), took, std::move(problem));
                    });
    } catch (const std::exception& error) {  // It will never be told of.
      end(false, Nanos::zero(), error.what());
    }
  }
  [[nodiscard]] ActivityCounts counts() const {
    const std::lock_guard lock(mutex_);
    return counts_;
  }

 private:
  void end(bool completed, Nanos took, std::string problem) {
    const std::lock_guard lock(mutex_);
    if (counts_.problem.empty()) counts_.problem = std::move(problem);
    busy_ = false;
    ++(completed ? counts_.completed : counts_.failed);
    if (!completed) return;
    counts_.latencies.push_back(took);
    if (counts_.deadline > Nanos::zero() && took > counts_.deadline) ++counts_.late;
  }

  Caller* caller_ = nullptr;
  MachineClock clock_;
  mutable std::mutex mutex_;
  ActivityCounts counts_;
  bool busy_ = false;
};

/// One thread at a time uses its models: neither is that of the recognition.
struct Activities::Describer {
  explicit Describer(const ActivityOptions& options)
      : workload(std::make_shared<const Workload>(recognition::make_describe(
            {*options.model, options.classifier}, options.width, options.height))) {
    const MachineClock clock;
    const Nanos begin = clock.now();
    describe = recognition::open_described(*workload);
    takes = clock.now() - begin;
  }

  std::shared_ptr<const Workload> workload;
  KernelFunction describe;
  Nanos takes{0};  ///< With opening the models.
};

/// What planning knows.
struct Activities::Planned {
  explicit Planned(const ActivityOptions::Planning& options)
      : passable(options.map, options.radius_m), goal(options.map.cell_of(options.goal)) {
    inputs = std::make_shared<const std::vector<Tensor>>(
        planning::plan_inputs(options.map, options.radius_m, goal, goal));
  }

  planning::PreparedMap passable;
  Cell goal;
  std::shared_ptr<const std::vector<Tensor>> inputs;  ///< All but the start are always the same.
  std::optional<Pose> first;                          ///< In the localization's world.
  std::optional<std::pair<MapPose, Nanos>> before;

  std::mutex mutex;  ///< Guards what follows, which plans that end write.
  planning::PathFollower path;
  Plans plans;
};

/// Keyframes on their way.
struct Activities::Mapped {
  explicit Mapped(const slam::Setup& setup) : keyframes(setup) {}

  mapping::Keyframes keyframes;
  std::optional<Pose> last;  ///< Of the newest keyframe.

  std::mutex mutex;  ///< Guards what follows, which jobs that end write.
  AdjustedKeyframes adjusted;
  slam::BetterMap better;           ///< Of the last job, until it is asked for.
  std::optional<Similarity> moved;  ///< The localization's world since it began.
};

Activities::Activities(ActivityOptions options) : options_(std::move(options)) {
  // To find out before it begins whether a model is no detector, or has another one's names.
  const Tensor blank = options_.model ? Tensor(picture_spec()) : Tensor();
  constexpr Nanos kPlan = std::chrono::milliseconds(6);  // the paper's
  constexpr Nanos kAvoid = std::chrono::milliseconds(40);
  if (options_.recognition_hz > 0) {
    if (options_.model) {
      model_ = std::make_shared<recognition::Model>(*options_.model);
      const MachineClock clock;
      const Nanos begin = clock.now();
      static_cast<void>(recognition::detect_objects(*model_, blank, {}));
      recognizing_takes_ = clock.now() - begin;
    }
    recognition_ = std::make_unique<Activity>(model_ ? "recognize" : "alexnet",
                                              from_s(1 / options_.recognition_hz));
  }
  if (options_.scenes_hz > 0) {
    if (options_.model) {
      describer_ = std::make_shared<Describer>(options_);
    }
    scene_ = std::make_unique<Activity>(describer_ ? "describe" : "describe_scene", Nanos::zero());
  }
  if (options_.keyframes > 0) {
    mapped_ = std::make_unique<Mapped>(options_.setup);
    mapping_ = std::make_unique<Activity>("bundle_adjust", Nanos::zero());
  }
  if (!options_.planning) return;
  const Grid& map = options_.planning->map;
  if (map.unit != planning::Unit::kMetres || map.yaw_rad != 0) {
    throw_bad_input("the map to plan on is to be in metres and not turned (origin's yaw 0)");
  }
  planned_ = std::make_unique<Planned>(*options_.planning);
  // Without an IMU the world is the body's when the sequence begins; poses are known later.
  if (!options_.setup.imu) planned_->first = Pose{};
  const auto check = [&](const char* what, Point point) {
    if (planned_->passable.passable(map.cell_of(point))) return;
    throw_bad_input(std::string("the ") + what + " " + std::to_string(point.x) + "," +
                    std::to_string(point.y) +
                    " is not on the map's free ground, or nearer to an obstacle than the robot's "
                    "radius");
  };
  check("goal", options_.planning->goal);
  if (!map.contains(map.cell_of(options_.planning->start.position))) {
    throw_bad_input("the start is not on the map; --start is X,Y,DEGREES in metres on the map");
  }
  planning_ = std::make_unique<Activity>("plan_path", kPlan);
  avoiding_ = std::make_unique<Activity>("avoid_obstacles", kAvoid);
}

Activities::~Activities() = default;

TensorSpec Activities::picture_spec() const {
  return {"image", Element::kU8, {3, options_.height, options_.width}};
}

void Activities::list_workloads(RuntimeOptions& options) const {
  if (planning_) {
    options.workloads.emplace_back("plan_path");
    options.workloads.emplace_back("avoid_obstacles");
    options.first_inputs["plan_path"] = planned_->inputs;
  }
  if (mapping_) options.workloads.emplace_back("bundle_adjust");
  const TensorSpec image = picture_spec();
  if (recognition_ && !model_) options.workloads.emplace_back("alexnet");
  if (recognition_ && model_) {
    const auto recognize = [model = model_](std::span<const Tensor> inputs,
                                            std::span<Tensor> outputs) {
      const auto objects = recognition::detect_objects(*model, inputs[0], {});
      outputs[0].as<std::int32_t>()[0] = static_cast<std::int32_t>(objects.size());
    };
    options.workloads.emplace_back(
        OwnWorkload{.name = "recognize",
                    .inputs = {image},
                    .outputs = {{"objects", Element::kI32, {1}}},
                    .kernels = {{"cpu", recognize}},
                    .expected = expected_here(options.platform, recognizing_takes_)});
  }
  if (scene_ && !describer_) options.workloads.emplace_back("describe_scene");
  if (scene_ && describer_) {
    // A worker in the cloud may have the same models.
    const Workload& describe = *describer_->workload;
    options.workloads.emplace_back(
        OwnWorkload{.name = describe.name,
                    .inputs = describe.inputs,
                    .outputs = describe.outputs,
                    .kernels = {{"cpu", describer_->describe}},
                    .expected = expected_here(options.platform, describer_->takes),
                    .known_as = describer_->workload});
  }
}

void Activities::begin(Caller& caller) {
  for (const auto& each : {&recognition_, &scene_, &planning_, &avoiding_, &mapping_}) {
    if (*each) (*each)->begin(caller);
  }
}

void Activities::arrived(Nanos time, const GreyImage& left) {
  const auto due = [&](const std::unique_ptr<Activity>& activity, std::optional<Nanos>& next,
                       double hz) {
    return activity != nullptr && is_due(next, time, hz) && activity->is_free();
  };
  if (due(recognition_, next_recognition_, options_.recognition_hz)) recognize(left);
  if (due(scene_, next_scene_, options_.scenes_hz)) describe(time, left);
}

void Activities::recognize(const GreyImage& picture) {
  Tensor image = coloured(picture);
  std::vector<Tensor> inputs;
  if (model_) {
    inputs.push_back(std::move(image));
  } else {
    inputs.emplace_back(TensorSpec{"input", Element::kF32, {3, kAlexnetSide, kAlexnetSide}});
    std::ranges::copy(
        recognition::network_input(image, kAlexnetSide, kAlexnetSide, recognition::Fit::kCrop,
                                   recognition::Preprocess::kImagenet),
        inputs[0].as<float>().begin());
  }
  recognition_->fire(inputs);
}

void Activities::describe(Nanos time, const GreyImage& picture) {
  Tensor image = coloured(picture);
  std::vector<Tensor> inputs;
  if (!describer_) {
    constexpr int kWidth = recognition::kPictureWidth, kHeight = recognition::kPictureHeight;
    const auto pixels = recognition::network_input(image, kWidth, kHeight, recognition::Fit::kCrop,
                                                   recognition::Preprocess::kUnit);
    inputs.emplace_back(TensorSpec{"image", Element::kU8, {3, kHeight, kWidth}});
    std::ranges::transform(pixels, inputs[0].as<std::uint8_t>().begin(), [](float pixel) {
      return static_cast<std::uint8_t>(std::lround(255 * pixel));
    });
    scene_->fire(inputs);
    return;
  }
  inputs.push_back(std::move(image));
  inputs.emplace_back(describer_->workload->inputs[1]);
  recognition::set_text(inputs[1], std::to_string(time.count()));
  scene_->fire(inputs, [this](std::span<const Tensor> outputs) {
    scenes_.push_back(recognition::text_of(outputs[0]));
  });
}

void Activities::localized(const slam::FrameResult& frame,
                           const std::function<slam::State()>& state) {
  if (frame.in_map && !std::exchange(in_map_, true)) change_world(state().map_from_start);
  // What is real-time first: a unit that has begun an adjustment is not preempted.
  if (planned_ && frame.status != slam::Status::kStarting) {
    const MapPose place = place_of(frame.pose.body);
    plan(place, frame.pose.time);
    avoid(place, frame.pose.time);
  }
  if (frame.status == slam::Status::kTracking && mapped_) map(frame, state);
}

/// What was known of the world in which the localization began is of the map's that it found.
void Activities::change_world(const Similarity& moved) {
  if (planned_ && planned_->first) planned_->first = pirt::moved(moved, *planned_->first);
  if (!mapped_) return;
  mapped_->keyframes = mapping::Keyframes(options_.setup);
  mapped_->last.reset();
  const std::lock_guard lock(mapped_->mutex);
  mapped_->moved = moved;
  for (auto* poses : {&mapped_->adjusted.before, &mapped_->adjusted.after}) {
    for (StampedPose& pose : *poses) pose.body = pirt::moved(moved, pose.body);
  }
}

MapPose Activities::place_of(const Pose& body) {
  if (!planned_->first) planned_->first = body;
  const Pose on_map = *map_from_world() * body;
  return {{on_map.position.x(), on_map.position.y()},
          heading_of(robot_axes(on_map, options_.setup))};
}

/// A robot that stands nearer to an obstacle than its radius plans from where it does not.
void Activities::plan(const MapPose& place, Nanos time) {
  if (!planning_->is_free()) return;
  const Grid& map = options_.planning->map;
  const auto start = planned_->passable.nearest_passable(map.cell_of(place.position));
  std::vector<Tensor> inputs;
  for (const Tensor& input : *planned_->inputs) inputs.push_back(input.share());
  inputs[2] = Tensor(inputs[2].spec());
  inputs[2].as<std::int32_t>()[0] = start->x;
  inputs[2].as<std::int32_t>()[1] = start->y;
  planning_->fire(inputs, [this, time](std::span<const Tensor> outputs) {
    const planning::Path path = planning::path_of(outputs);
    const std::lock_guard lock(planned_->mutex);
    planned_->path = {};
    if (path.status != planning::PathStatus::kFound) return;
    const Grid& grid = options_.planning->map;
    ++planned_->plans.found;
    planned_->plans.last_m = path.length * grid.resolution;
    std::vector<Point> centres;
    for (const Cell cell : path.cells) centres.push_back(grid.centre_of(cell));
    auto& paths = planned_->plans.paths;
    if (paths.empty() || time - paths.back().time >= std::chrono::seconds(1)) {
      paths.push_back({time, corners_of(path.cells, grid)});
    }
    planned_->path = planning::PathFollower(std::move(centres));
  });
}

void Activities::avoid(const MapPose& place, Nanos time) {
  const auto before = std::exchange(planned_->before, std::pair(place, time));
  Point target;
  {
    const std::lock_guard lock(planned_->mutex);
    if (planned_->path.empty() || !before || !avoiding_->is_free()) return;
    target = planned_->path.ahead(place.position, kAhead_m);
  }
  const double dt = std::max(to_s(time - before->second), 1e-3);
  const double dx = place.position.x - before->first.position.x;
  const double dy = place.position.y - before->first.position.y;
  const double forward = std::cos(place.heading_rad) * dx + std::sin(place.heading_rad) * dy;
  const planning::RobotState robot{place.position, place.heading_rad, forward / dt,
                                   turn_between(before->first.heading_rad, place.heading_rad) / dt};
  const Grid& map = options_.planning->map;
  const double side = std::min(kWindow_m, (planning::kWindowSide - 2) * map.resolution);
  avoiding_->fire(
      planning::avoid_inputs(robot, planning::window_of(map, place.position, side), {}, target));
}

void Activities::map(const slam::FrameResult& frame, const std::function<slam::State()>& state) {
  // A copy of the state only where it becomes a keyframe.
  const mapping::KeyframeOptions least;
  const Pose& body = frame.pose.body;
  if (mapped_->last && (body.position - mapped_->last->position).norm() < least.least_move_m &&
      angle_of(mapped_->last->rotation.transpose() * body.rotation) < least.least_turn_rad) {
    return;
  }
  if (!mapped_->keyframes.add(state())) return;
  mapped_->last = body;
  if (mapped_->keyframes.all().size() < options_.keyframes || !mapping_->is_free()) return;
  const auto batch = std::make_shared<const mapping::Keyframes>(
      std::exchange(mapped_->keyframes, mapping::Keyframes(options_.setup)));
  auto problem = std::make_shared<mapping::BalProblem>(batch->problem());
  mapping_->fire(mapping::bundle_inputs(*problem, {}, batch->priors(), batch->relative()),
                 [this, batch, problem, in_map = in_map_](std::span<const Tensor> outputs) {
                   mapping::take_outputs(outputs, *problem);
                   auto refined = batch->refined(*problem);
                   const std::lock_guard lock(mapped_->mutex);
                   const auto add = [&](std::vector<StampedPose>& poses, StampedPose pose) {
                     if (!in_map && mapped_->moved) pose.body = moved(*mapped_->moved, pose.body);
                     poses.push_back(pose);
                   };
                   auto& [before, after] = mapped_->adjusted;
                   for (const auto& each : batch->all()) add(before, each.pose);
                   for (const auto& each : refined.keyframes) add(after, each);
                   if (!options_.corrects_map) return;
                   if (refined.points.size() > slam::kMostBetter) {
                     refined.points.resize(slam::kMostBetter);
                   }
                   mapped_->better = mapping::better_map(refined, in_map);
                 });
}

slam::BetterMap Activities::better_map() {
  if (!mapped_) return {};
  const std::lock_guard lock(mapped_->mutex);
  return std::exchange(mapped_->better, {});
}

AdjustedKeyframes Activities::adjusted() const {
  return mapped_ ? mapped_->adjusted : AdjustedKeyframes{};
}

std::vector<ActivityCounts> Activities::counts() const {
  std::vector<ActivityCounts> counts;
  for (const auto& each : {&recognition_, &scene_, &planning_, &avoiding_, &mapping_}) {
    if (*each) counts.push_back((*each)->counts());
  }
  return counts;
}

Plans Activities::plans() const { return planned_ ? planned_->plans : Plans{}; }

std::optional<Pose> Activities::map_from_world() const {
  if (!planned_ || !planned_->first) return std::nullopt;
  const MapPose& start = options_.planning->start;
  const Pose& first = *planned_->first;
  Pose pose;
  const Eigen::Matrix3d axes = robot_axes(first, options_.setup);
  const Eigen::Matrix3d level = options_.setup.imu ? rotation_of({0, 0, -heading_of(axes)})
                                                   : Eigen::Matrix3d(axes.transpose());
  pose.rotation = rotation_of({0, 0, start.heading_rad}) * level;
  pose.position =
      Eigen::Vector3d(start.position.x, start.position.y, 0) - pose.rotation * first.position;
  return pose;
}

}  // namespace pirt
