// A recorded drive or flight: cameras, IMU, stamps, truth, and pictures that are loaded when asked
// for. Where it came from (EuRoC folder, KITTI folder, generated scene) is not visible here.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "workloads/base/geometry/camera.h"
#include "workloads/base/geometry/geometry.h"
#include "workloads/base/time.h"
#include "workloads/model/grey_image.h"

namespace pirt {

/// Of the body frame: readers have applied the IMU's own extrinsics.
struct ImuSample {
  Nanos time{};
  Eigen::Vector3d gyro_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_m_s2 = Eigen::Vector3d::Zero();
};

/// Continuous-time noise, as in EuRoC's imu0/sensor.yaml. The defaults are its ADIS16448's.
struct ImuModel {
  double rate_hz = 200.0;
  double gyro_noise = 1.6968e-4;  ///< rad/s/sqrt(Hz)
  double gyro_walk = 1.9393e-5;   ///< rad/s^2/sqrt(Hz)
  double accel_noise = 2.0e-3;    ///< m/s^2/sqrt(Hz)
  double accel_walk = 3.0e-3;     ///< m/s^3/sqrt(Hz)
};

struct TruthRow {
  Nanos time{};
  Pose body;  ///< body -> world.
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_bias_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias_m_s2 = Eigen::Vector3d::Zero();
};

/// One firing of the camera or of all cameras.
struct Frame {
  Nanos time{};
  std::vector<bool> present;  ///< By camera; the first one always is.
};

struct Sequence {
  std::string name;
  std::vector<CameraModel> cameras;  ///< 1 or 2, left first.
  std::optional<ImuModel> imu_model;
  std::vector<ImuSample> imu;   ///< Stamps rise strictly.
  std::vector<Frame> frames;    ///< Stamps rise strictly.
  std::vector<TruthRow> truth;  ///< To evaluate only; may be empty.
  std::vector<std::string> warnings;
  /// Picture of a frame; may be called by several threads at once. Empty where it is to be left out
  /// (bad_pictures.h).
  /// @throws Error{kBadInput} naming the file if it is damaged or of another size than its camera.
  std::function<GreyImage(std::size_t frame, std::size_t camera)> image;

  [[nodiscard]] bool stereo() const { return cameras.size() > 1; }
};

/// Names of a recording's topics; "none" = without it, absent = found by its type.
struct SequenceTopics {
  std::optional<std::string> left, right, imu, truth;
};

/// Pictures of two cameras that are no farther apart are of one moment.
inline constexpr Nanos kPairTolerance = std::chrono::milliseconds(3);

struct ReadOptions {
  bool imu = true;             ///< False: one that is there is not read, nor judged.
  bool second_camera = true;   ///< Likewise.
  SequenceTopics topics = {};  ///< Of a recording.
  /// What a recording, or a folder of EuRoC's layout, does not say of its cameras
  /// (calibration_file.h).
  std::filesystem::path calibration = {};
  std::filesystem::path truth = {};  ///< In the TUM format, in place of the sequence's own.
  Nanos pair_tolerance = kPairTolerance;
};

/// Any layout, told apart by what is in the folder (mav0 or cam0: EuRoC; calib.txt: KITTI), or a
/// recording (recorded.h). Warns of gaps in stamps, an IMU that does not cover the frames, truth
/// that is rare: what a run can live with, but its user should know.
/// @throws Error{kBadInput} naming the layouts if it is none.
[[nodiscard]] Sequence read_sequence(const std::filesystem::path& path,
                                     const ReadOptions& options = {});

/// EuRoC's ASL layout: [mav0/]{cam0,cam1,imu0}/{data.csv,sensor.yaml}, camN/data/*.png, and, if it
/// is there, state_groundtruth_estimate0/data.csv. Frames are those of cam0; a picture of cam1
/// belongs to the frame that is nearest (stamps.h). The second camera and the IMU may be absent.
/// Also as TUM-VI has it: mocap0/data.csv, and dso/camchain.yaml in place of sensor.yaml. Of
/// pictures of 16 bits the upper 8 are taken.
/// @throws Error{kBadInput} with file:line for numbers that are none, and units that cannot be
/// (degrees, g, millimetres).
[[nodiscard]] Sequence read_euroc(const std::filesystem::path& folder,
                                  const ReadOptions& options = {});

/// KITTI odometry: calib.txt (P0, P1), image_0 or image_l, image_1 or image_r, times.txt,
/// poses.txt. Body = left camera. Without times.txt frames are 0.1 s apart, which a warning says.
/// Pictures are in order of the numbers in their names, and those of one number belong together.
[[nodiscard]] Sequence read_kitti(const std::filesystem::path& folder,
                                  const ReadOptions& options = {});

/// The rows of EuRoC's imu0/data.csv and state_groundtruth_estimate0/data.csv, or of TUM-VI's
/// mocap0/data.csv, which has poses alone. What does not rise is left out with a warning.
[[nodiscard]] std::vector<ImuSample> read_imu_csv(const std::filesystem::path& file,
                                                  std::vector<std::string>& warnings);
[[nodiscard]] std::vector<TruthRow> read_truth_csv(const std::filesystem::path& file,
                                                   std::vector<std::string>& warnings);
/// EuRoC's cam0/sensor.yaml and imu0/sensor.yaml.
[[nodiscard]] CameraModel read_camera_yaml(const std::filesystem::path& file);
[[nodiscard]] ImuModel read_imu_yaml(const std::filesystem::path& file);

/// A PNG or JPEG file, in grey.
/// @param is_deep  As take_upper_bits.
/// @throws Error{kBadInput} naming the file unless it is whole, has 8 bits a channel, or grey of
/// 16, and is @p width x @p height.
[[nodiscard]] GreyImage read_grey_image(const std::filesystem::path& file, int width, int height,
                                        std::atomic<bool>* is_deep = nullptr);

}  // namespace pirt
