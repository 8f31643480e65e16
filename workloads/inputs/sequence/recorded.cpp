#include "workloads/inputs/sequence/recorded.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <opencv2/core.hpp>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/recorded_picture.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/sequence/imu_check.h"

namespace pirt {
namespace {

constexpr const char* kNone = "none";

/// Where frames of coordinates are in each other.
class Transforms {
 public:
  explicit Transforms(const Recording& recording) {
    for (const std::size_t topic : recording.of_type(TransformMessage::kType)) {
      // What moves is no place of a sensor.
      if (!recording.topics()[topic].name.ends_with("tf_static")) continue;
      for (std::size_t i = 0; i < recording.topics()[topic].messages; ++i) {
        const std::string bytes = recording.message(topic, i);
        auto in = recording.reader(topic, i, bytes);
        for (const auto& each : read_transforms(in)) {
          parents_[plain(each.child)] = {plain(each.head.frame), each.parent_from_child};
        }
      }
    }
  }

  /// Nothing if no transforms lead from one to the other.
  [[nodiscard]] std::optional<Pose> between(const std::string& to, const std::string& from) const {
    if (plain(to) == plain(from)) return Pose{};
    const auto [to_root, root_from_to] = root_of(plain(to));
    const auto [from_root, root_from_from] = root_of(plain(from));
    if (to_root != from_root) return std::nullopt;
    return root_from_to.inverse() * root_from_from;
  }

 private:
  /// ROS 1 had frames with a slash in front.
  static std::string plain(const std::string& frame) {
    return frame.starts_with('/') ? frame.substr(1) : frame;
  }
  [[nodiscard]] std::pair<std::string, Pose> root_of(std::string frame) const {
    Pose pose;
    for (std::size_t steps = 0; steps <= parents_.size(); ++steps) {  // a circle ends, too
      const auto parent = parents_.find(frame);
      if (parent == parents_.end()) break;
      frame = parent->second.first;
      pose = parent->second.second * pose;
    }
    return {frame, pose};
  }

  std::map<std::string, std::pair<std::string, Pose>> parents_;
};

/// Empty for one that is in none.
std::string folder_of(const std::string& topic) {
  const auto slash = topic.rfind('/');
  return slash == std::string::npos ? "" : topic.substr(0, slash);
}

/// One camera's messages.
struct Camera {
  std::size_t topic = 0;
  bool compressed = false;
  std::string frame;  ///< Of coordinates.
  CameraModel model;
  double right_of_left_m = 0;  ///< What its projection says, of rectified pairs.
  std::vector<std::pair<Nanos, std::size_t>> pictures;  ///< Stamp, message.
};

class Reader {
 public:
  Reader(std::shared_ptr<const Recording> recording, const SequenceTopics& topics)
      : recording_(std::move(recording)), chosen_(topics), transforms_(*recording_) {}

  Sequence read() {
    sequence_.name = recording_->file();
    read_cameras();
    read_inertial();
    place_cameras();
    make_frames();
    read_truth();
    std::ranges::move(gaps_of(sequence_), std::back_inserter(sequence_.warnings));
    return std::move(sequence_);
  }

 private:
  [[nodiscard]] const Topic& topic(std::size_t i) const { return recording_->topics()[i]; }
  [[noreturn]] void fail(const std::string& problem) const {
    throw_bad_input("'" + recording_->file() + "' " + problem);
  }

  /// The topic that was chosen, or the only one of the type.
  [[nodiscard]] std::optional<std::size_t> one_of(const std::optional<std::string>& chosen,
                                                  std::string_view type, const char* what) const {
    if (chosen == kNone) return std::nullopt;
    if (chosen) return checked(*chosen, {type});
    const auto found = recording_->of_type(type);
    if (found.size() > 1) {
      std::vector<std::string> names;
      for (const auto each : found) names.push_back(topic(each).name);
      fail(fmt::format("has {} topics of {}; choose one: --topics {}={}, or none: {}", found.size(),
                       type, what, names.front(), join(names, ", ")));
    }
    return found.empty() ? std::nullopt : std::optional(found.front());
  }

  [[nodiscard]] std::size_t checked(const std::string& name,
                                    const std::vector<std::string_view>& types) const {
    const std::size_t found = recording_->topic(name);
    if (std::ranges::find(types, topic(found).type) == types.end()) {
      fail(fmt::format("has {} as {}, and {} is needed", name, topic(found).type, types.front()));
    }
    if (topic(found).messages == 0) fail("has no message of " + name);
    return found;
  }

