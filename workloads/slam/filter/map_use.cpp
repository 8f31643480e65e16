#include "workloads/slam/filter/map_use.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/filter/milestones.h"
#include "workloads/slam/views/places.h"

namespace pirt::slam {
namespace {

/// A point of a map that was seen where it should be.
struct Sighting {
  MapPoint point;
  bool known;  ///< Of the setup's map.
  std::size_t index;
  std::size_t feature;
  int bits;
};

/// What a point that is not in the filter says in a picture, in pixels.
struct OutsideRows {
  RowBlock rows;
  Eigen::Matrix2d by_pose;   ///< Of what may be expected, by what robot and milestone are off.
  Eigen::Matrix2d by_point;  ///< The same, by what the point is off.

  [[nodiscard]] double spread() const {
    return std::sqrt((by_pose + by_point).diagonal().maxCoeff());
  }
  [[nodiscard]] bool passes() const {
    const Eigen::Matrix2d expected =
        by_pose + by_point + rows.sigma * rows.sigma * Eigen::Matrix2d::Identity();
    return rows.residual.dot(expected.inverse() * rows.residual) < chi_square_95(2);
  }
};

OutsideRows rows_outside(const State& state, const Setup& setup, const MapPoint& point,
                         const Eigen::Vector2d& ray) {
  const RayRows seen =
      rows_of_ray(camera_pose(setup, state.clones.back().body, 0), point.position, ray);
  const double focal = setup.cameras[0].focal();
  const Eigen::Matrix<double, 2, 3> slope = focal * seen.slope;
  Eigen::Matrix<double, 2, 6> pose;
  pose << slope * cross_matrix(point.position), -slope;
  OutsideRows all;
  all.rows.residual = focal * seen.miss;
  all.rows.sigma = setup.landmark_sigma;
  all.rows.parts.push_back({State::clone_at(state.clones.size() - 1), pose});
  if (point.milestone >= 0) {
    JacobianPart milestone = moves_with(state, point);
    milestone.values = slope * milestone.values;
    all.rows.parts.push_back(std::move(milestone));
  }
  all.by_pose = predicted_covariance(state, all.rows);
  all.by_point = slope * point.covariance * slope.transpose();
  return all;
}

class MapUse {
 public:
  MapUse(const State& state, const Setup& setup, const Features& features)
      : state_(state),
        setup_(setup),
        features_(features),
        camera_(camera_pose(setup, state.clones.back().body, 0)) {}

  /// Those that look most alike; the run's own points first.
  [[nodiscard]] std::vector<Sighting> sightings(std::size_t most) const {
    std::vector<Sighting> seen;
    if (state_.in_map && setup_.known != nullptr) {
      for (std::size_t i = 0; i < setup_.known->size(); ++i)
        look((*setup_.known)[i], true, i, seen);
    }
    for (std::size_t i = 0; i < state_.map.size(); ++i) look(state_.map[i], false, i, seen);
    std::ranges::stable_sort(seen, {}, &Sighting::bits);
    if (seen.size() > most)
      seen.erase(seen.begin() + static_cast<std::ptrdiff_t>(most), seen.end());
    std::stable_partition(seen.begin(), seen.end(),
                          [](const Sighting& each) { return !each.known; });
    return seen;
  }

 private:
  void look(const MapPoint& point, bool known, std::size_t index,
            std::vector<Sighting>& seen) const {
    constexpr double kNear = 4.0;
    constexpr double kFar = 40.0;     // pixels
    constexpr double kDrifted = 1.0;  // times what a point was off by when it was left
    if (!known && point.milestone < 0) return;
    const auto pixel = pixel_of(setup_.cameras[0], camera_, point.position);
    if (!pixel || !setup_.cameras[0].contains(*pixel, 24.0)) return;
    if (!looks_alike(point.position, point.seen_from, camera_.position)) return;
    if (known && is_taken(state_, index)) return;
    const OutsideRows there = rows_outside(state_, setup_, point, setup_.cameras[0].ray(*pixel));
    if (!known && there.by_pose.trace() < kDrifted * there.by_point.trace()) return;
    const Candidate best = best_feature(
        features_, *pixel, std::clamp(3 * there.spread(), kNear, kFar), point.descriptor);
    if (!best.clear()) return;
    const auto feature = static_cast<std::size_t>(best.feature);
    const OutsideRows found = rows_outside(
        state_, setup_, point, setup_.cameras[0].ray(features_.pixels[feature].cast<double>()));
    if (!found.passes()) return;
    const bool other =
        std::ranges::any_of(seen, [&](const Sighting& each) { return each.feature == feature; });
    if (!other) seen.push_back({point, known, index, feature, best.bits});
  }

