#include "workloads/inputs/sequence/recorded_calibration.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "workloads/base/error.h"
#include "workloads/inputs/recording/first_message.h"
#include "workloads/inputs/recording/messages.h"

namespace pirt {
namespace {

bool is_rectified(const std::string& topic) {
  const std::string base = base_topic(topic);
  return base.substr(base.rfind('/') + 1).starts_with("image_rect");
}

/// Topics of one folder that are called so are one camera's, the first the plainest of them.
constexpr std::array<std::string_view, 6> kSameCamera = {
    "image_raw", "image_mono", "image_color", "image_rect", "image_rect_color", "image_rect_mono"};

std::array<double, 8> lens_of(const CameraModel& model) {
  return {model.k1, model.k2, model.p1, model.p2, model.k3, model.k4, model.k5, model.k6};
}

bool has_lens(const CameraModel& model) {
  return model.lens != Lens::kRadialTangential || lens_of(model) != std::array<double, 8>{};
}

/// As of a camera that zooms or is calibrated again.
bool is_other(const CameraModel& a, const CameraModel& b) {
  constexpr double kLeast = 0.5;  // pixels
  const auto parts = {&CameraModel::fx, &CameraModel::fy, &CameraModel::cx, &CameraModel::cy};
  return a.lens != b.lens || lens_of(a) != lens_of(b) || std::ranges::any_of(parts, [&](auto part) {
           return std::abs(a.*part - b.*part) > kLeast;
         });
}

}  // namespace

std::string folder_of(const std::string& topic) {
  const auto slash = topic.rfind('/');
  return slash == std::string::npos ? "" : topic.substr(0, slash);
}

std::string base_topic(const std::string& topic) {
  const bool is_part = topic.ends_with("/compressed") || topic.ends_with("/compressedDepth");
  return is_part ? folder_of(topic) : topic;
}

bool is_same_camera(const std::string& topic, const std::string& other) {
  const auto rank = [](const std::string& base) {
    return std::ranges::find(kSameCamera, base.substr(base.rfind('/') + 1)) - kSameCamera.begin();
  };
  const std::string a = base_topic(topic);
  const std::string b = base_topic(other);
  if (a == b) return topic.size() < other.size();
  return folder_of(a) == folder_of(b) && !folder_of(a).empty() && rank(a) < rank(b) &&
         rank(b) < std::ssize(kSameCamera);
}

RecordedCalibrations::RecordedCalibrations(const Recording& recording,
                                           const std::filesystem::path& file)
    : recording_(recording),
      given_(file.empty() ? std::vector<GivenCamera>() : read_calibration(file)) {}

void RecordedCalibrations::fail(const std::string& problem) const {
  throw_bad_input("'" + recording_.file() + "' " + problem);
}

std::optional<std::size_t> RecordedCalibrations::info_of(const std::string& name) const {
  std::optional<std::size_t> info;
  for (const std::size_t each : recording_.of_type(CameraInfoMessage::kType)) {
    const std::string& topic = recording_.topics()[each].name;
    if (topic == folder_of(name) + "/camera_info") return each;
    if (topic == folder_of(base_topic(name)) + "/camera_info") info = each;
  }
  return info;
}

/// By the topic that the file names, else by its place among the cameras.
const GivenCamera& RecordedCalibrations::given(const std::string& name, std::size_t place,
                                               std::vector<std::string>& warnings) const {
  const auto plain = [](const std::string& topic) {
    const std::string base = base_topic(topic);
    return base.starts_with('/') ? base.substr(1) : base;
  };
  for (const GivenCamera& each : given_) {
    if (plain(each.topic) == plain(name)) return each;
  }
  if (place >= given_.size()) {
    fail(fmt::format("has no calibration of {}: --calibration has {} of other cameras", name,
                     given_.size()));
  }
  if (!given_[place].topic.empty()) {
    warnings.push_back(
        fmt::format("the calibration of {} is taken for {}", given_[place].topic, name));
  }
  return given_[place];
}

RecordedCalibration RecordedCalibrations::of(const std::string& name, std::size_t place,
                                             std::vector<std::string>& warnings) const {
  RecordedCalibration found;
  InfoCamera& camera = found.camera;
  if (are_given()) {
    const GivenCamera& by = found.given.emplace(given(name, place, warnings));
    camera.model = by.model;
    if (!is_rectified(name)) return found;
    if (by.rectified) {
      camera.model = *by.rectified;
      camera.rectified_from_raw = by.rectified_from_raw;
      camera.is_rectified = true;
    } else if (has_lens(camera.model)) {
      warnings.push_back(name +
                         " is rectified by its name, and its calibration has a lens: if straight "
                         "lines are straight in its pictures, give one without (or ROS's, with its "
                         "projection_matrix)");
    }
    return found;
  }
  const auto info = info_of(name);
  if (!info) {
    fail(
        fmt::format("has no calibration of {}: no sensor_msgs/CameraInfo on {}/camera_info; "
                    "give a file that has it: --calibration camchain.yaml",
                    name, folder_of(base_topic(name))));
  }
  const auto message = first_message(recording_, *info, [&](WireReader& in) {
    const auto read = read_camera_info(in);
    camera = camera_of(in, read, is_rectified(name));
    return read;
  });
  const std::size_t count = recording_.topics()[*info].messages;
  const CameraModel last = first_usable(count, [&](std::size_t i) {
    return read_message(recording_, *info, count - 1 - i, [&](WireReader& in) {
      return camera_of(in, read_camera_info(in), is_rectified(name)).model;
    });
  });
  if (is_other(camera.model, last)) {
    warnings.push_back(fmt::format("{} changes; the first is used for all pictures of {}",
                                   recording_.topics()[*info].name, name));
  }
  if (!is_rectified(name) && seems_rectified(message)) {
    warnings.push_back(fmt::format(
        "the pictures of {} seem to be rectified, since P of {} has its centre near "
        "their middle and K, which is used, has not; if straight lines are straight in "
        "them, give a calibration that is P's, with no lens: --calibration camchain.yaml",
        name, recording_.topics()[*info].name));
  }
  // As image_geometry takes it; a simulated camera has none, but a driver may not know it.
  if (message.d.empty() && !is_rectified(name)) {
    warnings.push_back(
        fmt::format("{} says nothing of a lens (D is empty), and {} is taken to have none; if "
                    "straight lines are bent in its pictures, give their calibration: "
                    "--calibration camchain.yaml",
                    recording_.topics()[*info].name, name));
  }
  return found;
}

}  // namespace pirt
