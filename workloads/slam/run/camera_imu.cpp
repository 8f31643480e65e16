#include "workloads/slam/run/camera_imu.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "workloads/base/error.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/slam/run/pipeline.h"
#include "workloads/slam/views/two_views.h"
#include "workloads/vision/features.h"
#include "workloads/vision/pyramid.h"

namespace pirt::slam {
namespace {

constexpr double kFarthest_s = 0.06;
constexpr double kStep_s = 0.002;
constexpr std::size_t kChain = 5;     // pictures from one that is compared to the next
constexpr std::size_t kStretch = 26;  // pictures in a row
constexpr std::size_t kStretches = 4;
constexpr double kLeastTold_s = 0.005;
constexpr double kLeastTilt_rad = 1 / kDegreesPerRadian;
constexpr double kSigmas = 4;

/// How the body has turned since the first sample.
class Gyroscope {
 public:
  explicit Gyroscope(std::span<const ImuSample> samples) : samples_(samples) {
    turned_.push_back(Eigen::Matrix3d::Identity());
    summed_.push_back(Eigen::Vector3d::Zero());
    for (std::size_t i = 1; i < samples.size(); ++i) {
      const double dt = to_s(samples[i].time - samples[i - 1].time);
      const Eigen::Vector3d mean = 0.5 * (samples[i].gyro_rad_s + samples[i - 1].gyro_rad_s);
      turned_.push_back(nearest_rotation(turned_.back() * rotation_of(dt * mean)));
      summed_.push_back(summed_.back() + dt * mean);
    }
  }
  [[nodiscard]] bool covers(Nanos from, Nanos until) const {
    const Nanos most = from_s(kFarthest_s + kStep_s);
    return samples_.front().time <= from - most && until + most <= samples_.back().time;
  }
  /// The turn's vector. @param late_s  Of the stamps.
  [[nodiscard]] Eigen::Vector3d between(Nanos from, Nanos to, double late_s) const {
    return vector_of(until(from - from_s(late_s)).transpose() * until(to - from_s(late_s)));
  }
  /// The same of small turns, as a sum, which does not end at half a turn if it is of degrees.
  [[nodiscard]] Eigen::Vector3d summed_between(Nanos from, Nanos to) const {
    return summed_[sample_at(to)] - summed_[sample_at(from)];
  }
  [[nodiscard]] Eigen::Matrix3d until(Nanos time) const {
    const auto after = std::ranges::upper_bound(samples_, time, {}, &ImuSample::time);
    const auto i = static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(after - samples_.begin(), 1, std::ssize(samples_) - 1));
    const ImuSample& a = samples_[i - 1];
    const ImuSample& b = samples_[i];
    const double dt = to_s(time - a.time);
    const double part = dt / to_s(b.time - a.time);
    const Eigen::Vector3d mean = a.gyro_rad_s + 0.5 * part * (b.gyro_rad_s - a.gyro_rad_s);
    return turned_[i - 1] * rotation_of(dt * mean);
  }

 private:
  [[nodiscard]] std::size_t sample_at(Nanos time) const {
    const auto at = std::ranges::lower_bound(samples_, time, {}, &ImuSample::time);
    return static_cast<std::size_t>(std::min(at - samples_.begin(), std::ssize(samples_) - 1));
  }

  std::span<const ImuSample> samples_;
  std::vector<Eigen::Matrix3d> turned_;
  std::vector<Eigen::Vector3d> summed_;
};

/// First frames of stretches that do not overlap, where what changes from picture to picture
/// changes most.
/// @param stretch  How many frames.
std::vector<std::size_t> stretches_of(const std::vector<double>& changes, std::size_t stretch,
                                      std::size_t count) {
  std::vector<std::size_t> starts;
  const std::size_t length = std::min(stretch, changes.size());
  while (starts.size() < count) {
    double most = 0;
    std::size_t best = 0;
    for (std::size_t i = 0; i + length <= changes.size(); ++i) {
      if (std::ranges::any_of(starts,
                              [&](std::size_t s) { return i < s + length && s < i + length; })) {
        continue;
      }
      double sum = 0;
      for (std::size_t k = i + 1; k < i + length; ++k) sum += changes[k];
      if (sum > most) most = sum, best = i;
    }
    if (most <= 0) break;
    starts.push_back(best);
  }
  return starts;
}

/// Of the turn rate: a steady turn tells no time.
std::vector<double> changes_of_turn(const Sequence& sequence, const Gyroscope& gyroscope) {
  const auto& frames = sequence.frames;
  std::vector<double> changes(frames.size(), 0.0);
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (!gyroscope.covers(frames[i - 1].time, frames[i].time)) continue;
    const Eigen::Vector3d turn = gyroscope.between(frames[i - 1].time, frames[i].time, 0);
    changes[i] = (turn - before).norm();
    before = turn;
  }
  return changes;
}