  const State& state_;
  const Setup& setup_;
  const Features& features_;
  Pose camera_;
};

/// Puts what was seen into the filter, in its order: points of one's own as they go with their
/// milestones, those of the known map as they are known there.
void enter(State& state, std::span<const Sighting> seen) {
  std::vector<NewLandmark> own;
  std::vector<Landmark> known;
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(3 * std::ssize(seen), 3 * std::ssize(seen));
  for (const auto& each : seen) {
    NewLandmark made = each.known ? NewLandmark{} : landmark_of(state, each.point);
    Landmark& landmark = made.landmark;
    landmark.id = each.point.id >= 0 ? each.point.id : state.next_id++;
    landmark.position = each.point.position;
    landmark.descriptor = each.point.descriptor;
    landmark.seen_from = each.point.seen_from;
    landmark.last_frame = state.frame;
    landmark.uses = 1;
    if (!each.known) {
      own.push_back(std::move(made));
      continue;
    }
    const auto at = 3 * std::ssize(known);
    covariance.block<3, 3>(at, at) = each.point.covariance;
    known.push_back(landmark);
  }
  const auto n = 3 * std::ssize(known);
  add_landmarks(state, own);
  if (n > 0) add_known_landmarks(state, known, covariance.topLeftCorner(n, n));
}

/// Points that became landmarks are in the maps no longer.
void leave_maps(State& state, std::span<const Sighting> seen) {
  std::vector<std::size_t> own;
  for (const auto& each : seen) {
    if (each.known) {
      take(state, each.index);
    } else {
      own.push_back(each.index);
    }
  }
  std::ranges::sort(own, std::greater<>());
  for (const std::size_t i : own)
    state.map.erase(state.map.begin() + static_cast<std::ptrdiff_t>(i));
}

}  // namespace

bool is_taken(const State& state, std::size_t known_point) {
  return std::ranges::binary_search(state.taken, static_cast<std::int32_t>(known_point));
}

void take(State& state, std::size_t known_point) {
  const auto index = static_cast<std::int32_t>(known_point);
  const auto at = std::ranges::lower_bound(state.taken, index);
  if (at == state.taken.end() || *at != index) state.taken.insert(at, index);
}

void use_map(State& state, const Setup& setup, const Features& features, FrameReport& report) {
  constexpr std::ptrdiff_t kMostAtOnce = 8;
  const auto followed =
      std::ranges::count_if(state.tracks, [](const Track& track) { return track.landmark >= 0; });
  const auto room = std::clamp<std::ptrdiff_t>(setup.most_landmarks - followed, 0, kMostAtOnce);
  const auto seen = MapUse(state, setup, features).sightings(static_cast<std::size_t>(room));
  if (seen.empty()) return;
  leave_maps(state, seen);
  make_room(state, setup, seen.size());
  const std::size_t first = state.landmarks.size();
  enter(state, seen);
  std::vector<RowBlock> rows;
  const Pose camera = camera_pose(setup, state.clones.back().body, 0);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Eigen::Vector2f& pixel = features.pixels[seen[i].feature];
    Observation view;
    view.frame = state.frame;
    view.left = setup.cameras[0].ray(pixel.cast<double>());
    rows.push_back(rows_of_landmark(state, setup, first + i, view, setup.landmark_sigma));
    const Landmark& landmark = state.landmarks[first + i];
    std::erase_if(state.tracks, [&](const Track& other) {
      return other.landmark < 0 && (other.pixel - pixel).squaredNorm() < 16.0F;
    });
    Track track;
    track.id = state.next_id++;
    track.pixel = track.rest = pixel;
    track.landmark = landmark.id;
    track.depth = (camera.inverse() * landmark.position).z();
    track.descriptor = landmark.descriptor;
    state.tracks.push_back(std::move(track));
  }
  if (!kalman_update(state, rows)) {
    report.rejected += static_cast<int>(rows.size());
    return;
  }
  report.from_map = static_cast<int>(rows.size());
  report.recognized += report.from_map;
  report.landmarks += static_cast<int>(rows.size());
}

}  // namespace pirt::slam
