#include "workloads/inputs/scene/generator.h"

#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "workloads/base/error.h"
#include "workloads/base/math/gaussian.h"
#include "workloads/base/math/pixel_index.h"
#include "workloads/base/math/random.h"
#include "workloads/inputs/scene/room.h"

namespace pirt {
namespace {

/// EuRoC's first stamp of V1_01, so that stamps have the usual size.
constexpr Nanos kStart(1'403'715'273'262'142'976);

/// The lens of EuRoC's left camera, scaled to the picture, and a rig whose axes are not quite
/// square: z forward, x right, y down, each camera off by some degrees.
std::vector<CameraModel> make_cameras(const SceneOptions& options) {
  Eigen::Matrix3d looking;  // camera axes in the body's frame, as columns
  looking << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  std::vector<CameraModel> cameras;
  for (int i = 0; i < (options.stereo ? 2 : 1); ++i) {
    CameraModel camera;
    camera.width = options.width;
    camera.height = options.height;
    const double scale = std::max(options.width, options.height) / 752.0;
    camera.fx = (i == 0 ? 458.654 : 457.587) * scale;
    camera.fy = (i == 0 ? 457.296 : 456.134) * scale;
    camera.cx = (i == 0 ? 367.215 : 379.999) / 752.0 * options.width;
    camera.cy = (i == 0 ? 248.375 : 255.238) / 480.0 * options.height;
    camera.k1 = i == 0 ? -0.2834 : -0.2837;
    camera.k2 = i == 0 ? 0.0740 : 0.0745;
    camera.p1 = i == 0 ? 1.9e-4 : -1.0e-4;
    camera.p2 = i == 0 ? 1.8e-5 : -3.6e-5;
    camera.rate_hz = options.camera_rate_hz;
    const Eigen::Vector3d off =
        i == 0 ? Eigen::Vector3d(0.03, -0.02, 0.015) : Eigen::Vector3d(0.022, -0.031, 0.009);
    camera.body_from_camera.rotation = looking * rotation_of(off);
    camera.body_from_camera.position = {0.061, i == 0 ? 0.054 : -0.057, 0.023};
    cameras.push_back(camera);
  }
  return cameras;
}

Eigen::Vector3d vector_from(Gaussian& noise) {
  const double x = noise.next();
  const double y = noise.next();
  return {x, y, noise.next()};
}

/// Samples and, for the truth, the biases that they have.
void make_imu(const SceneOptions& options, const RobotPath& path, Sequence& sequence) {
  Gaussian noise(derive_seed(options.path.seed, "imu"));
  const double rate = options.imu.rate_hz;
  const double per_sample = std::sqrt(rate);
  Eigen::Vector3d gyro_bias = 0.02 * vector_from(noise);
  Eigen::Vector3d accel_bias = 0.08 * vector_from(noise);
  const Eigen::Vector3d gravity(0, 0, -kGravity);
  const auto samples = static_cast<std::int64_t>(std::ceil(options.path.duration_s * rate)) + 2;
  for (std::int64_t i = 0; i < samples; ++i) {
    const double t = static_cast<double>(i) / rate;
    const BodyMotion motion = path.at(t);
    const Nanos time = kStart + from_s(t);
    ImuSample sample;
    sample.time = time;
    sample.gyro_rad_s =
        motion.turn_rad_s + gyro_bias + options.imu.gyro_noise * per_sample * vector_from(noise);
    sample.accel_m_s2 = motion.body.rotation.transpose() * (motion.acceleration_m_s2 - gravity) +
                        accel_bias + options.imu.accel_noise * per_sample * vector_from(noise);
    sequence.imu.push_back(sample);
    sequence.truth.push_back({time, motion.body, motion.velocity_m_s, gyro_bias, accel_bias});
    gyro_bias += options.imu.gyro_walk / per_sample * vector_from(noise);
    accel_bias += options.imu.accel_walk / per_sample * vector_from(noise);
  }
}

std::uint64_t room_seed(const SceneOptions& options) {
  return options.room_seed.value_or(options.path.seed);
}

RoomKind kind_of(const SceneOptions& options) {
  return options.path.shape == PathShape::kRing ? RoomKind::kCorridor : RoomKind::kRoom;
}

/// All that rendering needs, shared by the copies of the sequence.
struct Renderer {
  SceneOptions options;
  RobotPath path;
  Room room;
  std::vector<CameraModel> models;
  std::vector<RoomCamera> cameras;

  explicit Renderer(const SceneOptions& given)
      : options(given),
        path(given.path),
        room(room_seed(given), kind_of(given)),
        models(make_cameras(given)) {
    for (const auto& model : models) cameras.emplace_back(room, model);
  }
  Renderer(const Renderer&) = delete;  // cameras point to the room

