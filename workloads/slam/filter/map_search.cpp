#include "workloads/slam/filter/map_search.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/filter/milestones.h"
#include "workloads/slam/views/places.h"
#include "workloads/slam/views/pnp.h"

namespace pirt::slam {
namespace {

constexpr std::size_t kLeastInliers = 8;  // of one view
constexpr std::size_t kLeastPoints = 16;  // that all views saw together
constexpr int kLeastViews = 3;            // that agree
constexpr int kLeastDirect = 4;           // sightings that tell the map from its mirror image
constexpr int kDirectToMirrored = 4;      // so many, at least, to one that tells the contrary
constexpr double kMostMiss = 4.0;         // pixels
constexpr std::size_t kFeatures = 200;    // that are looked at, strongest first
constexpr std::size_t kPairs = 150'000;   // of descriptors, a frame in the mean: about 2 ms
constexpr std::int64_t kLookFrames = 3;   // from one look to the next, at least
constexpr double kMostTilt_rad = 0.05;    // between two worlds that are level

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

bool is_time_to_look(const State& state, const Setup& setup) {
  const auto pairs = std::min(kFeatures, std::size_t{400}) * setup.known->size();
  const auto frames = static_cast<std::int64_t>((pairs + kPairs - 1) / kPairs);
  return state.frame % std::max(kLookFrames, frames) == 0;
}

/// What one view says of where the map is.
struct MapView {
  Similarity map_from_world;
  Eigen::Vector3d camera;            ///< In the map.
  double depth = 0;                  ///< Median.
  std::vector<std::int32_t> points;  ///< Of the map, rising.
  int direct = 0, mirrored = 0;      ///< As MapSearch has them.
};

/// How much longer a way is in the map than in a world without scale, by the depths of what both
/// know. Absent if they know too little in common.
std::optional<double> scale_between(const State& state, const Features& features,
                                    std::span<const PlaceMatch> matches,
                                    std::span<const double> depths) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Eigen::Vector2f& pixel = features.pixels[matches[i].feature];
    const Track* nearest = nullptr;
    float least = 9.0F;  // squared pixels
    for (const Track& track : state.tracks) {
      const float d = (track.pixel - pixel).squaredNorm();
      if (track.depth > 0 && d < least) least = d, nearest = &track;
    }
    if (nearest != nullptr) ratios.push_back(depths[i] / nearest->depth);
  }
  constexpr std::size_t kLeastRatios = 5;
  if (ratios.size() < kLeastRatios) return std::nullopt;
  return median(ratios);
}

/// The turn about the vertical that comes nearest to a rotation.
Eigen::Matrix3d heading_of(const Eigen::Matrix3d& rotation) {
  return rotation_of(
      {0, 0, std::atan2(rotation(1, 0) - rotation(0, 1), rotation(0, 0) + rotation(1, 1))});
}

/// The plane that most of some points share.
struct Plane {
  Eigen::Vector3d normal, centre;

  [[nodiscard]] double off(const Eigen::Vector3d& p) const { return normal.dot(p - centre); }
  [[nodiscard]] Eigen::Vector3d mirrored(const Eigen::Vector3d& p) const {
    return p - 2 * off(p) * normal;
  }
};

Plane plane_of(std::vector<Eigen::Vector3d> points) {
  Plane plane;
  auto nearest = points;
  constexpr int kRounds = 5;  // each of the plane of those that were nearest to the one before
  for (int round = 0; round < kRounds; ++round) {
    plane.centre.setZero();
    for (const auto& p : nearest) plane.centre += p / static_cast<double>(nearest.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const auto& p : nearest) spread += (p - plane.centre) * (p - plane.centre).transpose();
    plane.normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
    std::ranges::sort(points, {}, [&](const auto& p) { return std::abs(plane.off(p)); });
    nearest.assign(points.begin(), points.begin() + 6 * std::ssize(points) / 10);
  }
  return plane;
}

/// Counts the matches that tell the map from its mirror image: those on the wall that most of them
/// are on are the same in both, those beside it are seen where the one has them or the other.
void count_mirrored(std::span<const PointMatch> matches, const PnpResult& found, double most_miss,
                    MapView& view) {
  std::vector<Eigen::Vector3d> inliers;
  for (const std::size_t i : found.inliers) inliers.push_back(matches[i].point);
  const Plane plane = plane_of(std::move(inliers));
  const Pose from_map = found.camera.inverse();
  for (const PointMatch& match : matches) {
    const auto miss = [&](const Eigen::Vector3d& point) {
      const Eigen::Vector3d p = from_map * point;
      return p.z() > 0 ? (p.head<2>() / p.z() - match.ray).norm() : 1e9;
    };
    const double here = miss(match.point);
    const double there = miss(plane.mirrored(match.point));
    if (here < most_miss && there > 2 * most_miss) ++view.direct;
    if (there < most_miss && here > 2 * most_miss) ++view.mirrored;
  }
}