  void read_cameras() {
    auto found = recording_->of_type(ImageMessage::kType);
    std::ranges::copy(recording_->of_type(ImageMessage::kCompressedType),
                      std::back_inserter(found));
    std::ranges::sort(found);
    std::vector<std::size_t> topics;
    const std::vector<std::string_view> types = {ImageMessage::kType,
                                                 ImageMessage::kCompressedType};
    if (chosen_.left) {
      topics.push_back(checked(*chosen_.left, types));
      if (chosen_.right && chosen_.right != kNone) topics.push_back(checked(*chosen_.right, types));
    } else {
      if (found.empty()) fail("has no pictures: no topic of sensor_msgs/Image or CompressedImage");
      if (found.size() > 2) {
        std::vector<std::string> names;
        for (const auto each : found) names.push_back(topic(each).name);
        fail(fmt::format("has {} topics with pictures; choose: --topics left={},right={}: {}",
                         found.size(), names[0], names[1], join(names, ", ")));
      }
      topics = found;
      if (chosen_.right == kNone) topics.erase(topics.begin() + 1, topics.end());
    }
    for (const std::size_t each : topics) cameras_.push_back(read_camera(each));
  }

  Camera read_camera(std::size_t topic_id) {
    Camera camera;
    camera.topic = topic_id;
    camera.compressed = topic(topic_id).type == ImageMessage::kCompressedType;
    for (std::size_t i = 0; i < topic(topic_id).messages; ++i) {
      const std::string bytes = recording_->message(topic_id, i);
      auto in = recording_->reader(topic_id, i, bytes);
      const auto image = read_image(in, camera.compressed);
      if (i == 0) camera.frame = image.head.frame;
      camera.pictures.emplace_back(image.head.time, i);
    }
    keep_rising(camera.pictures, topic(topic_id).name, [](const auto& each) { return each.first; });
    calibrate(camera);
    if (camera.pictures.size() > 1) {
      const Nanos span = camera.pictures.back().first - camera.pictures.front().first;
      camera.model.rate_hz = static_cast<double>(camera.pictures.size() - 1) / to_s(span);
    }
    return camera;
  }

  void calibrate(Camera& camera) {
    const std::string& name = topic(camera.topic).name;
    std::optional<std::size_t> info;
    // image_transport has the compressed one a level below.
    const std::string beside = folder_of(name);
    for (const std::string& folder : {folder_of(beside), beside}) {
      for (const std::size_t each : recording_->of_type(CameraInfoMessage::kType)) {
        if (topic(each).name == folder + "/camera_info") info = each;
      }
    }
    if (!info) {
      fail(fmt::format("has no calibration of {}: no sensor_msgs/CameraInfo on {}/camera_info",
                       name, folder_of(name)));
    }
    const std::string bytes = recording_->message(*info, 0);
    auto in = recording_->reader(*info, 0, bytes);
    const auto message = read_camera_info(in);
    CameraModel& model = camera.model;
    model.width = message.width, model.height = message.height;
    model.fx = message.k[0], model.fy = message.k[4], model.cx = message.k[2],
    model.cy = message.k[5];
    if (model.width < 16 || model.height < 16 || !(model.fx >= 10) || !(model.fy >= 10) ||
        !(model.cx >= 0 && model.cx <= model.width) ||
        !(model.cy >= 0 && model.cy <= model.height)) {
      in.fail("is no calibration: fx and fy are at least 10 pixels, cx and cy in the picture");
    }
    std::vector<double> lens = message.d;
    while (!lens.empty() && lens.back() == 0) lens.pop_back();
    if (lens.size() > 4 || (!lens.empty() && message.distortion_model != "plumb_bob")) {
      in.fail(fmt::format("has lens '{}' with {} coefficients; only plumb_bob with 4 is known",
                          message.distortion_model, lens.size()));
    }
    lens.resize(4, 0);
    model.k1 = lens[0], model.k2 = lens[1], model.p1 = lens[2], model.p2 = lens[3];
    if (message.p[0] > 0) camera.right_of_left_m = -message.p[3] / message.p[0];
  }

  void read_inertial() {
    const auto found = one_of(chosen_.imu, ImuMessage::kType, "imu");
    if (!found) return;
    std::string frame;
    std::vector<ImuSample> samples;
    for (std::size_t i = 0; i < topic(*found).messages; ++i) {
      const std::string bytes = recording_->message(*found, i);
      auto in = recording_->reader(*found, i, bytes);
      const auto message = ::pirt::read_imu(in);
      if (i == 0) frame = message.head.frame;
      samples.push_back({message.head.time, message.gyro_rad_s, message.accel_m_s2});
    }
    if (!transforms_.between(frame, cameras_.front().frame)) {
      sequence_.warnings.push_back(
          fmt::format("{} is not used: no transform of /tf_static leads from {} to {}, so that "
                      "nobody knows where the IMU sits",
                      topic(*found).name, cameras_.front().frame, frame));
      return;
    }
    keep_rising(samples, topic(*found).name, [](const ImuSample& sample) { return sample.time; });
    body_ = frame;
    sequence_.imu = std::move(samples);
    check_imu("'" + recording_->file() + "': " + topic(*found).name, sequence_.imu);
    ImuModel& model = sequence_.imu_model.emplace();
    const Nanos span = sequence_.imu.back().time - sequence_.imu.front().time;
    if (span > Nanos::zero()) {
      model.rate_hz = static_cast<double>(sequence_.imu.size() - 1) / to_s(span);
    }
  }

