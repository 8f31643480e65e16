#include "workloads/inputs/sequence/trajectory.h"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "workloads/base/error.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/inputs/sequence/table_file.h"

namespace pirt {
namespace {

struct Pair {
  Pose estimate;
  Pose truth;
};

std::vector<Pair> pairs_of(std::span<const StampedPose> estimate, std::span<const TruthRow> truth) {
  std::vector<Pair> pairs;
  for (const auto& pose : estimate) {
    if (const auto true_pose = truth_at(truth, pose.time)) pairs.push_back({pose.body, *true_pose});
  }
  return pairs;
}

constexpr std::size_t kLeastPairs = 3;

double heading_between(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  const Eigen::Matrix3d turn = to * from.transpose();
  return std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1));
}

Similarity align_start(const Pair& first) {
  Similarity s;
  s.pose.rotation =
      rotation_of({0, 0, heading_between(first.estimate.rotation, first.truth.rotation)});
  s.pose.position = first.truth.position - s.pose.rotation * first.estimate.position;
  return s;
}

Similarity align_pairs(const std::vector<Pair>& pairs, Alignment alignment) {
  if (pairs.empty() || (alignment != Alignment::kStartYaw && pairs.size() < kLeastPairs)) {
    throw_bad_input(fmt::format("only {} poses of the trajectory have truth; it cannot be aligned",
                                pairs.size()));
  }
  if (alignment == Alignment::kStartYaw) return align_start(pairs.front());
  Eigen::Matrix3Xd from(3, std::ssize(pairs));
  Eigen::Matrix3Xd to(3, std::ssize(pairs));
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    from.col(i) = pairs[static_cast<std::size_t>(i)].estimate.position;
    to.col(i) = pairs[static_cast<std::size_t>(i)].truth.position;
  }
  const Eigen::Matrix4d m = Eigen::umeyama(from, to, alignment == Alignment::kSim3);
  const double scale = m.block<3, 1>(0, 0).norm();
  Similarity s;
  if (!(scale > 0)) {  // One of them stands still.
    s.pose.position = to.rowwise().mean() - from.rowwise().mean();
    return s;
  }
  s.scale = scale;
  s.pose.rotation = m.block<3, 3>(0, 0) / s.scale;
  s.pose.position = m.block<3, 1>(0, 3);
  return s;
}

/// RMS distance from the line that is nearest to them.
double spread_beside_a_line(const std::vector<Pair>& pairs) {
  Eigen::Matrix3Xd points(3, std::ssize(pairs));
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    points.col(i) = pairs[static_cast<std::size_t>(i)].truth.position;
  }
  points.colwise() -= points.rowwise().mean().eval();
  const Eigen::Matrix3d spread = points * points.transpose() / static_cast<double>(points.cols());
  const Eigen::Vector3d axes =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread, Eigen::EigenvaluesOnly).eigenvalues();
  constexpr double kRounding = 1e-12;
  return std::sqrt(std::max(axes[0] + axes[1] - kRounding * axes[2], 0.0));  // The last is largest.
}

}  // namespace

Eigen::Vector3d Similarity::operator*(const Eigen::Vector3d& p) const {
  return pose.rotation * (scale * p) + pose.position;
}

Pose moved(const Similarity& similarity, const Pose& pose) {
  return {similarity.pose.rotation * pose.rotation, similarity * pose.position};
}

