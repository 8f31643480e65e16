// A sequence as an EuRoC folder.
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <atomic>
#include <exception>
#include <filesystem>
#include <mutex>
#include <opencv2/core.hpp>
#include <system_error>

#include "workloads/base/error.h"
#include "workloads/base/system/temporary.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/decoder.h"
#include "workloads/inputs/scene/generator.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

std::string extrinsics_yaml(const Pose& pose) {
  std::string text = "T_BS:\n  cols: 4\n  rows: 4\n  data: [";
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) text += fmt::format("{}, ", pose.rotation(r, c));
    text += fmt::format("{},\n         ", pose.position(r));
  }
  return text + "0.0, 0.0, 0.0, 1.0]\n";
}

std::string camera_yaml(const CameraModel& c) {
  return "sensor_type: camera\ncomment: generated\n\n# Sensor to body.\n" +
         extrinsics_yaml(c.body_from_camera) +
         fmt::format(
             "\nrate_hz: {}\nresolution: [{}, {}]\ncamera_model: pinhole\n"
             "intrinsics: [{}, {}, {}, {}] # fu, fv, cu, cv\n"
             "distortion_model: radial-tangential\n"
             "distortion_coefficients: [{}, {}, {}, {}]\n",
             c.rate_hz, c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2);
}

std::string imu_yaml(const ImuModel& imu) {
  return "sensor_type: imu\ncomment: generated\n\n# Sensor to body.\n" + extrinsics_yaml({}) +
         fmt::format(
             "\nrate_hz: {}\n"
             "gyroscope_noise_density: {}      # rad/s/sqrt(Hz)\n"
             "gyroscope_random_walk: {}        # rad/s^2/sqrt(Hz)\n"
             "accelerometer_noise_density: {}  # m/s^2/sqrt(Hz)\n"
             "accelerometer_random_walk: {}    # m/s^3/sqrt(Hz)\n",
             imu.rate_hz, imu.gyro_noise, imu.gyro_walk, imu.accel_noise, imu.accel_walk);
}

std::string vector_csv(const Eigen::Vector3d& v) {
  return fmt::format(",{:.12g},{:.12g},{:.12g}", v.x(), v.y(), v.z());
}

std::string imu_csv(const Sequence& sequence) {
  std::string text =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
      "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
  for (const auto& s : sequence.imu) {
    text +=
        fmt::format("{}{}{}\n", s.time.count(), vector_csv(s.gyro_rad_s), vector_csv(s.accel_m_s2));
  }
  return text;
}

std::string truth_csv(const Sequence& sequence) {
  std::string text =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
      "q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], "
      "b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], "
      "b_a_RS_S_z [m s^-2]\n";
  for (const auto& row : sequence.truth) {
    const Eigen::Quaterniond q(row.body.rotation);
    text += fmt::format("{}{},{:.12g},{:.12g},{:.12g},{:.12g}{}{}{}\n", row.time.count(),
                        vector_csv(row.body.position), q.w(), q.x(), q.y(), q.z(),
                        vector_csv(row.velocity_m_s), vector_csv(row.gyro_bias_rad_s),
                        vector_csv(row.accel_bias_m_s2));
  }
  return text;
}

std::string picture_name(Nanos time) { return fmt::format("{}.png", time.count()); }

std::string frames_csv(const Sequence& sequence) {
  std::string text = "#timestamp [ns],filename\n";
  for (const auto& frame : sequence.frames) {
    text += fmt::format("{},{}\n", frame.time.count(), picture_name(frame.time));
  }
  return text;
}

/// @return  False if @p progress said to stop.
bool write_pictures(const Sequence& sequence, const fs::path& root, int threads,
                    const WriteProgress& progress) {
  std::atomic<std::size_t> next = 0;
  std::size_t written = 0;
  bool stopped = false;
  std::exception_ptr failure;
  std::mutex guard;
  const std::size_t cameras = sequence.cameras.size();
  const std::size_t total = sequence.frames.size() * cameras;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < total; i = next++) {
        GreyImage image = sequence.image(i / cameras, i % cameras);
        const cv::Mat pixels(image.height, image.width, CV_8U, image.pixels.data());
        const auto name = picture_name(sequence.frames[i / cameras].time);
        write_file(root / fmt::format("cam{}", i % cameras) / "data" / name, encode_png(pixels));
        const std::lock_guard lock(guard);
        if (!progress || stopped || progress(++written, total)) continue;
        stopped = true;
        next = total;
      }
    } catch (...) {
      const std::lock_guard lock(guard);
      if (!failure) failure = std::current_exception();
      next = total;
    }
  };
  {
    std::vector<std::jthread> workers;
    for (int i = 1; i < threads; ++i) workers.push_back(start_thread(work));
    work();
  }
  if (failure) std::rethrow_exception(failure);
  return !stopped;
}

bool write_all(const Sequence& sequence, const fs::path& root, int threads,
               const WriteProgress& progress) {
  for (std::size_t i = 0; i < sequence.cameras.size(); ++i) {
    const fs::path camera = root / fmt::format("cam{}", i);
    fs::create_directories(camera / "data");
    write_file(camera / "sensor.yaml", camera_yaml(sequence.cameras[i]));
    write_file(camera / "data.csv", frames_csv(sequence));
  }
  if (sequence.imu_model) {
    fs::create_directories(root / "imu0");
    write_file(root / "imu0" / "sensor.yaml", imu_yaml(*sequence.imu_model));
    write_file(root / "imu0" / "data.csv", imu_csv(sequence));
  }
  if (!sequence.truth.empty()) {
    fs::create_directories(root / "state_groundtruth_estimate0");
    write_file(root / "state_groundtruth_estimate0" / "data.csv", truth_csv(sequence));
  }
  return write_pictures(sequence, root, threads, progress);
}

}  // namespace

bool write_euroc(const Sequence& sequence, const fs::path& folder, int threads,
                 const std::vector<std::pair<std::string, std::string>>& extra,
                 const WriteProgress& progress) {
  const fs::path target = follow_links(folder.has_filename() ? folder : folder.parent_path());
  std::error_code failed;
  if (fs::exists(target, failed) &&
      !(fs::is_directory(target, failed) && fs::is_empty(target, failed))) {
    throw_bad_input("'" + folder.string() +
                    "' exists and is no folder, or is not empty; name another folder");
  }
  try {
    if (target.has_parent_path()) fs::create_directories(target.parent_path());
    remove_left_beside(target);
    TemporaryFolder made(target);
    fs::create_directory(made.path() / "mav0");
    if (!write_all(sequence, made.path() / "mav0", threads, progress)) return false;
    for (const auto& [name, text] : extra) write_file(made.path() / name, text);
    made.publish();
  } catch (const fs::filesystem_error& error) {
    throw_bad_input("cannot write '" + folder.string() + "': " + error.code().message());
  }
  return true;
}

}  // namespace pirt