  [[nodiscard]] GreyImage picture(std::size_t frame, std::size_t camera) const {
    const double t = static_cast<double>(frame) / options.camera_rate_hz;
    const double exposure_s = options.exposure_ms / 1e3;
    const BodyMotion motion = path.at(t);
    // A sample of the exposure a pixel of motion, for things at a metre.
    const double blur = exposure_s * models[camera].focal() *
                        (motion.turn_rad_s.norm() + motion.velocity_m_s.norm());
    const int count = blur < 0.05 ? 1 : std::min(2 + static_cast<int>(blur), 6);
    std::vector<Pose> poses;
    for (int k = 0; k < count; ++k) {
      const double at = t + exposure_s * ((k + 0.5) / count - 0.5);
      poses.push_back(path.at(at).body * models[camera].body_from_camera);
    }
    GreyImage image = cameras[camera].picture(poses);
    add_noise(image, options.noise_levels,
              hash_u64(derive_seed(options.path.seed, "pixels"), 2 * frame + camera));
    return image;
  }
};

}  // namespace

void check_options(const SceneOptions& o) {
  const auto check = [](const char* what, double value, double low, double high) {
    if (value >= low && value <= high) return;
    throw_bad_input(fmt::format("{} must be between {} and {}, got {}", what, low, high, value));
  };
  check("the duration in seconds", o.path.duration_s, 1.0, 3600.0);
  check("the rest in seconds", o.path.rest_s, 0.0, o.path.duration_s);
  check("the width in pixels", o.width, 64, 4096);
  check("the height in pixels", o.height, 64, 4096);
  check("the camera's rate in Hz", o.camera_rate_hz, 1, 1000);
  check("the IMU's rate in Hz", o.imu.rate_hz, 10, 10000);
  check("the noise in grey levels", o.noise_levels, 0, 50);
  check("the exposure in ms", o.exposure_ms, 0, 1e3 / o.camera_rate_hz);
}

Sequence generate_sequence(const SceneOptions& options) {
  check_options(options);
  const auto renderer = std::make_shared<const Renderer>(options);
  Sequence sequence;
  sequence.name = fmt::format("generated, seed {}", options.path.seed);
  sequence.cameras = renderer->models;
  sequence.imu_model = options.imu;
  make_imu(options, renderer->path, sequence);
  const auto frames =
      static_cast<std::size_t>(std::floor(options.path.duration_s * options.camera_rate_hz));
  for (std::size_t i = 0; i < frames; ++i) {
    sequence.frames.push_back({kStart + from_s(static_cast<double>(i) / options.camera_rate_hz),
                               std::vector<bool>(sequence.cameras.size(), true)});
  }
  sequence.image = [renderer](std::size_t frame, std::size_t camera) {
    return renderer->picture(frame, camera);
  };
  return sequence;
}

FloorMap floor_map(const SceneOptions& options) {
  constexpr double kCell_m = 0.05;
  constexpr int kWall = 2;  // cells
  constexpr double kRobotHeight_m = 1.7;
  const double side_m = size_of(kind_of(options)).x();
  const int inside = static_cast<int>(std::lround(side_m / kCell_m));
  const int side = inside + 2 * kWall;
  const Room room(room_seed(options), kind_of(options));
  std::string cells(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), '\0');
  for (int row = 0; row < side; ++row) {  // the picture's first row is the highest y
    for (int column = 0; column < side; ++column) {
      const double x = (column - kWall + 0.5) * kCell_m;
      const double y = (side - 1 - row - kWall + 0.5) * kCell_m;
      bool free = x > 0 && y > 0 && x < side_m && y < side_m;
      for (const auto& box : room.furniture()) {
        free = free && !(box.low.z() < kRobotHeight_m && x > box.low.x() - kCell_m / 2 &&
                         x < box.high.x() + kCell_m / 2 && y > box.low.y() - kCell_m / 2 &&
                         y < box.high.y() + kCell_m / 2);
      }
      cells[pixel_index(column, row, side)] = static_cast<char>(free ? 254 : 0);
    }
  }
  // Across the room from where the robot starts, in the ring that has no furniture; of a corridor,
  // where it is half around.
  const Pose body = RobotPath(options.path).at(0).body;
  const Eigen::Vector3d& start = body.position;
  const Eigen::Vector2d centre(side_m / 2, side_m / 2);
  const Eigen::Vector2d off = start.head<2>() - centre;
  const Eigen::Vector2d goal =
      centre - (kind_of(options) == RoomKind::kCorridor ? off : 2.2 * off.normalized());
  FloorMap map;
  map.pgm = fmt::format("P5\n{} {}\n255\n", side, side) + cells;
  map.yaml = fmt::format(
      "image: map.pgm\nmode: trinary\nresolution: {}\norigin: [{}, {}, 0.0]\nnegate: 0\n"
      "occupied_thresh: 0.65\nfree_thresh: 0.25\n",
      kCell_m, -kWall * kCell_m, -kWall * kCell_m);
  constexpr double kDegrees = 180 / std::numbers::pi;
  const Eigen::Vector3d ahead =
      (body * make_cameras(options).front().body_from_camera).rotation.col(2);
  map.goal_yaml =
      fmt::format("goal: [{:.3f}, {:.3f}]\nstart: [{:.3f}, {:.3f}, {:.2f}]\n", goal.x(), goal.y(),
                  start.x(), start.y(), kDegrees * std::atan2(ahead.y(), ahead.x()));
  return map;
}

}  // namespace pirt