std::string tum_text(std::span<const StampedPose> trajectory) {
  std::string text = "# timestamp(s) tx ty tz qx qy qz qw\n";
  for (const auto& [time, body] : trajectory) {
    const Eigen::Quaterniond q(body.rotation);
    const auto ns = time.count();
    text += fmt::format("{}{}.{:09} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n",
                        ns < 0 ? "-" : "", std::abs(ns / 1'000'000'000),
                        std::abs(ns % 1'000'000'000), body.position.x(), body.position.y(),
                        body.position.z(), q.x(), q.y(), q.z(), q.w());
  }
  return text;
}

std::vector<TruthRow> read_tum(const std::filesystem::path& file,
                               std::vector<std::string>& warnings) {
  std::vector<TruthRow> truth;
  static constexpr std::string_view kNames[] = {"timestamp", "t x", "t y", "t z",
                                                "q x",       "q y", "q z", "q w"};
  for (const TableRow& row : read_table(file, ' ', 8, kNames)) {
    const Eigen::Vector3d position(row.number(1), row.number(2), row.number(3));
    truth.push_back({row.seconds(0), {row.rotation(7, 4), position}});
  }
  const std::string what = "'" + file.string() + "'";
  keep_rising(truth, what, warnings);
  check_step(what, stamps_of(truth));
  return truth;
}

void take_truth(Sequence& sequence, const std::string& what, const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kBadInput) throw;
    sequence.truth.clear();
    sequence.warnings.push_back(what + " is not taken for truth: " + error.what());
  }
}

std::optional<Pose> truth_at(std::span<const TruthRow> truth, Nanos time) {
  const auto after = std::ranges::lower_bound(truth, time, {}, &TruthRow::time);
  if (after == truth.end()) return std::nullopt;
  if (after->time == time) return after->body;
  if (after == truth.begin()) return std::nullopt;
  const auto& before = *std::prev(after);
  if (after->time - before.time > kLongestTruthGap) return std::nullopt;
  const double part = to_s(time - before.time) / to_s(after->time - before.time);
  const Eigen::Quaterniond q0(before.body.rotation);
  const Eigen::Quaterniond q1(after->body.rotation);
  return Pose{q0.slerp(part, q1).toRotationMatrix(),
              (1 - part) * before.body.position + part * after->body.position};
}

bool can_align(std::span<const StampedPose> estimate, std::span<const TruthRow> truth) {
  return pairs_of(estimate, truth).size() >= kLeastPairs;
}

Similarity align(std::span<const StampedPose> estimate, std::span<const TruthRow> truth,
                 Alignment alignment) {
  return align_pairs(pairs_of(estimate, truth), alignment);
}

TrajectoryError evaluate(std::span<const StampedPose> estimate, std::span<const TruthRow> truth,
                         Alignment alignment) {
  const auto pairs = pairs_of(estimate, truth);
  const Similarity s = align_pairs(pairs, alignment);
  TrajectoryError error;
  error.poses = pairs.size();
  error.scale = s.scale;
  double squares = 0;
  double angles = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double miss = (s * pairs[i].estimate.position - pairs[i].truth.position).norm();
    squares += miss * miss;
    error.ate_max_m = std::max(error.ate_max_m, miss);
    angles += angle_of(pairs[i].truth.rotation.transpose() * s.pose.rotation *
                       pairs[i].estimate.rotation);
    if (i > 0) error.path_m += (pairs[i].truth.position - pairs[i - 1].truth.position).norm();
  }
  const auto count = static_cast<double>(pairs.size());
  error.ate_rms_m = std::sqrt(squares / count);
  if (alignment == Alignment::kStartYaw || error.ate_rms_m < spread_beside_a_line(pairs)) {
    error.rotation_error_mean_deg = angles / count * kDegreesPerRadian;
  }
  return error;
}

std::optional<double> relative_rotation_error_deg(std::span<const StampedPose> estimate,
                                                  std::span<const TruthRow> truth,
                                                  std::size_t step) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i + step < estimate.size(); ++i) {
    const auto from = truth_at(truth, estimate[i].time);
    const auto to = truth_at(truth, estimate[i + step].time);
    if (!from || !to) continue;
    const Eigen::Matrix3d moved =
        estimate[i].body.rotation.transpose() * estimate[i + step].body.rotation;
    sum += angle_of((from->rotation.transpose() * to->rotation).transpose() * moved);
    ++count;
  }
  return count == 0 ? std::nullopt : std::optional(sum / count * kDegreesPerRadian);
}

}  // namespace pirt