/// How the body turned between two pictures, by them.
struct SeenTurn {
  Nanos from, to;
  Eigen::Vector3d turn;
};

/// Follows the corners of each kChain-th picture through those up to the next: a turn that takes
/// longer differs more where it is looked for at another time, and is seen as well.
void see_turns(const Sequence& sequence, std::size_t first, const Gyroscope& gyroscope,
               std::vector<SeenTurn>& turns) {
  const CameraModel& camera = sequence.cameras[0];
  const Eigen::Matrix3d& mount = camera.body_from_camera.rotation;
  const std::size_t end = std::min(first + kStretch, sequence.frames.size());
  GreyImage image = sequence.image(first, 0);
  if (image.empty()) return;
  Pyramid before = make_pyramid(std::move(image));
  for (std::size_t i = first; i + kChain < end; i += kChain) {
    auto begun = extract_features(before.levels[0], {.most = 150}).pixels;
    auto points = begun;
    for (std::size_t k = i + 1; k <= i + kChain; ++k) {
      image = sequence.image(k, 0);
      if (image.empty()) return;
      Pyramid now = make_pyramid(std::move(image));
      const auto tracked = track_features(before, now, points, points, {});
      std::size_t kept = 0;
      for (std::size_t p = 0; p < points.size(); ++p) {
        if (!tracked[p].found) continue;
        begun[kept] = begun[p];
        points[kept++] = tracked[p].pixel;
      }
      begun.resize(kept);
      points.resize(kept);
      before = std::move(now);
    }
    std::vector<RayPair> pairs;
    for (std::size_t p = 0; p < points.size(); ++p) {
      pairs.push_back({camera.ray(begun[p].cast<double>()), camera.ray(points[p].cast<double>())});
    }
    const Nanos from = sequence.frames[i].time;
    const Nanos to = sequence.frames[i + kChain].time;
    if (!gyroscope.covers(from, to)) continue;
    const Eigen::Matrix3d expected = rotation_of(gyroscope.between(from, to, 0)).transpose();
    const auto turn = turn_of(pairs, 1.0 / camera.focal(), mount.transpose() * expected * mount);
    if (!turn) continue;
    turns.push_back({from, to, vector_of(mount * turn->rotation.transpose() * mount.transpose())});
  }
}

/// Of one lateness: seen turn = turn + tilt x turn - bias * time.
struct Fit {
  Eigen::Matrix<double, 6, 1> unknowns = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  std::vector<double> misses;
  double cost = 0;
};

Fit fit_at(const std::vector<SeenTurn>& turns, const std::vector<double>& weights,
           const Gyroscope& gyroscope, double late_s) {
  Fit fit;
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  std::vector<Eigen::Vector3d> residuals;
  std::vector<Eigen::Matrix<double, 3, 6>> slopes;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const SeenTurn& seen = turns[i];
    const Eigen::Vector3d turn = gyroscope.between(seen.from, seen.to, late_s);
    Eigen::Matrix<double, 3, 6> slope;
    slope << -cross_matrix(turn), -to_s(seen.to - seen.from) * Eigen::Matrix3d::Identity();
    residuals.emplace_back(seen.turn - turn);
    slopes.push_back(slope);
    fit.information += weights[i] * slope.transpose() * slope;
    right += weights[i] * slope.transpose() * residuals.back();
  }
  fit.unknowns = fit.information.ldlt().solve(right);
  for (std::size_t i = 0; i < turns.size(); ++i) {
    fit.misses.push_back((residuals[i] - slopes[i] * fit.unknowns).norm());
    fit.cost += weights[i] * fit.misses.back() * fit.misses.back();
  }
  return fit;
}

