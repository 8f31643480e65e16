// The ASL layout of the EuRoC datasets. Burri et al., The EuRoC micro aerial vehicle datasets, IJRR
// 2016. What is read is checked against what a robot's sensors can say, so that a mistaken unit is
// found here and not by a filter that diverges.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>

#include "workloads/base/error.h"
#include "workloads/inputs/sequence/calibration_file.h"
#include "workloads/inputs/sequence/camera_info.h"
#include "workloads/inputs/sequence/imu_check.h"
#include "workloads/inputs/sequence/sequence.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/inputs/sequence/table_file.h"
#include "workloads/inputs/sequence/trajectory.h"

namespace pirt {
namespace {

namespace fs = std::filesystem;

constexpr double kFastestGyro_rad_s = 35.0;     // 2000 degrees/s, where MEMS gyroscopes saturate
constexpr double kStrongestAccel_m_s2 = 400.0;  // 40 g

YamlNode read_sensor(const fs::path& file) {
  if (!fs::exists(file)) {
    throw_bad_input(fmt::format(
        "the calibration '{}' is missing; a sequence needs it, or another file that has "
        "it: --calibration camchain.yaml",
        file.string()));
  }
  return read_opencv_yaml(file);
}

struct Stamped {
  Nanos time;
  std::string file;
};

/// cam0/data.csv: stamp, file.
std::vector<Stamped> read_frames(const fs::path& camera, std::vector<std::string>& warnings) {
  std::vector<Stamped> frames;
  static constexpr std::string_view kNames[] = {"timestamp", "filename"};
  for (const auto& row : read_table(camera / "data.csv", ',', 2, kNames)) {
    const fs::path name = row.text(1);
    if (name.empty() || name.has_parent_path() || name == "." || name == "..") {
      row.fail("'" + name.string() + "' is not the name of a picture");
    }
    frames.push_back({row.stamp(0), name.string()});
  }
  keep_rising(frames, "'" + (camera / "data.csv").string() + "'", warnings);
  return frames;
}

/// A sensor has noise: one axis that never moves while the others do is stuck, and where none does
/// it is dead. Two that do not are a simulated robot's that turns in the plane.
void check_axes(const std::string& what, const std::vector<ImuSample>& imu, const char* sensor,
                Eigen::Vector3d ImuSample::*vector) {
  constexpr std::size_t kEnough = 100;
  if (imu.size() < kEnough) return;
  Eigen::Array3i moves = Eigen::Array3i::Zero();
  for (std::size_t i = 1; i < imu.size(); ++i) {
    moves += ((imu[i].*vector).array() != (imu[i - 1].*vector).array()).cast<int>();
  }
  const auto still = (moves == 0).count();
  if (still == 3) {
    throw_bad_input(
        fmt::format("{}: the {} is the same in all {} samples: it is not there, or does "
                    "not work; leave the IMU out (--no-imu, --topics imu=none)",
                    what, sensor, imu.size()));
  }
  if (still == 1 && 2 * (moves > 0).select(moves, std::numeric_limits<int>::max()).minCoeff() >
                        static_cast<int>(imu.size())) {
    const char axis = moves[0] == 0 ? 'x' : moves[1] == 0 ? 'y' : 'z';
    throw_bad_input(
        fmt::format("{}: axis {} of the {} is stuck: it is the same in all {} samples; "
                    "leave the IMU out (--no-imu, --topics imu=none)",
                    what, axis, sensor, imu.size()));
  }
}

}  // namespace

void check_imu(const std::string& what, std::vector<ImuSample>& imu,
               std::vector<std::string>& warnings) {
  constexpr std::ptrdiff_t kOneIn = 100;
  const auto is_spike = [](const ImuSample& sample) {
    return sample.gyro_rad_s.cwiseAbs().maxCoeff() > kFastestGyro_rad_s ||
           sample.accel_m_s2.norm() > kStrongestAccel_m_s2;
  };
  const auto spikes = std::ranges::count_if(imu, is_spike);
  if (spikes > 0 && kOneIn * spikes <= std::ssize(imu)) {
    warnings.push_back(fmt::format("{}: {} of {} samples are left out: no sensor measures so much",
                                   what, spikes, imu.size()));
    std::erase_if(imu, is_spike);
  }
  double fastest = 0;
  std::vector<double> accels;
  for (const auto& sample : imu) {
    fastest = std::max(fastest, sample.gyro_rad_s.cwiseAbs().maxCoeff());
    accels.push_back(sample.accel_m_s2.norm());
  }
  const double strongest = std::ranges::max(accels);
  std::ranges::nth_element(accels, accels.begin() + std::ssize(accels) / 2);
  const double usual = accels[accels.size() / 2];
  if (fastest > kFastestGyro_rad_s) {
    throw_bad_input(
        fmt::format("{}: turns at up to {:.0f} rad/s, faster than gyroscopes measure; "
                    "are these degrees/s? Give rad/s",
                    what, fastest));
  }
  if (strongest > kStrongestAccel_m_s2) {
    throw_bad_input(
        fmt::format("{}: up to {:.0f} m/s^2 is more than accelerometers measure; give "
                    "m/s^2",
                    what, strongest));
  }
  if (usual > 0.5 && usual < 2.0) {
    throw_bad_input(
        fmt::format("{}: the median acceleration is {:.2f}, which looks like g; give "
                    "m/s^2",
                    what, usual));
  }
  if (usual < 5.0 || usual > 20.0) {
    throw_bad_input(
        fmt::format("{}: the median acceleration is {:.2f} m/s^2, where gravity alone "
                    "is {}; give specific force in m/s^2",
                    what, usual, kGravity));
  }
  check_axes(what, imu, "angular velocity", &ImuSample::gyro_rad_s);
  check_axes(what, imu, "acceleration", &ImuSample::accel_m_s2);
}

namespace {

/// Where no sensor.yaml says what a camera is: of the file that was given, or TUM-VI's.
std::vector<GivenCamera> given_cameras(const fs::path& root, const ReadOptions& options) {
  if (!options.calibration.empty()) return read_calibration(options.calibration);
  const fs::path tum_vi = root.parent_path() / "dso" / "camchain.yaml";
  const bool is_tum_vi = !fs::exists(root / "cam0" / "sensor.yaml") && fs::exists(tum_vi);
  return is_tum_vi ? read_calibration(tum_vi) : std::vector<GivenCamera>();
}

/// Of the cameras that are read.
std::vector<std::string> camera_names(const fs::path& root, const ReadOptions& options) {
  std::vector<std::string> names;
  for (const char* name : {"cam0", "cam1"}) {
    if (fs::exists(root / name) && (names.empty() || options.second_camera)) names.push_back(name);
  }
  return names;
}

/// "/cam0/image_raw" is of cam0.
bool is_of(const GivenCamera& given, const std::string& name) {
  return ("/" + given.topic + "/").find("/" + name + "/") != std::string::npos;
}

/// Those of the cameras of these names, in their order: by the topics that the file names if all
/// are among them, else by place, where the second one is the first of a folder without cam0.
std::vector<GivenCamera> cameras_of(const std::vector<std::string>& names,
                                    std::vector<GivenCamera> given,
                                    std::vector<std::string>& warnings) {
  std::vector<GivenCamera> named;
  for (const std::string& name : names) {
    const auto found =
        std::ranges::find_if(given, [&name](const GivenCamera& each) { return is_of(each, name); });
    if (found != given.end()) named.push_back(*found);
  }
  if (!named.empty() && named.size() == names.size()) {
    const std::optional<Pose> first = named.front().first_from_camera;
    for (GivenCamera& each : named) {
      if (first && each.first_from_camera) {
        each.first_from_camera = first->inverse() * *each.first_from_camera;
      } else {
        each.first_from_camera.reset();
      }
    }
    return named;
  }
  if (given.size() > 1 && !names.empty() && names.front() != "cam0") given.erase(given.begin());
  for (std::size_t i = 0; i < std::min(names.size(), given.size()); ++i) {
    if (given[i].topic.empty() || is_of(given[i], names[i])) continue;
    warnings.push_back(
        fmt::format("the calibration of {} is taken for {}", given[i].topic, names[i]));
  }
  return given;
}

/// @param before  The camera before it, if there is one.
CameraModel placed(const GivenCamera& given, const CameraModel* before, const std::string& name) {
  CameraModel model = given.model;
  if (given.body_from_camera) {
    model.body_from_camera = *given.body_from_camera;
  } else if (before != nullptr && given.first_from_camera) {
    model.body_from_camera = before->body_from_camera * *given.first_from_camera;
  } else if (before != nullptr) {
    throw_bad_input("the calibration does not say where " + name + " sits");
  }
  return model;
}

void read_cameras(const fs::path& root, const std::vector<std::string>& names,
                  const ReadOptions& options, const std::vector<GivenCamera>& given,
                  Sequence& sequence) {
  std::vector<std::vector<Stamped>> pictures;
  std::vector<fs::path> folders;
  for (const std::string& name : names) {
    folders.push_back(root / name);
    pictures.push_back(read_frames(root / name, sequence.warnings));
    const std::size_t camera = sequence.cameras.size();
    if (given.empty()) {
      sequence.cameras.push_back(read_camera_yaml(root / name / "sensor.yaml"));
    } else if (camera < given.size()) {
      const CameraModel* const before = camera == 0 ? nullptr : &sequence.cameras.back();
      sequence.cameras.push_back(placed(given[camera], before, name));
      sequence.cameras.back().rate_hz = usual_rate_hz(stamps_of(pictures.back()), 1);
    } else {
      throw_bad_input(fmt::format("the calibration has {} cameras, and '{}' has {}", given.size(),
                                  root.string(), name));
    }
  }
  if (pictures.empty()) throw_bad_input("'" + root.string() + "' has no cam0");
  std::vector<std::vector<std::string>> files(pictures.size());
  for (std::size_t camera = 0; camera < pictures.size(); ++camera) {
    check_step("'" + (folders[camera] / "data.csv").string() + "'", stamps_of(pictures[camera]),
               given.empty() ? std::optional(sequence.cameras[camera].rate_hz) : std::nullopt,
               kFinestPicture_s);
  }
  Partners partners;
  if (pictures.size() > 1) {
    partners = pair_stamps(stamps_of(pictures[0]), stamps_of(pictures[1]), options.pair_tolerance,
                           sequence.warnings);
  }
  for (std::size_t i = 0; i < pictures[0].size(); ++i) {
    files[0].push_back(pictures[0][i].file);
    if (partners.empty()) continue;
    files[1].push_back(partners[i] ? pictures[1][*partners[i]].file : "");
  }
  make_frames(sequence, stamps_of(pictures[0]), partners, {"cam0", "cam1"});
  sequence.image = [folders, files, cameras = sequence.cameras,
                    deep = std::make_shared<std::array<std::atomic<bool>, 2>>()](
                       std::size_t frame, std::size_t camera) {
    return read_grey_image(folders[camera] / "data" / files[camera][frame], cameras[camera].width,
                           cameras[camera].height, &deep->at(camera));
  };
}

/// @param is_body  As a calibration that is given has it.
void read_imu(const fs::path& root, bool is_body, Sequence& sequence) {
  if (!fs::exists(root / "imu0")) return;
  const fs::path file = root / "imu0" / "data.csv";
  const fs::path sensor = root / "imu0" / "sensor.yaml";
  sequence.imu = read_imu_csv(file, sequence.warnings);
  spread_bursts(sequence.imu, "'" + file.string() + "'", sequence.warnings);
  // TUM-VI has its model elsewhere, and the IMU as body.
  const bool is_given = !fs::exists(sensor) && !fs::exists(root / "cam0" / "sensor.yaml");
  sequence.imu_model = is_given ? ImuModel{.rate_hz = usual_rate_hz(stamps_of(sequence.imu), 1)}
                                : read_imu_yaml(sensor);
  check_step("'" + file.string() + "'", stamps_of(sequence.imu),
             is_given ? std::nullopt : std::optional(sequence.imu_model->rate_hz));
  constexpr double kThinned = 1.5;
  double& rate_hz = sequence.imu_model->rate_hz;
  const double usual_hz = usual_rate_hz(stamps_of(sequence.imu), rate_hz);
  if (kThinned * usual_hz < rate_hz) {
    sequence.warnings.push_back(
        fmt::format("'{}' says {:g} Hz; its samples come at {:.0f} Hz, which is taken",
                    sensor.string(), rate_hz, usual_hz));
    rate_hz = usual_hz;
  }
  if (is_given) {
    sequence.warnings.push_back("no imu0/sensor.yaml: the IMU is taken to be as noisy as EuRoC's");
    return;
  }
  if (is_body) return;
  const Pose body_from_imu = extrinsics_of(read_sensor(sensor));
  if (body_from_imu.position.norm() > 1e-6) {
    throw_bad_input("'" + sensor.string() +
                    "': the IMU is not at the body's origin; give T_BS of all sensors with the "
                    "IMU as body");
  }
  for (auto& sample : sequence.imu) {
    sample.gyro_rad_s = body_from_imu.rotation * sample.gyro_rad_s;
    sample.accel_m_s2 = body_from_imu.rotation * sample.accel_m_s2;
  }
}

}  // namespace

CameraModel read_camera_yaml(const fs::path& file) {
  const YamlNode sensor = read_sensor(file);
  CameraModel camera = pinhole_camera(sensor);
  const auto model = sensor.has("distortion_model") ? sensor.at("distortion_model").text()
                                                    : std::string("radial-tangential");
  if (model != "radial-tangential" && model != "equidistant") {
    sensor.at("distortion_model")
        .fail("'" + model + "' is not known; radial-tangential and equidistant are");
  }
  const auto lens = numbers_of(sensor.at("distortion_coefficients"), 4, 4, 10.0);
  const auto problem = set_lens(camera, model == "equidistant" ? model : "plumb_bob", lens);
  if (!problem.empty()) sensor.at("distortion_coefficients").fail(problem);
  camera.body_from_camera = extrinsics_of(sensor);
  camera.rate_hz = sensor.at("rate_hz").number(0.01, 10000);
  return camera;
}

ImuModel read_imu_yaml(const fs::path& file) {
  const YamlNode sensor = read_sensor(file);
  ImuModel model;
  model.rate_hz = sensor.at("rate_hz").number(1, 100000);
  constexpr double kLeast = 1e-9;
  model.gyro_noise = sensor.at("gyroscope_noise_density").number(kLeast, 1);
  model.gyro_walk = sensor.at("gyroscope_random_walk").number(kLeast, 1);
  model.accel_noise = sensor.at("accelerometer_noise_density").number(kLeast, 10);
  model.accel_walk = sensor.at("accelerometer_random_walk").number(kLeast, 10);
  return model;
}

std::vector<ImuSample> read_imu_csv(const fs::path& file, std::vector<std::string>& warnings) {
  static constexpr std::string_view kNames[] = {"timestamp", "w x", "w y", "w z",
                                                "a x",       "a y", "a z"};
  std::vector<ImuSample> imu;
  for (const auto& row : read_table(file, ',', 7, kNames)) {
    ImuSample sample;
    sample.time = row.stamp(0);
    for (int axis = 0; axis < 3; ++axis) {
      sample.gyro_rad_s(axis) = row.number(std::size_t{1} + static_cast<std::size_t>(axis));
      sample.accel_m_s2(axis) = row.number(std::size_t{4} + static_cast<std::size_t>(axis));
    }
    imu.push_back(sample);
  }
  part_equal_stamps(imu);
  keep_rising(imu, "'" + file.string() + "'", warnings);
  check_imu("'" + file.string() + "'", imu, warnings);
  return imu;
}

std::vector<TruthRow> read_truth_csv(const fs::path& file, std::vector<std::string>& warnings) {
  std::vector<TruthRow> truth;
  constexpr std::size_t kState = 17, kPose = 8;
  static constexpr std::string_view kNames[kState] = {
      "timestamp", "p x", "p y",   "p z",   "q w",   "q x",   "q y",   "q z",  "v x",
      "v y",       "v z", "b_w x", "b_w y", "b_w z", "b_a x", "b_a y", "b_a z"};
  for (const auto& row : read_table(file, ',', 0, kNames)) {
    if (row.size() != kState && row.size() != kPose) {
      row.fail(fmt::format("has {} columns, expected {} or {}; is the file cut off?", row.size(),
                           kState, kPose));
    }
    const auto vector = [&](std::size_t column) {
      return Eigen::Vector3d(row.number(column), row.number(column + 1), row.number(column + 2));
    };
    TruthRow state;
    state.time = row.stamp(0);
    state.body = {row.rotation(4, 5), vector(1)};
    if (row.size() == kState) {
      state.velocity_m_s = vector(8);
      state.gyro_bias_rad_s = vector(11);
      state.accel_bias_m_s2 = vector(14);
    }
    truth.push_back(state);
  }
  const std::string what = "'" + file.string() + "'";
  keep_rising(truth, what, warnings);
  check_step(what, stamps_of(truth));
  return truth;
}

Sequence read_euroc(const fs::path& folder, const ReadOptions& options) {
  const fs::path root = fs::exists(folder / "mav0") ? folder / "mav0" : folder;
  Sequence sequence;
  sequence.name = folder.string();
  const auto names = camera_names(root, options);
  const auto given = cameras_of(names, given_cameras(root, options), sequence.warnings);
  read_cameras(root, names, options, given, sequence);
  const bool is_placed = given.empty() || given.front().body_from_camera;
  if (options.imu && is_placed) read_imu(root, !given.empty(), sequence);
  if (options.imu && !is_placed && fs::exists(root / "imu0")) {
    sequence.warnings.push_back(
        "imu0 is not used: the calibration does not say where the IMU sits (T_cam_imu)");
  }
  if (!given.empty()) frames_by_imu(sequence, given.front().imu_later_s);
  for (const char* name : {"state_groundtruth_estimate0", "mocap0"}) {
    const fs::path truth = root / name / "data.csv";
    if (!options.truth.empty() || !sequence.truth.empty() || !fs::exists(truth)) continue;
    take_truth(sequence, name, [&] {
      sequence.truth = read_truth_csv(truth, sequence.warnings);
      if (given.empty() || !is_placed) return;
      // A calibration that is given has the IMU as body, truth has not.
      const Pose body_from_imu = imu_on_body(root).value_or(Pose{});
      for (TruthRow& row : sequence.truth) row.body = row.body * body_from_imu;
    });
    if (is_placed || sequence.truth.empty()) continue;
    sequence.warnings.push_back(
        fmt::format("nobody knows where what {} is of sits on the camera, whose path is estimated: "
                    "errors against {} have that in them",
                    name, name));
  }
  return sequence;
}

}  // namespace pirt
