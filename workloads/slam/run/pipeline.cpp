#include "workloads/slam/run/pipeline.h"

#include <algorithm>

namespace pirt::slam {
namespace {

class StageTimer {
 public:
  StageTimer(const Clock* clock, Nanos& total) : clock_(clock), total_(total) {
    if (clock_ != nullptr) begin_ = clock_->now();
  }
  ~StageTimer() {
    if (clock_ != nullptr) total_ += clock_->now() - begin_;
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  const Clock* clock_;
  Nanos& total_;
  Nanos begin_{};
};

class SerialRun {
 public:
  SerialRun(const Sequence& sequence, const RunOptions& options)
      : sequence_(sequence), options_(options), setup_(options.setup) {}

  RunResult run() {
    RunResult result;
    for (std::size_t i = 0; i < sequence_.frames.size(); ++i) {
      GreyImage left = picture(i, 0);
      GreyImage right;
      if (setup_.cameras.size() > 1 && sequence_.frames[i].present[1]) right = picture(i, 1);
      if (left.empty()) {
        ++result.left_out;
        continue;
      }
      const Next next = options_.next ? options_.next(i) : Next::kTake;
      if (next == Next::kStop) break;
      if (next == Next::kDrop) continue;
      result.frames.push_back(frame(i, std::move(left), std::move(right)));
      if (options_.seen) options_.seen(i, state_, before_.levels[0], result.frames.back());
    }
    result.last = std::move(state_);
    return result;
  }

 private:
  GreyImage picture(std::size_t frame, std::size_t camera) const {
    GreyImage image = sequence_.image(frame, camera);
    if (options_.spoil && !image.empty()) options_.spoil(frame, camera, image);
    return image;
  }

  FrameResult frame(std::size_t index, GreyImage left, GreyImage right) {
    const Nanos time = sequence_.frames[index].time;
    FrameResult result;
    result.unusable = is_blank(left);
    const auto timer = [&](Stage stage) {
      return StageTimer(options_.clock, result.stage_time[static_cast<std::size_t>(stage)]);
    };
    {
      const auto t = timer(Stage::kPropagate);
      begin_frame(state_, setup_, samples_between(sequence_, state_.time, time), time);
    }
    Pyramid pyramid;
    {
      const auto t = timer(Stage::kPyramid);
      pyramid = make_pyramid(std::move(left));
    }
    if (sees(state_, setup_)) {
      see(pyramid, std::move(right), result);
    }
    before_ = std::move(pyramid);
    result.pose = {time, state_.body()};
    result.status = state_.status;
    result.in_map = state_.in_map;
    result.position_covariance = position_covariance(state_);
    return result;
  }

  void see(const Pyramid& pyramid, GreyImage right, FrameResult& result) {
    const auto timer = [&](Stage stage) {
      return StageTimer(options_.clock, result.stage_time[static_cast<std::size_t>(stage)]);
    };
    Features features;
    if (!result.unusable) {
      const auto t = timer(Stage::kExtract);
      features = extract_features(pyramid.levels[0], {});
    }
    FrameTracks tracks;
    {
      const auto t = timer(Stage::kTrack);
      const TrackRequest request = request_tracks(state_, setup_);
      tracks.left.resize(request.pixels.size());
      if (!result.unusable && !before_.empty()) {
        tracks.left = track_features(before_, pyramid, request.pixels, request.guesses, {});
      }
    }
    if (!right.empty() && !result.unusable) {
      const auto t = timer(Stage::kTrackRight);
      const Pyramid other = make_pyramid(std::move(right));
      const TrackRequest request = request_right(setup_, depths_of(state_), tracks.left);
      tracks.right = track_features(pyramid, other, request.pixels, request.guesses, {});
    }
    {
      const auto t = timer(Stage::kUpdate);
      result.report = update_pose(state_, setup_, tracks, features);
    }
    const auto t = timer(Stage::kExtend);
    result.map_change = extend_map(state_, setup_, features,
                                   options_.better_map ? options_.better_map() : BetterMap{});
  }

  const Sequence& sequence_;
  const RunOptions& options_;
  const Setup& setup_;
  State state_;
  Pyramid before_;
};

}  // namespace

bool is_blank(const GreyImage& image) {
  constexpr int kStep = 7;
  constexpr double kLeastVariance = 16.0;
  double sum = 0;
  double squares = 0;
  double count = 0;
  for (std::size_t i = 0; i < image.pixels.size(); i += kStep) {
    const double value = image.pixels[i];
    sum += value;
    squares += value * value;
    ++count;
  }
  const double mean = sum / count;
  return squares / count - mean * mean < kLeastVariance;
}

std::span<const ImuSample> samples_between(const Sequence& sequence, Nanos from, Nanos until) {
  // Twice what start() waits for: how a robot was carried about before says nothing of it.
  constexpr Nanos kBeforeFirst = std::chrono::milliseconds(500);
  if (from == Nanos::zero()) from = until - kBeforeFirst;
  const auto& imu = sequence.imu;
  const auto after = [&](Nanos time) {
    return std::ranges::upper_bound(imu, time, {}, &ImuSample::time) - imu.begin();
  };
  const auto first = std::max<std::ptrdiff_t>(after(from) - 1, 0);
  auto last = std::ranges::lower_bound(imu, until, {}, &ImuSample::time) - imu.begin();
  last = std::min(std::max(last, first) + 1, std::ssize(imu));
  return std::span(imu).subspan(static_cast<std::size_t>(first),
                                static_cast<std::size_t>(last - first));
}

std::string_view to_string(Stage stage) {
  constexpr std::array<std::string_view, kStages.size()> kNames = {
      "imu_propagate", "pyramid",     "extract_features", "track_features",
      "track_right",   "update_pose", "extend_map"};
  return kNames[static_cast<std::size_t>(stage)];
}

std::vector<StampedPose> RunResult::trajectory() const {
  std::vector<StampedPose> poses;
  for (const auto& frame : frames) {
    if (frame.status == Status::kStarting) continue;
    StampedPose pose = frame.pose;
    if (last.in_map && !frame.in_map) pose.body = moved(last.map_from_start, pose.body);
    poses.push_back(pose);
  }
  return poses;
}

Setup setup_of(const Sequence& sequence) {
  Setup setup;
  setup.cameras = sequence.cameras;
  if (!sequence.imu.empty()) setup.imu = sequence.imu_model;
  return setup;
}

RunResult run_serially(const Sequence& sequence, const RunOptions& options) {
  return SerialRun(sequence, options).run();
}

}  // namespace pirt::slam
