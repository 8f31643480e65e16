#include "workloads/slam/run/summary.h"

#include <algorithm>
#include <cmath>

namespace pirt::slam {
namespace {

/// Poses that go on from the first two true ones.
std::vector<StampedPose> constant_velocity(const std::vector<StampedPose>& estimate,
                                           const std::vector<TruthRow>& truth) {
  std::vector<StampedPose> poses;
  if (estimate.size() < 2) return poses;
  const auto first = truth_at(truth, estimate[0].time);
  const auto second = truth_at(truth, estimate[1].time);
  if (!first || !second) return poses;
  const Eigen::Vector3d velocity =
      (second->position - first->position) / to_s(estimate[1].time - estimate[0].time);
  for (const auto& pose : estimate) {
    Pose body = *first;
    body.position += to_s(pose.time - estimate[0].time) * velocity;
    poses.push_back({pose.time, body});
  }
  return poses;
}

double rms_without_alignment(const std::vector<StampedPose>& poses,
                             const std::vector<TruthRow>& truth) {
  double squares = 0;
  double count = 0;
  for (const auto& pose : poses) {
    const auto t = truth_at(truth, pose.time);
    if (!t) continue;
    squares += (t->position - pose.body.position).squaredNorm();
    ++count;
  }
  return count > 0 ? std::sqrt(squares / count) : 0.0;
}

void add_errors(const Sequence& sequence, const std::vector<StampedPose>& poses,
                RunSummary& summary) {
  if (!can_align(poses, sequence.truth)) return;
  summary.error =
      evaluate(poses, sequence.truth, summary.scale_known ? Alignment::kSe3 : Alignment::kSim3);
  auto still = poses;
  for (auto& pose : still) pose.body.rotation.setIdentity();
  for (const std::size_t frames : {1U, 10U}) {
    const auto error = relative_rotation_error_deg(poses, sequence.truth, frames);
    if (!error) continue;
    summary.turns.push_back(
        {frames, *error, *relative_rotation_error_deg(still, sequence.truth, frames)});
  }
  const auto coasting = constant_velocity(poses, sequence.truth);
  if (!coasting.empty()) {
    summary.constant_velocity_ate_rms_m = rms_without_alignment(coasting, sequence.truth);
  }
}

KnownMapSummary known_map_of(const RunResult& result, const Setup& setup) {
  KnownMapSummary known{.points = setup.known->size(), .found_after_s = {}};
  const auto found = std::ranges::find(result.frames, true, &FrameResult::in_map);
  if (found != result.frames.end()) {
    known.found_after_s = to_s(found->pose.time - result.frames.front().pose.time);
  }
  return known;
}

}  // namespace

StageSummary summary_of(std::string name, std::vector<double> ms) {
  StageSummary stage;
  stage.name = std::move(name);
  if (ms.empty()) return stage;
  std::ranges::sort(ms);
  const auto quantile = [&](double q) {
    return ms[static_cast<std::size_t>(q * static_cast<double>(ms.size() - 1))];
  };
  for (const double value : ms) stage.mean_ms += value / static_cast<double>(ms.size());
  stage.p50_ms = quantile(0.5);
  stage.p95_ms = quantile(0.95);
  stage.p99_ms = quantile(0.99);
  return stage;
}

RunSummary summarize(const Sequence& sequence, const RunResult& result, const Setup& setup) {
  RunSummary summary;
  summary.frames = result.frames.size();
  // Two cameras whose pictures are taken for each other's see no depth.
  summary.scale_known =
      setup.imu || std::ranges::any_of(result.frames, [](const FrameResult& frame) {
        return frame.report.stereo >= static_cast<int>(kLeastStereo);
      });
  std::vector<std::vector<double>> ms(kStages.size());
  std::vector<double> whole;
  for (const auto& frame : result.frames) {
    summary.starting += frame.status == Status::kStarting ? 1U : 0U;
    summary.tracking += frame.status == Status::kTracking ? 1U : 0U;
    summary.lost += frame.status == Status::kLost ? 1U : 0U;
    summary.unusable += frame.unusable ? 1U : 0U;
    summary.map_change.replaced += frame.map_change.replaced;
    summary.map_change.added += frame.map_change.added;
    summary.map_change.refused += frame.map_change.refused;
    double sum = 0;
    for (std::size_t i = 0; i < kStages.size(); ++i) {
      ms[i].push_back(to_ms(frame.stage_time[i]));
      sum += ms[i].back();
    }
    whole.push_back(sum);
  }
  for (std::size_t i = 0; i < kStages.size(); ++i) {
    summary.stages.push_back(summary_of(std::string(to_string(kStages[i])), ms[i]));
  }
  summary.stages.push_back(summary_of("frame", whole));
  const double mean_ms = summary.stages.back().mean_ms;
  summary.rate_hz = mean_ms > 0 ? 1e3 / mean_ms : 0.0;
  summary.landmarks = result.last.landmarks.size();
  summary.map_points = result.last.map.size();
  if (setup.known != nullptr) summary.known_map = known_map_of(result, setup);
  add_errors(sequence, result.trajectory(), summary);
  return summary;
}

}  // namespace pirt::slam
