// extend_map: points from tracks, tracks from corners, and bounds on all of them.
#include <algorithm>
#include <cmath>
#include <optional>

#include "workloads/base/math/pixel_index.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/filter/milestones.h"
#include "workloads/slam/filter/steps.h"

namespace pirt::slam {
namespace {

constexpr double kLandmarkSigma = 0.10;  // of a landmark's depth when it enters, relative
constexpr std::size_t kLandmarkViews = 5;
constexpr double kLeastBase = 0.015;     // of a clone to the one before, in median depths
constexpr float kTrackDistance = 14.0F;  // pixels between tracks

std::size_t active_landmarks(const State& state) {
  return static_cast<std::size_t>(
      std::ranges::count_if(state.tracks, [](const Track& track) { return track.landmark >= 0; }));
}

void remove_bad_landmarks(State& state) {
  std::vector<std::size_t> bad;
  for (std::size_t i = 0; i < state.landmarks.size(); ++i) {
    const Landmark& landmark = state.landmarks[i];
    if (landmark.misses >= kMostMisses && !is_followed(state, landmark.id)) bad.push_back(i);
  }
  remove_landmarks(state, bad);
}

/// A track with a good base line can be a landmark; what it says of the clones besides is of use,
/// too.
struct Promotion {
  Track* track;
  NewLandmark made;
  RowBlock rest;
};

std::optional<Promotion> promotion_of(const State& state, const Setup& setup, Track& track) {
  const double ray_sigma = setup.ray_sigma_rad;
  const auto point = triangulate(views_of(state, setup, track), ray_sigma);
  if (!point || point->rms > 3 * ray_sigma || point->relative_sigma > kLandmarkSigma) return {};
  PointRows all = rows_of_track(state, setup, track, point->point);
  RowBlock rest = without_point(all.rows, all.to_point);
  if (innovation(state, rest) > 1.5 * chi_square_95(static_cast<int>(rest.residual.size()))) {
    track.seen.clear();
    track.age = -1;
    return {};
  }
  Landmark landmark;
  landmark.position = point->point;
  landmark.descriptor = track.descriptor;
  landmark.seen_from = camera_pose(setup, state.clones.back().body, 0).position;
  landmark.last_frame = state.frame;
  // The point's error, in world axes, is turn x point + landmark's error, of the newest clone.
  all.rows.parts.push_back(
      {State::clone_at(state.clones.size() - 1), all.to_point * -cross_matrix(point->point)});
  return Promotion{
      &track, {landmark, std::move(all.rows), std::move(all.to_point)}, std::move(rest)};
}

/// Tracks that a clone which goes has seen are landmarks now or never. Those that could not be
/// are used as whole tracks, longest first.
void promote_tracks(State& state, const Setup& setup) {
  std::vector<Track*> ready;
  for (auto& track : state.tracks) {
    if (track.landmark < 0 && track.seen.size() >= kLandmarkViews) ready.push_back(&track);
  }
  std::ranges::stable_sort(ready, [](const Track* a, const Track* b) { return a->age > b->age; });
  const auto active = active_landmarks(state);
  const auto most = static_cast<std::size_t>(setup.most_active);
  std::vector<Promotion> promoted;
  for (Track* track : ready) {
    if (active + promoted.size() >= most) break;
    if (auto promotion = promotion_of(state, setup, *track)) {
      promoted.push_back(std::move(*promotion));
    }
  }
  // Rows are of clones: landmarks that go do not change them.
  const std::size_t room = make_room(state, setup, promoted.size());
  promoted.erase(promoted.begin() + static_cast<std::ptrdiff_t>(room), promoted.end());
  std::vector<NewLandmark> added;
  std::vector<RowBlock> rows;
  for (auto& [track, made, rest] : promoted) {
    made.landmark.id = track->landmark = state.next_id++;
    track->seen.clear();
    added.push_back(std::move(made));
    rows.push_back(std::move(rest));
  }
  add_landmarks(state, added);
  if (!rows.empty()) {
    kalman_update(state, {compressed_window(state, rows)});
  }
  std::erase_if(state.tracks, [](const Track& track) { return track.age < 0; });
}

/// Long tracks that are no landmarks: used, and followed on from here.
void use_long_tracks(State& state, const Setup& setup) {
  const auto whole = static_cast<std::size_t>(setup.most_clones);
  std::vector<Track> used;
  for (auto& track : state.tracks) {
    if (track.landmark < 0 && track.seen.size() >= whole) used.push_back(track);
  }
  if (used.empty()) return;
  FrameReport ignored;
  use_points(state, setup, used, kMostPoints, ignored);
  for (auto& track : state.tracks) {
    const auto it = std::ranges::find(used, track.id, &Track::id);
    if (it == used.end()) continue;
    track.seen.clear();
    if (it->depth < 0) track.age = -1;
  }
  std::erase_if(state.tracks, [](const Track& track) { return track.age < 0; });
}

double median_depth(const State& state) {
  std::vector<double> depths;
  for (const auto& track : state.tracks) {
    if (track.depth > 0) depths.push_back(track.depth);
  }
  if (depths.empty()) return 4.0;
  std::ranges::nth_element(depths, depths.begin() + std::ssize(depths) / 2);
  return depths[depths.size() / 2];
}

/// Keeps the clones' number: a clone that hardly differs from the one before goes first, so that a
/// robot at rest keeps its base line.
void forget_clones(State& state, const Setup& setup) {
  while (std::ssize(state.clones) - state.milestones > setup.most_clones) {
    const auto n = state.clones.size();
    if (state.status == Status::kStarting) {
      remove_clone(state, 1);  // the first one is what motion is measured from
      continue;
    }
    const Pose& newer = state.clones[n - 2].body;
    const Pose& older = state.clones[n - 3].body;
    const double base = (newer.position - older.position).norm();
    const double depth = median_depth(state);
    if (base < kLeastBase * depth) {
      remove_clone(state, n - 2);
    } else {
      leave_window(state, setup, depth);
    }
  }
}

/// Depths of tracks without a second camera, for the next prediction.
void guess_depths(State& state, const Setup& setup) {
  const Pose camera = camera_pose(setup, state.clones.back().body, 0);
  for (auto& track : state.tracks) {
    if (track.landmark >= 0) {
      const auto it = std::ranges::find(state.landmarks, track.landmark, &Landmark::id);
      track.depth = (camera.inverse() * it->position).z();
    } else if (!track.has_right && track.seen.size() >= kLandmarkViews &&
               track.seen.size() % 3 == 0) {
      const double ray_sigma = setup.ray_sigma_rad;
      const auto point = triangulate(views_of(state, setup, track), ray_sigma);
      if (point && point->relative_sigma < 0.3) {
        track.depth = (camera.inverse() * point->point).z();
      }
    }
  }
}

void add_tracks(State& state, const Setup& setup, const Features& features) {
  // The picture in cells, so that near tracks are found without looking at all of them.
  constexpr float kCell = kTrackDistance;
  const int columns = static_cast<int>(static_cast<float>(setup.cameras[0].width) / kCell) + 3;
  const int rows = static_cast<int>(static_cast<float>(setup.cameras[0].height) / kCell) + 3;
  std::vector<bool> taken(static_cast<std::size_t>(columns * rows), false);
  const auto cell = [&](const Eigen::Vector2f& p, int dx, int dy) {
    const int x = std::clamp(static_cast<int>(p.x() / kCell) + 1 + dx, 0, columns - 1);
    const int y = std::clamp(static_cast<int>(p.y() / kCell) + 1 + dy, 0, rows - 1);
    return pixel_index(x, y, columns);
  };
  const auto mark = [&](const Eigen::Vector2f& p) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) taken[cell(p, dx, dy)] = true;
    }
  };
  for (const auto& track : state.tracks) mark(track.pixel);
  for (std::size_t i = 0; i < features.pixels.size(); ++i) {
    if (std::ssize(state.tracks) >= setup.most_tracks) break;
    if (taken[cell(features.pixels[i], 0, 0)]) continue;
    mark(features.pixels[i]);
    Track track;
    track.id = state.next_id++;
    track.pixel = track.rest = features.pixels[i];
    track.descriptor = features.descriptors[i];
    Observation seen;
    seen.frame = state.frame;
    seen.left = setup.cameras[0].ray(track.pixel.cast<double>());
    track.seen.push_back(seen);
    state.tracks.push_back(std::move(track));
  }
}

}  // namespace

MapChange extend_map(State& state, const Setup& setup, const Features& features,
                     const BetterMap& better) {
  if (state.clones.empty()) return {};  // No frame has been seen.
  if (setup.update && !state.still && state.status == Status::kTracking) {
    remove_bad_landmarks(state);
    promote_tracks(state, setup);
    use_long_tracks(state, setup);
  }
  guess_depths(state, setup);
  forget_clones(state, setup);
  add_tracks(state, setup, features);
  return correct_map(state, setup, better);
}

}  // namespace pirt::slam
