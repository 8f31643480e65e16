// update_pose: tracks and descriptors correct the state.
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/map_search.h"
#include "workloads/slam/filter/map_use.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/filter/steps.h"
#include "workloads/slam/views/places.h"
#include "workloads/slam/views/pnp.h"
#include "workloads/slam/views/two_views.h"

namespace pirt::slam {
namespace {

constexpr double kMostStereoMiss = 3.0;  // pixels
constexpr double kStillPixels = 0.6;     // median motion of a camera at rest, with vibration
constexpr double kStillTurn_rad_s = 0.1;
constexpr double kStillSpeed_m_s = 0.002;  // with vibration
constexpr int kStillFrames = 5;            // between two looks
constexpr std::size_t kLeastViews = 4;
/// Of a followed point from one picture to the next, in pixels. Points agree within 0.03 pixels on
/// generated pictures (0.1 on a street), and turns are off by what follows from 0.05; the rest is
/// for what windows beside each other share and what goes on from picture to picture.
constexpr double kLeastTurnSigma = 0.1;
constexpr int kEnoughToSee = 12;  // tracks; fewer are blind
constexpr int kBlindFrames = 4;   // in a row that are lost
constexpr int kGoodFrames = 5;    // in a row that are found again

std::unordered_map<std::int64_t, std::size_t> landmark_index(const State& state) {
  std::unordered_map<std::int64_t, std::size_t> index;
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) index[state.landmarks[i].id] = i;
  return index;
}

/// Tracks that were found get their new place and an observation by the newest clone; the others
/// are returned.
std::vector<Track> take_tracks(State& state, const Setup& setup, const FrameTracks& tracks) {
  std::vector<Track> kept;
  std::vector<Track> ended;
  for (std::size_t i = 0; i < state.tracks.size(); ++i) {
    Track& track = state.tracks[i];
    if (!tracks.left[i].found) {
      ended.push_back(std::move(track));
      continue;
    }
    track.pixel = tracks.left[i].pixel;
    track.has_right = false;
    ++track.age;
    Observation seen;
    seen.frame = state.frame;
    seen.left = setup.cameras[0].ray(track.pixel.cast<double>());
    if (!tracks.right.empty() && tracks.right[i].found) {
      seen.right = setup.cameras[1].ray(tracks.right[i].pixel.cast<double>());
      const auto depth =
          stereo_depth(setup, seen.left, seen.right, kMostStereoMiss / setup.cameras[1].focal());
      seen.has_right = depth.has_value();
      if (depth) {
        track.depth = *depth;
        track.has_right = true;
        track.right_pixel = tracks.right[i].pixel;
      }
    }
    track.seen.push_back(seen);
    kept.push_back(std::move(track));
  }
  state.tracks = std::move(kept);
  return ended;
}

/// At rest nothing moves in the picture, for several frames; what moves slowly does over them.
bool at_rest(State& state, const Setup& setup) {
  if (std::ssize(state.tracks) < kEnoughToSee) return state.still = false;
  if (setup.imu && (state.last_imu.gyro_rad_s - state.motion.gyro_bias).norm() > kStillTurn_rad_s) {
    state.still_frames = 0;
  }
  std::vector<double> moved;
  for (const auto& track : state.tracks) {
    if (track.age >= state.still_frames) moved.push_back((track.pixel - track.rest).norm());
  }
  const bool same = !moved.empty() && median(moved) < kStillPixels;
  ++state.still_frames;
  if (state.still) {
    state.still = same;
  } else if (same && state.still_frames > kStillFrames) {
    state.still = true;
  }
  if (!state.still && state.still_frames > kStillFrames) {
    state.still_frames = 0;
    for (auto& track : state.tracks) track.rest = track.pixel;
  }
  return state.still;
}

bool passes(const State& state, const RowBlock& block) {
  return innovation(state, block) < kGate * chi_square_95(static_cast<int>(block.residual.size()));
}

/// The body is where it was when it came to rest: a picture that has not moved by more than so many
/// pixels says so of the pose, and the gyroscope of its bias.
/// @return  False if what the state knows of its motion contradicts: it may move slowly.
bool rest_update(State& state, const Setup& setup) {
  const auto since = std::ranges::find_if(state.clones, [&](const Clone& clone) {
    return clone.frame > state.frame - state.still_frames;
  });
  const auto n = state.clones.size();
  const auto then = static_cast<std::size_t>(since - state.clones.begin());
  std::vector<double> depths;
  for (const auto& track : state.tracks) {
    if (track.depth > 0) depths.push_back(track.depth);
  }
  constexpr double kUsualDepth = 4.0;
  const double angle = kStillPixels / setup.cameras[0].focal();
  const double moved = angle * (depths.empty() ? kUsualDepth : median(depths));
  std::vector<RowBlock> rows;
  if (then + 1 < n) {
    // In world axes; a turn moves a place about the origin, and is known of both clones.
    const Pose& old = state.clones[then].body;
    const Pose& now = state.clones[n - 1].body;
    const auto tie = [&](const Eigen::Vector3d& residual, const Eigen::Matrix3d& old_turn,
                         const Eigen::Matrix3d& now_turn, double place, double sigma) {
      RowBlock block;
      block.residual = residual;
      Eigen::Matrix<double, 3, 6> part;
      part << old_turn, -place * Eigen::Matrix3d::Identity();
      block.parts.push_back({State::clone_at(then), part});
      part << now_turn, place * Eigen::Matrix3d::Identity();
      block.parts.push_back({State::clone_at(n - 1), part});
      block.sigma = sigma;
      rows.push_back(std::move(block));
    };
    const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
    tie(old.position - now.position, cross_matrix(old.position), -cross_matrix(now.position), 1,
        moved);
    tie(vector_of(old.rotation * now.rotation.transpose()), -unit, unit, 0, angle);
  }
  if (setup.imu) {
    RowBlock turn;
    turn.residual = state.last_imu.gyro_rad_s - state.motion.gyro_bias;
    turn.parts.push_back({kGyroBiasAt, Eigen::Matrix3d::Identity()});
    // Twice the sensor's, for vibration.
    turn.sigma = 2 * setup.imu->gyro_noise * std::sqrt(setup.imu->rate_hz);
    rows.push_back(std::move(turn));
    // Before pictures show that it moves, the IMU knows.
    RowBlock speed;
    speed.residual = -state.motion.velocity;
    speed.parts.push_back({0, -cross_matrix(state.motion.velocity)});
    speed.parts.push_back({kVelocityAt, Eigen::Matrix3d::Identity()});
    speed.sigma = kStillSpeed_m_s;
    if (!passes(state, speed)) return false;
  }
  for (const auto& block : rows) {
    if (!passes(state, block)) return false;
  }
  return kalman_update(state, rows);
}

/// What the last picture and this one show of the tracks that were found.
std::vector<RayPair> ray_pairs(const State& state, const Setup& setup, const FrameTracks& tracks) {
  std::vector<RayPair> pairs;
  for (std::size_t i = 0; i < state.tracks.size(); ++i) {
    if (!tracks.left[i].found) continue;
    pairs.push_back({setup.cameras[0].ray(state.tracks[i].pixel.cast<double>()),
                     setup.cameras[0].ray(tracks.left[i].pixel.cast<double>())});
  }
  return pairs;
}

/// Without a gyroscope: how the camera turned since the last picture. Between two pictures a window
/// moves over the scene by a tenth of a pixel and not by the pixels that it may be off in the end,
/// so that the turn is known far better than from tracks as a whole.
void turn_update(State& state, const Setup& setup, std::span<const RayPair> pairs,
                 FrameReport& report) {
  const auto n = state.clones.size();
  if (n < 2 || state.clones[n - 2].frame + 1 != state.clones[n - 1].frame) return;
  constexpr double kMostPixels = 1.0;
  const Eigen::Matrix3d& mount = setup.cameras[0].body_from_camera.rotation;
  const Eigen::Matrix3d& before = state.clones[n - 2].body.rotation;
  const Eigen::Matrix3d expected = before.transpose() * state.clones[n - 1].body.rotation;
  const auto turn = turn_of(pairs, kMostPixels / setup.cameras[0].focal(),
                            mount.transpose() * expected.transpose() * mount);
  if (!turn) return;
  const Eigen::Matrix3d measured = mount * turn->rotation.transpose() * mount.transpose();
  // In the axes of the body then: measured = rotation_of(residual) * expected.
  const Eigen::Matrix3d axes = measured * mount;
  const double least = kLeastTurnSigma / setup.cameras[0].focal();
  const double inflation = std::max(1.0, least / turn->ray_sigma);
  const Eigen::Matrix3d covariance =
      inflation * inflation * axes * turn->covariance * axes.transpose();
  const Eigen::LLT<Eigen::Matrix3d> cholesky(covariance);
  if (cholesky.info() != Eigen::Success) return;
  RowBlock block;
  block.residual = cholesky.matrixL().solve(vector_of(measured * expected.transpose()));
  const Eigen::Matrix3d whitened = cholesky.matrixL().solve(before.transpose());
  block.parts.push_back({State::clone_at(n - 2), -whitened});
  block.parts.push_back({State::clone_at(n - 1), whitened});
  if (!passes(state, block)) {
    ++report.rejected;
    return;
  }
  if (!kalman_update(state, {block})) ++report.rejected;
}

/// Rows of the landmarks that are followed. What does not fit is no longer followed.
void landmark_update(State& state, const Setup& setup, FrameReport& report) {
  const auto index = landmark_index(state);
  std::vector<RowBlock> rows;
  for (auto& track : state.tracks) {
    if (track.landmark < 0 || track.seen.empty()) continue;
    const std::size_t landmark = index.at(track.landmark);
    RowBlock block =
        rows_of_landmark(state, setup, landmark, track.seen.back(), setup.landmark_sigma);
    track.seen.clear();
    if (!passes(state, block)) {
      ++report.rejected;
      ++state.landmarks[landmark].misses;
      track.age = -1;
      continue;
    }
    Landmark& point = state.landmarks[landmark];
    point.last_frame = state.frame;
    ++point.uses;
    point.misses = 0;
    rows.push_back(in_three_rows(block));
  }
  std::erase_if(state.tracks, [](const Track& track) { return track.age < 0; });
  const auto count = static_cast<int>(rows.size());
  (kalman_update(state, rows) ? report.landmarks : report.rejected) += count;
}

/// Tracks whose landmark does not lie where one pose of the camera would see it with the others.
void drop_outliers(State& state, const Setup& setup, FrameReport& report) {
  const auto index = landmark_index(state);
  std::vector<std::size_t> which;
  std::vector<PointMatch> matches;
  for (std::size_t i = 0; i < state.tracks.size(); ++i) {
    const Track& track = state.tracks[i];
    if (track.landmark < 0) continue;
    which.push_back(i);
    matches.push_back({state.landmarks[index.at(track.landmark)].position, track.seen.back().left});
  }
  constexpr double kMostPixels = 4.0;
  const auto found = robust_pnp(matches, kMostPixels / setup.cameras[0].focal());
  if (!found || 2 * found->inliers.size() < matches.size()) return;
  std::vector<bool> good(matches.size(), false);
  for (const std::size_t i : found->inliers) good[i] = true;
  for (std::size_t i = 0; i < which.size(); ++i) {
    if (good[i]) continue;
    state.tracks[which[i]].age = -1;
    ++report.rejected;
  }
  std::erase_if(state.tracks, [](const Track& track) { return track.age < 0; });
}

/// Landmarks that are not followed, where they should be seen: those that look like themselves are
/// followed again, and correct the drift since they were lost.
void recognize(State& state, const Setup& setup, const Features& features, FrameReport& report) {
  std::vector<std::int64_t> followed;
  for (const auto& track : state.tracks) {
    if (track.landmark >= 0) followed.push_back(track.landmark);
  }
  const Pose camera = camera_pose(setup, state.clones.back().body, 0);
  constexpr double kNear = 4.0;
  constexpr double kFar = 40.0;  // pixels
  std::vector<RowBlock> rows;
  std::vector<Track> added;
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    Landmark& landmark = state.landmarks[i];
    if (std::ranges::find(followed, landmark.id) != followed.end()) continue;
    const auto pixel = pixel_of(setup.cameras[0], camera, landmark.position);
    if (!pixel || !setup.cameras[0].contains(*pixel, 24.0)) continue;
    if (!looks_alike(landmark.position, landmark.seen_from, camera.position)) continue;
    Observation none;
    none.left = setup.cameras[0].ray(*pixel);
    RowBlock block = rows_of_landmark(state, setup, i, none, setup.pixel_sigma());
    // Where it may be: three sigma of the prediction, from the innovation's covariance.
    const double spread = predicted_sigma(state, block);
    const double radius = std::clamp(3 * spread, kNear, kFar);
    const Candidate best = best_feature(features, *pixel, radius, landmark.descriptor);
    if (!best.clear()) {
      if (spread < kNear) ++landmark.misses;
      continue;
    }
    const auto feature = static_cast<std::size_t>(best.feature);
    Observation seen;
    seen.frame = state.frame;
    seen.left = setup.cameras[0].ray(features.pixels[feature].cast<double>());
    block = rows_of_landmark(state, setup, i, seen, setup.landmark_sigma);
    if (!passes(state, block)) {
      ++landmark.misses;
      continue;
    }
    landmark.misses = 0;
    landmark.last_frame = state.frame;
    ++landmark.uses;
    rows.push_back(std::move(block));
    Track track;
    track.id = state.next_id++;
    track.pixel = track.rest = features.pixels[feature];
    track.landmark = landmark.id;
    track.depth = (camera.inverse() * landmark.position).z();
    track.descriptor = landmark.descriptor;
    added.push_back(std::move(track));
  }
  if (!kalman_update(state, rows)) {
    report.rejected += static_cast<int>(rows.size());
    return;
  }
  report.recognized = static_cast<int>(rows.size());
  report.landmarks += report.recognized;
  for (auto& track : added) {
    std::erase_if(state.tracks, [&](const Track& other) {
      return other.landmark < 0 && (other.pixel - track.pixel).squaredNorm() < 16.0F;
    });
    state.tracks.push_back(std::move(track));
  }
}

