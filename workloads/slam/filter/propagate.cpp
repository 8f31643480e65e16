#include "workloads/slam/filter/propagate.h"

#include <algorithm>
#include <cmath>

#include "workloads/inputs/sequence/stamps.h"

namespace pirt::slam {
namespace {

using Matrix15 = Eigen::Matrix<double, kMotionSize, kMotionSize>;

/// Of the sensor noise, per axis, continuous: variance density.
struct Noise {
  double gyro, accel, gyro_walk, accel_walk;
};

/// What a body may do while nobody measures it.
constexpr double kUnseenTurn = 0.5;   // rad/s/sqrt(Hz)
constexpr double kUnseenAccel = 3.0;  // m/s^2/sqrt(Hz)
/// Without an IMU: how fast turn and velocity change.
constexpr double kTurnChange = 0.7;   // rad/s^2/sqrt(Hz)
constexpr double kSpeedChange = 1.0;  // m/s^2/sqrt(Hz)
/// A step longer than this many periods is a gap.
constexpr double kGap = 3.0;
/// A longer step is taken in parts: what is noise of the velocity at its begin moves the position
/// at its end.
constexpr double kLongestStep_s = 0.02;

double squared(double x) { return x * x; }

struct Propagation {
  double dt;
  Eigen::Vector3d turn;   ///< rad/s, of the body, bias taken out.
  Eigen::Vector3d force;  ///< m/s^2, of the body, bias taken out.
  Eigen::Vector3d gravity;
  Noise noise;
};

/// Error over one step: transition and noise, to second order.
void step_error(const MotionState& m, const Propagation& s, bool imu, Matrix15& transition,
                Matrix15& noise) {
  Matrix15 f = Matrix15::Zero();
  const Eigen::Matrix3d& r = m.rotation;
  const Eigen::Matrix3d vr = cross_matrix(m.velocity) * r;
  const Eigen::Matrix3d pr = cross_matrix(m.position) * r;
  f.block<3, 3>(0, kGyroBiasAt) = -r;
  f.block<3, 3>(kVelocityAt, 0) = cross_matrix(s.gravity);
  f.block<3, 3>(kVelocityAt, kGyroBiasAt) = -vr;
  if (imu) f.block<3, 3>(kVelocityAt, kAccelBiasAt) = -r;
  f.block<3, 3>(kPositionAt, kVelocityAt).setIdentity();
  f.block<3, 3>(kPositionAt, kGyroBiasAt) = -pr;
  transition = Matrix15::Identity() + f * s.dt + 0.5 * s.dt * s.dt * f * f;
  Eigen::Matrix<double, kMotionSize, 6> g = Eigen::Matrix<double, kMotionSize, 6>::Zero();
  g.block<3, 3>(0, 0) = r;
  g.block<3, 3>(kVelocityAt, 0) = vr;
  g.block<3, 3>(kPositionAt, 0) = pr;
  g.block<3, 3>(kVelocityAt, 3) = r;
  Eigen::Matrix<double, 6, 1> density;
  density << Eigen::Vector3d::Constant(s.noise.gyro), Eigen::Vector3d::Constant(s.noise.accel);
  noise = g * (density * s.dt).asDiagonal() * g.transpose();
  noise.diagonal().segment<3>(kGyroBiasAt).array() += s.noise.gyro_walk * s.dt;
  noise.diagonal().segment<3>(kAccelBiasAt).array() += s.noise.accel_walk * s.dt;
}

void step_motion(MotionState& m, const Propagation& s) {
  const Eigen::Matrix3d half = m.rotation * rotation_of(0.5 * s.dt * s.turn);
  const Eigen::Vector3d acceleration = half * s.force + s.gravity;
  m.position += s.dt * (m.velocity + 0.5 * s.dt * acceleration);
  m.velocity += s.dt * acceleration;
  m.rotation = nearest_rotation(m.rotation * rotation_of(s.dt * s.turn));
}

ImuSample between(const ImuSample& a, const ImuSample& b, Nanos time) {
  const double part = to_s(time - a.time) / to_s(b.time - a.time);
  return {time, (1 - part) * a.gyro_rad_s + part * b.gyro_rad_s,
          (1 - part) * a.accel_m_s2 + part * b.accel_m_s2};
}

class Integration {
 public:
  Integration(State& state, const Setup& setup)
      : state_(state), setup_(setup), motion_(state.motion) {}

