#include "workloads/slam/workload/recording.h"

#include <algorithm>
#include <cmath>

#include "workloads/base/math/gaussian.h"
#include "workloads/base/math/random.h"
#include "workloads/inputs/scene/room.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/filter/propagate.h"
#include "workloads/slam/workload/specs.h"

namespace pirt::slam {
namespace {

constexpr std::uint64_t kSeed = 1;
constexpr int kPoints = 2500;
constexpr double kPixelNoise = 0.1;  // sigma of what is followed, in each picture
constexpr double kWrongBits = 0.03;  // of a descriptor's, from view to view

PathOptions path_options(const RecordingOptions& given) {
  PathOptions options;
  options.duration_s = given.duration_s;
  options.rest_s = given.rest_s;
  options.seed = given.path_seed;
  return options;
}

/// On one of the room's six faces.
Eigen::Vector3d wall_point(Random& random) {
  const Eigen::Vector3d size(kRoomSide_m, kRoomSide_m, kRoomHeight_m);
  Eigen::Vector3d point;
  for (Eigen::Index i = 0; i < 3; ++i) point(i) = random.uniform(0.0, size(i));
  const auto face = static_cast<Eigen::Index>(random.below(6));
  point(face / 2) = face % 2 == 0 ? 0.0 : size(face / 2);
  return point;
}

}  // namespace

Recording::Recording(const RecordingOptions& options)
    : seed_(options.path_seed), setup_(recorded_setup()), path_(path_options(options)) {
  Random random(options.room_seed);
  for (int i = 0; i < kPoints; ++i) {
    Point point{wall_point(random), {}};
    for (auto& byte : point.descriptor) byte = static_cast<std::uint8_t>(random.below(256));
    points_.push_back(point);
  }
}

Pose Recording::start() const {
  const Pose first = path_.at(0.0).body;
  const Eigen::Vector3d forward = first.rotation.col(0);
  return {rotation_of({0, 0, std::atan2(forward.y(), forward.x())}), first.position};
}

Pose Recording::truth_at(int frame) const {
  return start().inverse() * path_.at(to_s(time_of(frame))).body;
}

std::vector<Eigen::Vector3d> Recording::points() const {
  const Pose world = start().inverse();
  std::vector<Eigen::Vector3d> points;
  for (const Point& point : points_) points.push_back(world * point.position);
  return points;
}

std::vector<ImuSample> Recording::samples(int frame) const {
  const ImuModel& imu = *setup_.imu;
  const Eigen::Vector3d gravity(0, 0, -kGravity);
  const double sigma = std::sqrt(imu.rate_hz);
  std::vector<ImuSample> samples;
  for (int i = 0; i < kSamplesPerFrame; ++i) {
    const int index = frame * kSamplesPerFrame + i + 1;
    Gaussian noise(derive_seed(seed_, "imu") + static_cast<std::uint64_t>(index));
    const auto random = [&] {
      const double x = noise.next(), y = noise.next(), z = noise.next();
      return Eigen::Vector3d(x, y, z);
    };
    ImuSample sample;
    sample.time = from_s(index / imu.rate_hz);
    const BodyMotion motion = path_.at(to_s(sample.time));
    sample.gyro_rad_s = motion.turn_rad_s + imu.gyro_noise * sigma * random();
    sample.accel_m_s2 = motion.body.rotation.transpose() * (motion.acceleration_m_s2 - gravity) +
                        imu.accel_noise * sigma * random();
    samples.push_back(sample);
  }
  return samples;
}

std::optional<Eigen::Vector2d> Recording::seen(std::size_t point, int frame) const {
  const Pose camera = camera_pose(setup_, path_.at(to_s(time_of(frame))).body, 0);
  auto pixel = pixel_of(setup_.cameras[0], camera, points_[point].position);
  if (!pixel || !setup_.cameras[0].contains(*pixel, kFeatureRim)) return std::nullopt;
  return pixel;
}

Features Recording::features(int frame, std::uint64_t noise) const {
  Gaussian gaussian(hash_u64(noise, static_cast<std::uint64_t>(frame)));
  Random random(hash_u64(noise, static_cast<std::uint64_t>(frame)));
  Features features;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const auto pixel = seen(i, frame);
    if (!pixel) continue;
    if (std::ssize(features.pixels) >= FeatureOptions{}.most) break;
    const double x = kPixelNoise * gaussian.next(), y = kPixelNoise * gaussian.next();
    features.pixels.push_back((*pixel + Eigen::Vector2d(x, y)).cast<float>());
    features.scores.push_back(1e5F - static_cast<float>(i));
    Descriptor descriptor = points_[i].descriptor;
    for (std::size_t bit = 0; bit < 8 * descriptor.size(); ++bit) {
      if (random.uniform() >= kWrongBits) continue;
      descriptor[bit / 8] = static_cast<std::uint8_t>(descriptor[bit / 8] ^ (1U << (bit % 8)));
    }
    features.descriptors.push_back(descriptor);
  }
  return features;
}

FrameTracks Recording::tracks(const State& state, int frame, std::uint64_t noise) const {
  Gaussian gaussian(hash_u64(noise, static_cast<std::uint64_t>(frame)) + 1);
  FrameTracks tracks;
  for (const Track& track : state.tracks) {
    // Whose descriptor it has: others differ in half of the bits.
    const auto nearest = std::ranges::min_element(points_, {}, [&](const Point& point) {
      return distance(point.descriptor, track.descriptor);
    });
    const auto pixel = seen(static_cast<std::size_t>(nearest - points_.begin()), frame);
    const double x = kPixelNoise * gaussian.next(), y = kPixelNoise * gaussian.next();
    TrackedPoint point;
    point.found = pixel.has_value();
    if (pixel) point.pixel = (*pixel + Eigen::Vector2d(x, y)).cast<float>();
    tracks.left.push_back(point);
  }
  return tracks;
}

Moment moment_of(const Recording& recording, int frame) {
  const Setup& setup = recording.setup();
  constexpr std::uint64_t kNoise = kSeed;
  State state;
  Moment moment;
  for (int i = 0; i <= frame; ++i) {
    const Nanos time = recording.time_of(i);
    const auto samples = recording.samples(i);
    moment.before_propagate = state;
    if (state.status == Status::kStarting) {
      start(state, setup, samples, time);
    } else {
      imu_propagate(state, setup, samples, time);
    }
    if (state.status == Status::kStarting) continue;
    moment.before_update = state;
    const Features features = recording.features(i, kNoise);
    update_pose(state, setup, recording.tracks(state, i, kNoise), features);
    moment.before_extend = state;
    extend_map(state, setup, features);
  }
  moment.frame = frame;
  return moment;
}

}  // namespace pirt::slam