  void place_cameras() {
    if (body_.empty()) body_ = cameras_.front().frame;
    cameras_.front().model.body_from_camera = *transforms_.between(body_, cameras_.front().frame);
    if (cameras_.size() > 1) {
      Camera& right = cameras_[1];
      if (right.frame != cameras_.front().frame && transforms_.between(body_, right.frame)) {
        right.model.body_from_camera = *transforms_.between(body_, right.frame);
      } else if (right.right_of_left_m > 0) {
        Pose beside;
        beside.position.x() = right.right_of_left_m;
        right.model.body_from_camera = cameras_.front().model.body_from_camera * beside;
      } else {
        sequence_.warnings.push_back(
            topic(right.topic).name +
            " is not used: neither /tf_static nor its projection says where the camera sits");
        cameras_.resize(1);
      }
    }
    for (const Camera& camera : cameras_) sequence_.cameras.push_back(camera.model);
  }

  void make_frames() {
    std::vector<std::vector<std::size_t>> messages(cameras_.size());
    std::size_t alone = 0;
    for (const auto& [time, message] : cameras_.front().pictures) {
      Frame frame{time, {true}};
      messages[0].push_back(message);
      if (cameras_.size() > 1) {
        const auto& others = cameras_[1].pictures;
        const auto partner =
            std::ranges::lower_bound(others, time, {}, [](const auto& each) { return each.first; });
        const bool there = partner != others.end() && partner->first == time;
        frame.present.push_back(there);
        messages[1].push_back(there ? partner->second : 0);
        alone += there ? 0U : 1U;
      }
      sequence_.frames.push_back(std::move(frame));
    }
    if (alone > 0) {
      sequence_.warnings.push_back(
          fmt::format("{} of {} frames of {} have no picture of {}", alone, sequence_.frames.size(),
                      topic(cameras_[0].topic).name, topic(cameras_[1].topic).name));
    }
    sequence_.image = [recording = recording_, messages = std::move(messages), cameras = cameras_](
                          std::size_t frame, std::size_t camera) {
      const Camera& by = cameras[camera];
      return recorded_grey(*recording, by.topic, messages[camera][frame], by.model.width,
                           by.model.height);
    };
  }

  void read_truth() {
    const auto found = one_of(chosen_.truth, PoseMessage::kType, "truth");
    if (!found) return;
    for (std::size_t i = 0; i < topic(*found).messages; ++i) {
      const std::string bytes = recording_->message(*found, i);
      auto in = recording_->reader(*found, i, bytes);
      const auto message = ::pirt::read_pose(in);
      TruthRow row;
      row.time = message.head.time;
      row.body = message.pose;
      sequence_.truth.push_back(row);
    }
    keep_rising(sequence_.truth, topic(*found).name, [](const TruthRow& row) { return row.time; });
  }

  /// What comes twice or late was recorded so: it is left out, and said.
  template <typename Row, typename TimeOf>
  void keep_rising(std::vector<Row>& rows, const std::string& name, const TimeOf& time_of) {
    const std::size_t all = rows.size();
    std::vector<Row> kept;
    for (Row& row : rows) {
      if (kept.empty() || time_of(row) > time_of(kept.back())) kept.push_back(std::move(row));
    }
    rows = std::move(kept);
    if (rows.size() == all) return;
    sequence_.warnings.push_back(
        fmt::format("{} of {} messages of {} are not used: their stamps "
                    "do not rise",
                    all - rows.size(), all, name));
  }

  std::shared_ptr<const Recording> recording_;
  const SequenceTopics& chosen_;
  Transforms transforms_;
  std::vector<Camera> cameras_;
  std::string body_;  ///< Frame of coordinates.
  Sequence sequence_;
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
  if (topics.right && !topics.left && topics.right != kNone) {
    throw_bad_input("--topics names the right camera's topic; name the left one's, too");
  }
  return topics;
}

Sequence read_recording(const std::filesystem::path& file, const SequenceTopics& topics) {
  return Reader(open_recording(file), topics).read();
}

}  // namespace pirt