double best_lateness(const std::vector<SeenTurn>& turns, const std::vector<double>& weights,
                     const Gyroscope& gyroscope) {
  double best = 0;
  double least = std::numeric_limits<double>::max();
  const int steps = static_cast<int>(std::lround(kFarthest_s / kStep_s));
  for (int i = -steps; i <= steps; ++i) {
    const double cost = fit_at(turns, weights, gyroscope, i * kStep_s).cost;
    if (cost < least) least = cost, best = i * kStep_s;
  }
  return best;
}

}  // namespace

std::optional<CameraImuFit> fit_camera_to_imu(const Sequence& sequence) {
  constexpr std::size_t kLeastPairs = 10;
  if (sequence.imu.size() < 3 || sequence.frames.size() <= kChain) return std::nullopt;
  const Gyroscope gyroscope(sequence.imu);
  std::vector<SeenTurn> turns;
  for (const std::size_t first :
       stretches_of(changes_of_turn(sequence, gyroscope), kStretch, kStretches)) {
    see_turns(sequence, first, gyroscope, turns);
  }
  if (turns.size() < kLeastPairs) return std::nullopt;
  // Cauchy's weights of what the fit before leaves: some pairs of pictures show little.
  std::vector<double> weights(turns.size(), 1.0);
  double late_s = 0;
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    late_s = best_lateness(turns, weights, gyroscope);
    const auto misses = fit_at(turns, weights, gyroscope, late_s).misses;
    auto sorted = misses;
    std::ranges::nth_element(sorted, sorted.begin() + std::ssize(sorted) / 2);
    const double scale = 2 * std::max(sorted[sorted.size() / 2], 1e-7);
    for (std::size_t i = 0; i < turns.size(); ++i) {
      weights[i] = 1 / (1 + misses[i] * misses[i] / (scale * scale));
    }
  }
  const auto at = [&](double s) { return fit_at(turns, weights, gyroscope, s).cost; };
  const double low = at(late_s - kStep_s);
  const double high = at(late_s + kStep_s);
  const Fit best = fit_at(turns, weights, gyroscope, late_s);
  const double bend = low - 2 * best.cost + high;
  if (bend <= 0) return std::nullopt;
  CameraImuFit fit;
  fit.pairs = turns.size();
  fit.late_s = late_s + 0.5 * kStep_s * (low - high) / bend;
  double sum = 0;
  for (const double weight : weights) sum += weight;
  // Of a turn, an axis. Half of the weights are at least 0.8, so that more is seen than is unknown.
  constexpr double kUnknowns = 7;  // the fit's, and the lateness
  const double variance = best.cost / (3 * sum - kUnknowns);
  // Half the second derivative of the cost, over the variance, is the information.
  fit.sigma_s = kStep_s * std::sqrt(2 * variance / bend);
  if (!(kSigmas * fit.sigma_s <= std::max(kLeastTold_s, std::abs(fit.late_s)))) return std::nullopt;
  fit.tilt_rad = best.unknowns.head<3>();
  const Eigen::Matrix<double, 6, 6> covariance =
      variance * best.information.ldlt().solve(Eigen::Matrix<double, 6, 6>::Identity());
  fit.tilt_sigma_rad = std::sqrt(covariance.topLeftCorner<3, 3>().diagonal().maxCoeff());
  return fit;
}