/// With an IMU the state went on, and seeing again is enough; without, the place has to be known
/// again.
void find_again(State& state, const Setup& setup, const Features& features) {
  if (setup.imu) {
    if (state.good_frames >= kGoodFrames) state.status = Status::kTracking;
    return;
  }
  if (std::ssize(features.pixels) >= kEnoughToSee) relocalize(state, setup, features);
}

}  // namespace

double predicted_sigma(const State& state, const RowBlock& block) {
  return std::sqrt(predicted_covariance(state, block).diagonal().head<2>().maxCoeff());
}

void use_points(State& state, const Setup& setup, std::vector<Track>& ended, std::size_t most,
                FrameReport& report) {
  std::erase_if(ended, [](const Track& track) {
    return track.landmark >= 0 || track.seen.size() < kLeastViews;
  });
  std::ranges::stable_sort(
      ended, [](const Track& a, const Track& b) { return a.seen.size() > b.seen.size(); });
  if (ended.size() > most) ended.resize(most);
  std::vector<RowBlock> rows;
  const double ray_sigma = setup.ray_sigma_rad;
  for (auto& track : ended) {
    const auto views = views_of(state, setup, track);
    const auto point = triangulate(views, ray_sigma);
    if (!point || point->rms > 4 * ray_sigma) {
      ++report.rejected;
      track.depth = -1;
      continue;
    }
    const PointRows all = rows_of_track(state, setup, track, point->point);
    RowBlock block = without_point(all.rows, all.to_point);
    if (!passes(state, block)) {
      ++report.rejected;
      track.depth = -1;
      continue;
    }
    rows.push_back(std::move(block));
  }
  if (rows.empty()) return;
  const bool used = kalman_update(state, {compressed_window(state, rows)});
  (used ? report.points : report.rejected) += static_cast<int>(rows.size());
}

