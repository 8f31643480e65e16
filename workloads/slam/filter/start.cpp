// The first pose: from rest with an IMU, from the first base line without.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/propagate.h"
#include "workloads/slam/filter/steps.h"

namespace pirt::slam {
namespace {

constexpr double kWait_s = 0.25;          // of samples, for a mean
constexpr double kRestTurn_rad_s = 0.05;  // standard deviation of a body at rest, vibration in
constexpr double kRestForce_m_s2 = 0.5;
constexpr double kGyroBiasSigma_rad_s = 0.1;
constexpr double kAccelBiasSigma_m_s2 = 0.25;

struct Mean {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), force = Eigen::Vector3d::Zero();
  double turn_spread = 0, force_spread = 0;
};

Mean mean_of(const std::vector<ImuSample>& samples) {
  Mean mean;
  const auto count = static_cast<double>(samples.size());
  for (const auto& s : samples)
    mean.turn += s.gyro_rad_s / count, mean.force += s.accel_m_s2 / count;
  for (const auto& s : samples) {
    mean.turn_spread += (s.gyro_rad_s - mean.turn).squaredNorm() / count;
    mean.force_spread += (s.accel_m_s2 - mean.force).squaredNorm() / count;
  }
  mean.turn_spread = std::sqrt(mean.turn_spread);
  mean.force_spread = std::sqrt(mean.force_spread);
  return mean;
}

/// The rotation with no heading that sees @p force as up.
Eigen::Matrix3d level(const Eigen::Vector3d& force) {
  const Eigen::Vector3d up = force.normalized();
  Eigen::Vector3d forward = Eigen::Vector3d::UnitX() - up * up.x();
  if (forward.norm() < 0.1) forward = Eigen::Vector3d::UnitY() - up * up.y();
  forward.normalize();
  Eigen::Matrix3d rotation;
  rotation.row(0) = forward;
  rotation.row(1) = up.cross(forward);
  rotation.row(2) = up;
  return rotation;
}

}  // namespace

void start(State& state, const Setup& setup, std::span<const ImuSample> samples, Nanos time) {
  if (!setup.imu || state.status != Status::kStarting) return;
  for (const auto& sample : samples) {
    if (sample.time > time) break;
    if (state.waiting.empty() || sample.time > state.waiting.back().time) {
      state.waiting.push_back(sample);
    }
  }
  state.time = time;
  if (state.waiting.size() < 4 ||
      to_s(state.waiting.back().time - state.waiting.front().time) < kWait_s) {
    return;
  }
  const Mean mean = mean_of(state.waiting);
  const bool rest = mean.turn_spread < kRestTurn_rad_s && mean.force_spread < kRestForce_m_s2 &&
                    mean.turn.norm() < 3 * kGyroBiasSigma_rad_s;
  state.motion = {};
  state.motion.rotation = level(mean.force);
  if (rest) state.motion.gyro_bias = mean.turn;
  constexpr double kKnown = 1e-5;  // where the world begins, and where its north is
  Eigen::Matrix<double, kMotionSize, 1> sigma;
  sigma << 0.3, 0.3, kKnown, Eigen::Vector3d::Constant(rest ? 0.01 : 1.5),
      Eigen::Vector3d::Constant(kKnown), Eigen::Vector3d::Constant(rest ? 0.005 : 0.1),
      Eigen::Vector3d::Constant(kAccelBiasSigma_m_s2);
  state.covariance = sigma.cwiseAbs2().asDiagonal();
  // The mean force ties level and bias together: f = R^T up + bias.
  RowBlock block;
  const Eigen::Vector3d up(0, 0, kGravity);
  const Eigen::Matrix3d back = state.motion.rotation.transpose();
  block.residual = mean.force - back * up;
  block.parts.push_back({0, back * cross_matrix(up)});
  block.parts.push_back({kAccelBiasAt, Eigen::Matrix3d::Identity()});
  block.sigma = rest ? 0.01 : 1.0;
  kalman_update(state, {block});
  state.last_imu = state.waiting.back();
  state.last_imu.time = time;
  state.waiting.clear();
  state.status = Status::kTracking;
}

void begin_frame(State& state, const Setup& setup, std::span<const ImuSample> samples, Nanos time) {
  const Nanos before = state.time;
  if (state.status != Status::kStarting) {
    imu_propagate(state, setup, samples, time);
  } else if (setup.imu) {
    start(state, setup, samples, time);
  }
  state.previous_time = before;
  state.time = time;
}

bool sees(const State& state, const Setup& setup) {
  return state.status != Status::kStarting || !setup.imu;
}

}  // namespace pirt::slam