namespace {

/// Of the samples within half a picture's usual period of each frame, body axes; zero where there
/// are none.
std::vector<Eigen::Vector3d> forces_of(const Sequence& sequence) {
  const auto& frames = sequence.frames;
  const Nanos half = usual_step(stamps_of(frames)) / 2;
  std::vector<Eigen::Vector3d> forces;
  for (const Frame& frame : frames) {
    const auto from =
        std::ranges::lower_bound(sequence.imu, frame.time - half, {}, &ImuSample::time);
    const auto to = std::ranges::lower_bound(sequence.imu, frame.time + half, {}, &ImuSample::time);
    Eigen::Vector3d& force = forces.emplace_back(Eigen::Vector3d::Zero());
    for (auto sample = from; sample < to; ++sample) {
      force += sample->accel_m_s2 / static_cast<double>(to - from);
    }
  }
  return forces;
}

/// Pictures alone.
Sequence part_of(const Sequence& sequence, std::size_t first, std::size_t count) {
  Sequence part;
  part.cameras = sequence.cameras;
  for (std::size_t i = first; i < std::min(first + count, sequence.frames.size()); ++i) {
    part.frames.push_back(sequence.frames[i]);
  }
  part.image = [&sequence, first](std::size_t frame, std::size_t camera) {
    return sequence.image(first + frame, camera);
  };
  return part;
}

/// Of vectors in pairs.
class Correlation {
 public:
  /// @param centred  Whether what all of them have in common, as gravity, counts for nothing.
  void add(const std::vector<Eigen::Vector3d>& seen, const std::vector<Eigen::Vector3d>& felt,
           bool centred) {
    Eigen::Vector3d seen_mean = Eigen::Vector3d::Zero(), felt_mean = Eigen::Vector3d::Zero();
    const auto count = static_cast<double>(seen.size());
    for (std::size_t i = 0; centred && i < seen.size(); ++i) {
      seen_mean += seen[i] / count, felt_mean += felt[i] / count;
    }
    for (std::size_t i = 0; i < seen.size(); ++i) {
      products_ += (seen[i] - seen_mean).dot(felt[i] - felt_mean);
      seen_squares_ += (seen[i] - seen_mean).squaredNorm();
      felt_squares_ += (felt[i] - felt_mean).squaredNorm();
    }
    count_ += seen.size();
  }
  /// @param least  Of what is felt, root mean square.
  [[nodiscard]] std::optional<double> value(double least) const {
    constexpr std::size_t kLeast = 25;
    const bool tells = count_ >= kLeast && seen_squares_ > 0 &&
                       felt_squares_ > least * least * static_cast<double>(count_);
    return tells ? std::optional(products_ / std::sqrt(seen_squares_ * felt_squares_))
                 : std::nullopt;
  }
  /// Of what is seen to what is felt.
  [[nodiscard]] double ratio() const { return std::sqrt(seen_squares_ / felt_squares_); }

 private:
  double products_ = 0, seen_squares_ = 0, felt_squares_ = 0;
  std::size_t count_ = 0;
};

/// By how much what the IMU feels changes at each frame.
std::vector<double> changes_of_force(const Sequence& sequence, const Gyroscope& gyroscope,
                                     const std::vector<Eigen::Vector3d>& forces) {
  std::vector<double> changes(forces.size(), 0.0);
  for (std::size_t i = 1; i < forces.size(); ++i) {
    if (forces[i].isZero() || forces[i - 1].isZero()) continue;
    const Eigen::Matrix3d turn = gyroscope.until(sequence.frames[i - 1].time).transpose() *
                                 gyroscope.until(sequence.frames[i].time);
    changes[i] = (turn * forces[i] - forces[i - 1]).norm();
  }
  return changes;
}

}  // namespace

ImuAlike compare_imu(const Sequence& sequence) {
  constexpr std::size_t kLength = 50, kCount = 2;  // pictures in a row, and how often
  constexpr double kApart_s = 0.15;  // nearer ones see less of accelerations than of noise
  constexpr double kLeastTurn_rad = 0.01, kLeastChange_m_s2 = 0.2;
  if (sequence.imu.size() < 3 || sequence.frames.size() < 2) return {};
  const double period_s = to_s(usual_step(stamps_of(sequence.frames)));
  const auto apart =
      static_cast<std::size_t>(std::clamp(std::round(kApart_s / period_s), 1.0, kLength / 4.0));
  const Gyroscope gyroscope(sequence.imu);
  const auto forces = forces_of(sequence);
  Correlation turns, accelerations;
  for (const std::size_t first :
       stretches_of(changes_of_force(sequence, gyroscope, forces), kLength, kCount)) {
    const Sequence part = part_of(sequence, first, kLength);
    RunOptions options;
    options.setup = setup_of(part);
    const auto frames = run_serially(part, options).frames;
    std::vector<Eigen::Vector3d> seen, felt, seen_turns, felt_turns;
    for (std::size_t i = apart; i + apart < frames.size(); ++i) {
      // As the second difference of places weighs accelerations.
      Eigen::Vector3d force = Eigen::Vector3d::Zero();
      bool is_known = true;
      for (std::size_t k = i - apart; k <= i + apart; ++k) {
        // The run leaves out what cannot be read, and what follows moves up.
        is_known = is_known && frames[k].status == Status::kTracking &&
                   frames[k].pose.time == sequence.frames[first + k].time &&
                   !forces[first + k].isZero();
        const auto weight = static_cast<double>(apart - (k < i ? i - k : k - i));
        force += weight / static_cast<double>(apart * apart) *
                 (frames[k].pose.body.rotation * forces[first + k]);
      }
      if (!is_known) continue;
      const StampedPose& before = frames[i - apart].pose;
      const StampedPose& after = frames[i + apart].pose;
      const double dt = to_s(after.time - before.time) / 2;
      seen.push_back(
          (after.body.position - 2 * frames[i].pose.body.position + before.body.position) /
          (dt * dt));
      felt.push_back(force);
      seen_turns.push_back(vector_of(before.body.rotation.transpose() * after.body.rotation));
      felt_turns.push_back(gyroscope.summed_between(before.time, after.time));
    }
    turns.add(seen_turns, felt_turns, false);
    accelerations.add(seen, felt, true);
  }
  return {turns.value(kLeastTurn_rad), accelerations.value(kLeastChange_m_s2), turns.ratio()};
}

