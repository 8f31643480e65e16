#include "workloads/inputs/sequence/recorded_topics.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/recorded_picture.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/sequence/recorded.h"
#include "workloads/inputs/sequence/recorded_imu.h"

namespace pirt {
namespace {

constexpr const char* kNone = "none";

class TopicChoice {
 public:
  TopicChoice(const Recording& recording, const ReadOptions& options,
              const RecordedCalibrations& calibrations, std::vector<std::string>& warnings)
      : recording_(recording),
        options_(options),
        chosen_(options.topics),
        calibrations_(calibrations),
        warnings_(warnings) {}

  RecordedTopics choose() {
    const bool is_mono = chosen_.right == kNone || !options_.second_camera;
    if (chosen_.left) {
      found_.cameras = {checked(*chosen_.left, picture_types())};
      if (chosen_.right && !is_mono) {
        found_.cameras.push_back(checked(*chosen_.right, picture_types()));
      }
    } else {
      found_.cameras = find_cameras();
      if (is_mono) found_.cameras.resize(1);
    }
    found_.imus = find_imu();
    found_.truth = find_truth();
    return found_;
  }

 private:
  [[nodiscard]] const Topic& topic(std::size_t i) const { return recording_.topics()[i]; }
  [[noreturn]] void fail(const std::string& problem) const {
    throw_bad_input("'" + recording_.file() + "' " + problem);
  }

  [[nodiscard]] std::size_t checked(const std::string& name,
                                    const std::vector<std::string_view>& types) const {
    const std::size_t found = recording_.topic(name, types);
    if (std::ranges::find(types, topic(found).type) == types.end()) {
      fail(fmt::format("has {} as {}, and {} is needed", name, topic(found).type, types.front()));
    }
    if (!topic(found).is_readable()) {
      fail(fmt::format("has {} encoded as '{}', and cdr or ros1 is needed", name,
                       topic(found).encoding));
    }
    if (topic(found).messages == 0) fail("has no message of " + name);
    return found;
  }

  [[nodiscard]] static const std::vector<std::string_view>& picture_types() {
    static const std::vector<std::string_view> types = {ImageMessage::kType,
                                                        ImageMessage::kCompressedType};
    return types;
  }

  /// The one or two topics with pictures, by what their first messages are.
  [[nodiscard]] std::vector<std::size_t> find_cameras() {
    const std::vector<std::size_t> found = picture_topics(recording_);
    if (found.empty()) {
      // What was left out of it says why.
      fail("has no pictures: no topic of sensor_msgs/Image or CompressedImage; it has " +
           recording_.describe() + (recording_.warnings().empty() ? "" : "; ") +
           join(recording_.warnings(), "; "));
    }
    if (found.size() == 1) return found;
    std::vector<std::size_t> readable, usable;
    std::vector<std::string> names, left_out;
    for (const std::size_t each : found) {
      const std::string why_not = no_pictures(recording_, each);
      if (why_not.empty()) {
        readable.push_back(each);
      } else {
        left_out.push_back(topic(each).name + " " + why_not);
      }
    }
    for (const std::size_t each : readable) {
      const std::string why_not = no_camera(each, readable);
      if (why_not.empty()) {
        usable.push_back(each);
        names.push_back(topic(each).name);
      } else {
        left_out.push_back(topic(each).name + " " + why_not);
      }
    }
    if (usable.empty()) fail("has no pictures that can be used: " + join(left_out, ", "));
    if (usable.size() > 2) {
      fail(fmt::format("has {} topics with pictures; choose: --topics left={},right={}: {}",
                       usable.size(), names[0], names[1], join(names, ", ")));
    }
    if (!left_out.empty()) {
      warnings_.push_back(fmt::format("pictures are those of {}; not used: {}",
                                      join(names, " and "), join(left_out, ", ")));
    }
    return usable;
  }

  /// Why one of several topics with pictures is not to be taken; empty = it may be.
  [[nodiscard]] std::string no_camera(std::size_t id, const std::vector<std::size_t>& all) const {
    // Of one camera's topics the plainest is taken that has its pictures.
    std::vector<std::size_t> plainer;
    std::size_t fullest = id;
    for (const std::size_t other : all) {
      const bool is_plainer = is_same_camera(topic(other).name, topic(id).name);
      if (!is_plainer && !is_same_camera(topic(id).name, topic(other).name)) continue;
      if (is_plainer) plainer.push_back(other);
      if (topic(other).messages > topic(fullest).messages) fullest = other;
    }
    const auto lacks = [&](std::size_t each) {
      return 2 * topic(each).messages < topic(fullest).messages;
    };
    if (lacks(id)) {
      return fmt::format("has {} pictures where {} has {}", topic(id).messages, topic(fullest).name,
                         topic(fullest).messages);
    }
    for (const std::size_t other : plainer) {
      if (!lacks(other)) return "shows " + topic(other).name;
    }
    if (calibrations_.are_given()) return "";
    const bool any_info = std::ranges::any_of(all, [this](std::size_t each) {
      return calibrations_.info_of(topic(each).name).has_value();
    });
    return calibrations_.info_of(topic(id).name) || !any_info ? "" : "has no camera_info";
  }