  void advance(const ImuSample& from, const ImuSample& to, bool measured) {
    const ImuModel& imu = *setup_.imu;
    Propagation step;
    step.dt = to_s(to.time - from.time);
    if (step.dt <= 0) return;
    step.turn = 0.5 * (from.gyro_rad_s + to.gyro_rad_s) - motion_.gyro_bias;
    step.force = 0.5 * (from.accel_m_s2 + to.accel_m_s2) - motion_.accel_bias;
    step.gravity = {0, 0, -kGravity};
    step.noise = {squared(imu.gyro_noise), squared(imu.accel_noise), squared(imu.gyro_walk),
                  squared(imu.accel_walk)};
    if (!measured) {
      step.noise.gyro += squared(kUnseenTurn);
      step.noise.accel += squared(kUnseenAccel);
    }
    take(step, true);
  }

  void coast(double dt) {
    Propagation step;
    step.dt = dt;
    step.turn = -motion_.gyro_bias;
    step.force.setZero();
    step.gravity.setZero();
    step.noise = {0, squared(kSpeedChange), squared(kTurnChange), 0};
    take(step, false);
  }

  void finish() {
    Eigen::MatrixXd& p = state_.covariance;
    const auto tail = p.rows() - kMotionSize;
    const Matrix15 own =
        transition_ * p.topLeftCorner<kMotionSize, kMotionSize>() * transition_.transpose() +
        noise_;
    p.topLeftCorner<kMotionSize, kMotionSize>() = 0.5 * (own + own.transpose());
    const Eigen::MatrixXd cross = transition_ * p.topRightCorner(kMotionSize, tail);
    p.topRightCorner(kMotionSize, tail) = cross;
    p.bottomLeftCorner(tail, kMotionSize) = cross.transpose();
    state_.motion = motion_;
  }

 private:
  void take(Propagation step, bool imu) {
    step.dt = std::min(step.dt, to_s(kLongestPrediction));
    const int parts = std::max(1, static_cast<int>(std::ceil(step.dt / kLongestStep_s)));
    step.dt /= parts;
    for (int i = 0; i < parts; ++i) {
      Matrix15 transition;
      Matrix15 noise;
      step_error(motion_, step, imu, transition, noise);
      step_motion(motion_, step);
      transition_ = transition * transition_;
      noise_ = transition * noise_ * transition.transpose() + noise;
    }
  }

  State& state_;
  const Setup& setup_;
  MotionState motion_;
  Matrix15 transition_ = Matrix15::Identity();
  Matrix15 noise_ = Matrix15::Zero();
};

}  // namespace

void imu_propagate(State& state, const Setup& setup, std::span<const ImuSample> samples,
                   Nanos until) {
  if (until <= state.time) return;
  Integration integration(state, setup);
  if (!setup.imu) {
    integration.coast(to_s(until - state.time));
    integration.finish();
    state.time = until;
    return;
  }
  const Nanos longest = from_s(kGap / setup.imu->rate_hz);
  ImuSample last = state.last_imu;
  bool begun = last.time.count() != 0;
  for (const auto& sample : samples) {
    if (sample.time <= state.time) {
      last = sample;
      begun = true;
      continue;
    }
    if (!begun) last = sample, last.time = state.time, begun = true;
    // `last` may be from before state.time; what lies before it has been integrated.
    ImuSample from = last.time < state.time ? between(last, sample, state.time) : last;
    const bool measured = sample.time - last.time <= longest;
    if (sample.time >= until) {
      const ImuSample end = between(last, sample, until);
      integration.advance(from, end, measured);
      last = end;
      break;
    }
    integration.advance(from, sample, measured);
    last = sample;
  }
  if (last.time < until) {  // the samples stopped
    if (last.time < state.time) last.time = state.time;
    ImuSample end = last;
    end.time = until;
    integration.advance(last, end, until - last.time <= longest);
    last = end;
  }
  integration.finish();
  state.last_imu = last;
  state.time = until;
}

}  // namespace pirt::slam
