// A sequence as a recording of ROS.
#include <fmt/core.h>

#include <algorithm>

#include "workloads/base/error.h"
#include "workloads/base/system/temporary.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/recording/messages.h"
#include "workloads/inputs/recording/recording.h"
#include "workloads/inputs/sequence/recorded.h"

namespace pirt {
namespace {

constexpr const char* kBody = "imu0";

std::string camera_frame(std::size_t camera) { return fmt::format("cam{}", camera); }

CameraInfoMessage info_of(const CameraModel& camera, const MessageHead& head) {
  return {.head = head,
          .width = camera.width,
          .height = camera.height,
          .distortion_model = "plumb_bob",
          .d = {camera.k1, camera.k2, camera.p1, camera.p2, camera.k3},
          .k = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1},
          .p = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0}};
}

/// Everything of one sequence in order of time.
class Writer {
 public:
  Writer(const Sequence& sequence, RecordingWriter& out) : sequence_(sequence), out_(out) {}

  bool write(const std::function<bool(std::size_t, std::size_t)>& progress) {
    write_places();
    const std::size_t total = sequence_.frames.size() * sequence_.cameras.size();
    std::size_t written = 0;
    for (std::size_t frame = 0; frame < sequence_.frames.size(); ++frame) {
      write_up_to(sequence_.frames[frame].time);
      for (std::size_t camera = 0; camera < sequence_.cameras.size(); ++camera) {
        if (sequence_.frames[frame].present[camera]) write_picture(frame, camera);
        if (progress && !progress(++written, total)) return false;
      }
    }
    write_up_to(Nanos::max());
    return true;
  }

 private:
  void write_places() {
    const Nanos begin = sequence_.frames.front().time;
    std::vector<TransformMessage> places;
    for (std::size_t i = 0; i < sequence_.cameras.size(); ++i) {
      places.push_back({.head = {begin, kBody},
                        .child = camera_frame(i),
                        .parent_from_child = sequence_.cameras[i].body_from_camera});
    }
    out_.write("/tf_static", TransformMessage::kType, begin,
               ::pirt::written(places, out_.format()));
  }

  /// What is no picture.
  void write_up_to(Nanos time) {
    for (; imu_ < sequence_.imu.size() && sequence_.imu[imu_].time <= time; ++imu_) {
      const ImuSample& sample = sequence_.imu[imu_];
      out_.write("/imu0", ImuMessage::kType, sample.time,
                 ::pirt::written(ImuMessage{.head = {sample.time, kBody},
                                            .gyro_rad_s = sample.gyro_rad_s,
                                            .accel_m_s2 = sample.accel_m_s2},
                                 out_.format()));
    }
    for (; truth_ < sequence_.truth.size() && sequence_.truth[truth_].time <= time; ++truth_) {
      const TruthRow& row = sequence_.truth[truth_];
      out_.write("/truth", PoseMessage::kType, row.time,
                 ::pirt::written(PoseMessage{.head = {row.time, "world"}, .pose = row.body},
                                 out_.format()));
    }
  }

  void write_picture(std::size_t frame, std::size_t camera) {
    const GreyImage image = sequence_.image(frame, camera);
    const MessageHead head{sequence_.frames[frame].time, camera_frame(camera)};
    const std::string folder = "/" + camera_frame(camera);
    ImageMessage message{
        .head = head,
        .compressed = false,
        .width = image.width,
        .height = image.height,
        .encoding = "mono8",
        .step = static_cast<std::size_t>(image.width),
        .data = {reinterpret_cast<const char*>(image.pixels.data()), image.pixels.size()}};
    out_.write(folder + "/image_raw", ImageMessage::kType, head.time,
               ::pirt::written(message, out_.format()));
    out_.write(folder + "/camera_info", CameraInfoMessage::kType, head.time,
               ::pirt::written(info_of(sequence_.cameras[camera], head), out_.format()));
  }

  const Sequence& sequence_;
  RecordingWriter& out_;
  std::size_t imu_ = 0, truth_ = 0;  ///< Written so far.
};

}  // namespace

bool write_recording(const Sequence& sequence, const std::filesystem::path& file,
                     const std::function<bool(std::size_t, std::size_t)>& progress) {
  const auto extension = file.extension();
  if (extension != ".bag" && extension != ".db3" && extension != ".mcap") {
    throw_bad_input("'" + file.string() + "' must end in .bag (ROS 1), .db3 or .mcap (ROS 2)");
  }
  std::error_code failed;
  if (std::filesystem::exists(file, failed)) {
    throw_bad_input("'" + file.string() + "' exists; name another file");
  }
  remove_left_beside(follow_links(file));
  const auto out = extension == ".bag"   ? make_bag(file)
                   : extension == ".db3" ? make_db3(file)
                                         : make_mcap(file);
  if (!Writer(sequence, *out).write(progress)) return false;
  out->publish();
  return true;
}

}  // namespace pirt