  /// One topic, or the gyroscope's and the accelerometer's; none if there is no IMU.
  [[nodiscard]] std::vector<std::size_t> find_imu() const {
    if (!options_.imu || chosen_.imu == kNone) return {};
    if (!chosen_.imu) {
      return imu_among(recording_, recording_.of_type(ImuMessage::kType), false, warnings_);
    }
    std::vector<std::size_t> named;
    for (const auto& name : split(*chosen_.imu, '+')) {
      named.push_back(checked(name, {ImuMessage::kType}));
    }
    return imu_among(recording_, named, true, warnings_);
  }

  /// The one of the left camera's robot, whose name theirs begin with.
  [[nodiscard]] std::size_t truth_of_several(const std::vector<std::size_t>& all) const {
    const auto robot_of = [this](std::size_t id) {
      const std::string& name = topic(id).name;
      return name.substr(0, name.find('/', 1));
    };
    std::vector<std::size_t> same;
    std::vector<std::string> names;
    for (const std::size_t each : all) {
      names.push_back(topic(each).name);
      if (robot_of(each) == robot_of(found_.cameras.front())) same.push_back(each);
    }
    if (same.size() == 1) return same.front();
    fail(
        fmt::format("has {} topics that could be truth; choose one: --topics truth={}, or none: {}",
                    all.size(), names.front(), join(names, ", ")));
  }

  /// What has truth in its name, else a PoseStamped by its type alone: others may be what a robot
  /// believes of itself.
  [[nodiscard]] std::optional<std::size_t> find_truth() {
    const std::vector<std::string_view> types = {PoseMessage::kType, PoseMessage::kWithCovariance,
                                                 PoseMessage::kOdometry, PoseMessage::kTransform};
    if (chosen_.truth == kNone) return std::nullopt;
    if (chosen_.truth) return checked(*chosen_.truth, types);
    if (!options_.truth.empty()) return std::nullopt;
    const auto has = [this](std::size_t id, const char* word) {
      return topic(id).name.find(word) != std::string::npos;
    };
    std::vector<std::size_t> found;
    std::vector<std::string> plain;
    for (const auto type : types) {
      for (const std::size_t each : recording_.of_type(type)) {
        if (has(each, "truth")) found.push_back(each);
      }
    }
    const bool is_named = !found.empty();
    if (found.size() > 1) found = {truth_of_several(found)};
    for (const std::size_t each : recording_.of_type(PoseMessage::kType)) {
      // A PoseStamped is also where a robot is to go.
      const bool is_wish =
          std::ranges::any_of(std::array{"goal", "setpoint", "target", "cmd", "command"},
                              [&](const char* word) { return has(each, word); });
      if (is_wish || has(each, "truth")) continue;
      found.push_back(each);
      plain.push_back(topic(each).name);
    }
    if (found.empty()) return std::nullopt;
    if (!is_named && plain.size() > 1) {
      fail(fmt::format("has {} topics of {}; choose one: --topics truth={}, or none: {}",
                       plain.size(), PoseMessage::kType, plain.front(), join(plain, ", ")));
    }
    if (!plain.empty()) {
      warnings_.push_back(fmt::format(
          "truth is taken to be {}{}; another one, or none: --topics truth=TOPIC",
          topic(found.front()).name, is_named ? ", not " + join(plain, ", ") : ", by its type"));
    }
    return found.front();
  }

  const Recording& recording_;
  const ReadOptions& options_;
  const SequenceTopics& chosen_;
  const RecordedCalibrations& calibrations_;
  std::vector<std::string>& warnings_;
  RecordedTopics found_;
};

}  // namespace

SequenceTopics parse_topics(const std::string& text) {
  SequenceTopics topics;
  const std::vector<std::string> known = {"left", "right", "imu", "truth"};
  for (const auto& part : split(text, ',')) {
    const auto equals = part.find('=');
    const std::string key = part.substr(0, equals);
    if (equals == std::string::npos || equals + 1 == part.size() ||
        std::ranges::find(known, key) == known.end()) {
      throw_bad_input(
          "--topics is left=TOPIC,right=TOPIC,imu=TOPIC,truth=TOPIC, each of them or "
          "some, with none for without it; got '" +
          part + "'" + (equals == std::string::npos ? "" : suggestion(key, known)));
    }
    auto& topic = key == "left"    ? topics.left
                  : key == "right" ? topics.right
                  : key == "imu"   ? topics.imu
                                   : topics.truth;
    topic = part.substr(equals + 1);
  }
  if (topics.left == kNone) throw_bad_input("--topics left=none leaves no camera");
  if (topics.right && topics.right == topics.left) {
    throw_bad_input("--topics names one topic as left and right; name two, or right=none");
  }
  if (topics.right && !topics.left && topics.right != kNone) {
    throw_bad_input("--topics names the right camera's topic; name the left one's, too");
  }
  return topics;
}

RecordedTopics find_topics(const Recording& recording, const ReadOptions& options,
                           const RecordedCalibrations& calibrations,
                           std::vector<std::string>& warnings) {
  return TopicChoice(recording, options, calibrations, warnings).choose();
}

}  // namespace pirt