TrackRequest request_tracks(const State& state, const Setup& setup) {
  const auto index = landmark_index(state);
  const Pose now = camera_pose(setup, state.body(), 0);
  const Pose before = state.clones.empty() ? now : camera_pose(setup, state.clones.back().body, 0);
  TrackRequest request;
  for (const auto& track : state.tracks) {
    request.pixels.push_back(track.pixel);
    Eigen::Vector3d point;
    if (track.landmark >= 0) {
      point = state.landmarks[index.at(track.landmark)].position;
    } else {
      constexpr double kUnknownDepth = 1e4;
      const Eigen::Vector2d ray = setup.cameras[0].ray(track.pixel.cast<double>());
      const Eigen::Vector3d along = ray.homogeneous();
      point = before * Eigen::Vector3d((track.depth > 0 ? track.depth : kUnknownDepth) * along);
    }
    const auto pixel = pixel_of(setup.cameras[0], now, point);
    const bool near = pixel && (pixel->cast<float>() - track.pixel).norm() < 120.0F;
    request.guesses.push_back(near ? pixel->cast<float>() : track.pixel);
  }
  return request;
}

std::vector<double> depths_of(const State& state) {
  std::vector<double> depths;
  for (const Track& track : state.tracks) depths.push_back(track.depth);
  return depths;
}