std::optional<MapView> view_of(const State& state, const Setup& setup, const Features& features) {
  std::vector<KnownPlace> places;
  for (const MapPoint& point : *setup.known) {
    places.push_back({&point.descriptor, &point.position, &point.seen_from});
  }
  const auto matches = match_places(features, places, kFeatures);
  std::vector<PointMatch> points;
  for (const auto& match : matches) {
    points.push_back({(*setup.known)[match.place].position,
                      setup.cameras[0].ray(features.pixels[match.feature].cast<double>())});
  }
  const double most_miss = kMostMiss / setup.cameras[0].focal();
  const auto found = robust_pnp(points, most_miss);
  if (!found || found->inliers.size() < kLeastInliers) return std::nullopt;
  // Some 20 of 200 features look like some point by chance.
  if (3 * found->inliers.size() < points.size()) return std::nullopt;
  MapView view;
  view.camera = found->camera.position;
  std::vector<PlaceMatch> good;
  std::vector<double> depths;
  for (const std::size_t i : found->inliers) {
    good.push_back(matches[i]);
    depths.push_back((found->camera.inverse() * points[i].point).z());
    view.points.push_back(static_cast<std::int32_t>(matches[i].place));
  }
  view.depth = median(depths);
  count_mirrored(points, *found, most_miss, view);
  const Pose here = camera_pose(setup, state.clones.back().body, 0);
  Eigen::Matrix3d turn = found->camera.rotation * here.rotation.transpose();
  double scale = 1;
  if (setup.imu) {
    const Eigen::Matrix3d heading = heading_of(turn);
    if (angle_of(heading.transpose() * turn) > kMostTilt_rad) return std::nullopt;
    turn = heading;
  } else {
    const auto known = scale_between(state, features, good, depths);
    if (!known) return std::nullopt;
    scale = *known;
  }
  view.map_from_world = {scale, {turn, found->camera.position - scale * (turn * here.position)}};
  return view;
}

bool agree(const MapSearch& search, const MapView& view, const Pose& camera) {
  constexpr double kMostTurn_rad = 0.05;
  constexpr double kMostMove = 0.1;    // in depths
  constexpr double kMostScale = 0.15;  // of it
  const Similarity& before = search.map_from_world;
  const Similarity& now = view.map_from_world;
  return angle_of(before.pose.rotation.transpose() * now.pose.rotation) < kMostTurn_rad &&
         (before * camera.position - now * camera.position).norm() < kMostMove * view.depth &&
         std::abs(before.scale / now.scale - 1) < kMostScale;
}

void move_to_map(State& state, const Setup& setup, const MapView& view) {
  constexpr double kTurn_rad = 0.01;
  constexpr double kLevel_rad = 0.003;  // both worlds know which way is up
  constexpr double kPosition = 0.015;   // of the depth
  constexpr double kScale = 0.05;
  const double level = setup.imu ? kLevel_rad : kTurn_rad;
  move_world(state, view.map_from_world,
             covariance_at(view.camera, {level, level, kTurn_rad}, kPosition * view.depth,
                           setup.imu ? 0 : kScale));
  state.in_map = true;
  state.map_from_start = view.map_from_world;
  state.search = {};
}

// ------------------------------------------------------------------- a map whose place is known

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
    std::ranges::stable_partition(seen, [](const Sighting& each) { return !each.known; });
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

bool seek_map(State& state, const Setup& setup, const Features& features) {
  if (!seeks_map(state, setup) || state.status != Status::kTracking || state.clones.empty() ||
      !is_time_to_look(state, setup)) {
    return false;
  }
  const auto view = view_of(state, setup, features);
  if (!view) return false;
  MapSearch& search = state.search;
  const Pose camera = camera_pose(setup, state.clones.back().body, 0);
  if (search.views > 0 && !agree(search, *view, camera)) search = {};
  ++search.views;
  search.map_from_world = view->map_from_world;
  search.direct += view->direct;
  search.mirrored += view->mirrored;
  std::vector<std::int32_t> all;
  std::ranges::set_union(search.points, view->points, std::back_inserter(all));
  search.points = std::move(all);
  const bool is_no_mirror =
      search.direct >= std::max(kLeastDirect, kDirectToMirrored * search.mirrored);
  if (search.views < kLeastViews || search.points.size() < kLeastPoints || !is_no_mirror) {
    return false;
  }
  move_to_map(state, setup, *view);
  return true;
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
  report.recognized += static_cast<int>(rows.size());
  report.landmarks += static_cast<int>(rows.size());
}

}  // namespace pirt::slam