std::vector<std::string> warnings_of(const ImuAlike& alike, const Sequence& sequence) {
  constexpr double kOpposite = -0.6, kAlike = 0.5;
  constexpr const char* kWithout = "or leave the IMU out (--no-imu, --topics imu=none)";
  if (alike.turns && *alike.turns < kOpposite) {
    throw_bad_input(
        fmt::format("'{}': the gyroscope turns opposite to the pictures (correlation "
                    "{:.2f}); negate its three axes, {}",
                    sequence.name, *alike.turns, kWithout));
  }
  const bool turns_fit = !alike.turns || *alike.turns > kAlike;
  constexpr double kLeastRatio = 0.1;  // of degrees 0.017
  if (alike.turns && turns_fit && alike.turn_ratio < kLeastRatio) {
    throw_bad_input(
        fmt::format("'{}': the gyroscope turns {:.0f} times as far as the pictures; are these "
                    "degrees/s? Give rad/s, {}",
                    sequence.name, 1 / alike.turn_ratio, kWithout));
  }
  // Turned by a wrong gyroscope, accelerations tell nothing.
  if (turns_fit && alike.accelerations && *alike.accelerations < kOpposite) {
    throw_bad_input(fmt::format(
        "'{}': accelerations are opposite to how the pictures move (correlation {:.2f}): the "
        "accelerometer says which way gravity pulls; give specific force, which points up at rest "
        "(negate its three axes), {}",
        sequence.name, *alike.accelerations, kWithout));
  }
  if (turns_fit) return {};
  return {fmt::format(
      "the gyroscope turns otherwise than the pictures (correlation {:.2f}): axes of the IMU, or "
      "how the camera is mounted, are others than is said: give them as they are, {}",
      *alike.turns, kWithout)};
}

std::vector<std::string> warnings_of(const CameraImuFit& fit) {
  std::vector<std::string> warnings;
  if (std::abs(fit.late_s) > std::max(kLeastTold_s, kSigmas * fit.sigma_s)) {
    warnings.push_back(fmt::format(
        "pictures' stamps are {:.1f} ms {} than the IMU's, by {} of their turns (sigma "
        "{:.1f} ms): the localization will be worse for it; --camera-late={:.1f} takes it out",
        1e3 * std::abs(fit.late_s), fit.late_s > 0 ? "later" : "earlier", fit.pairs,
        1e3 * fit.sigma_s, 1e3 * fit.late_s));
  }
  if (fit.tilt_rad.norm() > std::max(kLeastTilt_rad, kSigmas * fit.tilt_sigma_rad)) {
    warnings.push_back(fmt::format(
        "the left camera turns otherwise than the IMU, as if it were mounted {:.1f} degrees from "
        "what its calibration says (sigma {:.1f}): the localization will be worse for it",
        kDegreesPerRadian * fit.tilt_rad.norm(), kDegreesPerRadian * fit.tilt_sigma_rad));
  }
  return warnings;
}

}  // namespace pirt::slam
