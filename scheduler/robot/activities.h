// A whole robot beside its localization: a planner that plans anew with each pose, a local planner
// that gives velocity commands, recognition at a rate of its own, and keyframes that are adjusted.
//
// Poses are brought into the map's frame by where the robot stood on the map when it began; the
// recorded robot goes its own way, whatever the commands say.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "scheduler/robot/companion.h"
#include "workloads/planning/avoid_obstacles.h"
#include "workloads/planning/plan_path.h"
#include "workloads/recognition/model.h"

namespace pirt {

/// Where a robot stands on a map.
struct MapPose {
  planning::Point position;
  double heading_rad = 0;  ///< Counter-clockwise from the x axis.
};

struct ActivityOptions {
  struct Planning {
    planning::Grid map;  ///< Of unit kMetres, with yaw 0.
    MapPose start;       ///< When the sequence begins; it heads where its left camera looks.
    planning::Point goal;
    double radius_m = 0.25;
  };
  std::optional<Planning> planning = {};
  int width = 0, height = 0;  ///< Of the pictures.
  double recognition_hz = 3;  ///< 0 = none.
  /// Keyframes that are adjusted at a time; 0 = none. Units are not preempted: on one that also
  /// localizes, more would hold up frames.
  std::size_t keyframes = 15;
  bool corrects_map =
      true;  ///< The points that are adjusted replace those of the localization's map.
  slam::Setup setup = {};  ///< Of the localization, for them.
  double scenes_hz = 0.1;  ///< How often what is seen is described; 0 = never.
  /// A detector of the user's; absent = the chain of AlexNet and the catalogue's description, both
  /// with seeded weights, for their time.
  std::optional<recognition::ModelOptions> model = {};
  std::optional<recognition::ModelOptions> classifier =
      {};  ///< With a detector: scenes have labels.
};

/// Keyframes before they were adjusted and after, as many and in the same order.
struct AdjustedKeyframes {
  std::vector<StampedPose> before, after;
};

/// What was planned, on the map: the corners of the path, in metres.
struct PlannedPath {
  Nanos time{};  ///< Of the pose that it begins at.
  std::vector<planning::Point> corners;
};

/// What the plans have found.
struct Plans {
  std::int64_t found = 0;               ///< With a path.
  double last_m = 0;                    ///< Length of the last one's, in metres.
  std::vector<PlannedPath> paths = {};  ///< At most one a second.
};

/// What became of one kind of task.
struct ActivityCounts {
  std::string name;   ///< "plan_path".
  Nanos deadline{0};  ///< From when it is asked for; 0 = none.
  std::int64_t fired = 0, completed = 0, failed = 0;
  std::int64_t skipped = 0;  ///< Were due while the one before had not ended.
  std::int64_t late = 0;     ///< Completed past the deadline.
  std::string problem;       ///< Of the first whose outputs were no use; empty = none.
  std::vector<Nanos> latencies;
};

class Activities final : public Companion {
 public:
  /// @throws Error{kBadInput} for a map that planning cannot use (its size, unit or yaw, a start or
  /// goal that is not on free ground), or a model that is none or does not detect.
  explicit Activities(ActivityOptions options);
  ~Activities() override;

  void list_workloads(RuntimeOptions& options) const override;
  void begin(Caller& caller) override;
  void arrived(Nanos time, const GreyImage& left) override;
  void localized(const slam::FrameResult& frame,
                 const std::function<slam::State()>& state) override;
  slam::BetterMap better_map() override;

  /// Once all has ended.
  [[nodiscard]] std::vector<ActivityCounts> counts() const;
  [[nodiscard]] Plans plans() const;
  /// The localization's world on the map; absent if nothing is planned, or, with an IMU, before the
  /// first pose.
  [[nodiscard]] std::optional<Pose> map_from_world() const;
  /// All that came back.
  [[nodiscard]] AdjustedKeyframes adjusted() const;
  /// By the user's models, in the order in which they came back: lines of JSON as pirt describe
  /// writes them, an "image" named by its time in ns.
  [[nodiscard]] const std::vector<std::string>& scenes() const { return scenes_; }

 private:
  class Activity;
  struct Describer;
  struct Planned;
  struct Mapped;
  [[nodiscard]] TensorSpec picture_spec() const;
  [[nodiscard]] MapPose place_of(const Pose& body);
  void change_world(const Similarity& moved);
  void recognize(const GreyImage& image);
  void describe(Nanos time, const GreyImage& image);
  void plan(const MapPose& place, Nanos time);
  void avoid(const MapPose& place, Nanos time);
  void map(const slam::FrameResult& frame, const std::function<slam::State()>& state);

  ActivityOptions options_;
  std::shared_ptr<recognition::Model> model_;
  Nanos recognizing_takes_{0};            ///< By the model, as it was called first.
  std::shared_ptr<Describer> describer_;  ///< Of the user's models; null: the catalogue's.
  std::unique_ptr<Planned> planned_;      ///< Null: nothing is planned.
  std::unique_ptr<Mapped> mapped_;        ///< Null: no keyframes.
  std::unique_ptr<Activity> recognition_, scene_, planning_, avoiding_, mapping_;
  std::optional<Nanos> next_recognition_, next_scene_;
  bool in_map_ = false;              ///< The localization is in the world of a map that it found.
  std::vector<std::string> scenes_;  ///< One description is on its way at a time.
};

}  // namespace pirt