TrackRequest request_right(const Setup& setup, std::span<const double> depths,
                           std::span<const TrackedPoint> left) {
  const Pose right_from_left =
      setup.cameras[1].body_from_camera.inverse() * setup.cameras[0].body_from_camera;
  TrackRequest request;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    request.pixels.push_back(left[i].pixel);
    constexpr double kUsualDepth = 4.0;
    const double depth = depths[i] > 0 ? depths[i] : kUsualDepth;
    const Eigen::Vector2d ray = setup.cameras[0].ray(left[i].pixel.cast<double>());
    const Eigen::Vector3d along = ray.homogeneous();
    const Eigen::Vector3d p = right_from_left * Eigen::Vector3d(depth * along);
    const auto pixel = pixel_of(setup.cameras[1], {}, p);
    request.guesses.push_back(pixel ? pixel->cast<float>() : left[i].pixel);
  }
  return request;
}

FrameReport update_pose(State& state, const Setup& setup, const FrameTracks& tracks,
                        const Features& features) {
  FrameReport report;
  const auto pairs = setup.imu ? std::vector<RayPair>{} : ray_pairs(state, setup, tracks);
  add_clone(state, state.frame + 1);
  auto ended = take_tracks(state, setup, tracks);
  report.tracks = static_cast<int>(state.tracks.size());
  std::size_t paired = 0;
  for (const double farthest = farthest_stereo(setup); const Track& track : state.tracks) {
    paired += track.has_right ? 1U : 0U;
    report.stereo += track.has_right && track.depth < farthest ? 1 : 0;
  }
  if (!sees_stereo(paired, state.tracks.size())) report.stereo = 0;
  if (state.status == Status::kStarting) {
    start_from_tracks(state, setup);
    return report;
  }
  const bool sees = report.tracks >= kEnoughToSee;
  if (setup.update && state.status == Status::kTracking) {
    // The same view again says nothing new: its errors are those of the last frame.
    state.still = at_rest(state, setup) && rest_update(state, setup);
    if (!state.still) {
      if (!setup.imu) turn_update(state, setup, pairs, report);
      drop_outliers(state, setup, report);
      landmark_update(state, setup, report);
      use_points(state, setup, ended, kMostPoints, report);
      if (setup.recognize) {
        recognize(state, setup, features, report);
        use_map(state, setup, features, report);
      }
    }
  }
  state.blind_frames = sees ? 0 : state.blind_frames + 1;
  state.good_frames = sees ? state.good_frames + 1 : 0;
  if (state.blind_frames >= kBlindFrames) state.status = Status::kLost;
  if (!setup.update) return report;
  if (state.status == Status::kLost) find_again(state, setup, features);
  seek_map(state, setup, features);
  return report;
}

}  // namespace pirt::slam
