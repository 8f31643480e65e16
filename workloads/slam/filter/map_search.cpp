#include "workloads/slam/filter/map_search.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "workloads/slam/filter/filter.h"
#include "workloads/slam/filter/measure.h"
#include "workloads/slam/views/places.h"
#include "workloads/slam/views/pnp.h"

namespace pirt::slam {
namespace {

constexpr std::size_t kLeastInliers = 8;  // of one view
constexpr std::size_t kLeastPoints = 16;  // that all views saw together
constexpr int kLeastAgreeing = 3;         // that agree
constexpr int kLeastDirect = 4;           // sightings that tell the map from its mirror image
constexpr int kDirectToMirrored = 4;      // so many, at least, to one that tells the contrary
constexpr double kMostMiss = 4.0;         // pixels
constexpr std::size_t kFeatures = 200;    // that are looked at, strongest first
constexpr std::size_t kPairs = 150'000;   // of descriptors, a frame in the mean: about 2 ms
constexpr std::int64_t kLookFrames = 3;   // from one look to the next, at least
constexpr double kMostTilt_rad = 0.05;    // between two worlds that are level

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

/// A point of the map seen where @p camera should see it, within @p radius pixels.
std::optional<std::size_t> seen_at(const Setup& setup, const Features& features, const Pose& camera,
                                   const MapPoint& point, const Eigen::Vector3d& place,
                                   double radius) {
  const auto pixel = pixel_of(setup.cameras[0], camera, place);
  if (!pixel || !looks_alike(point.position, point.seen_from, camera.position)) return std::nullopt;
  const Candidate best = best_feature(features, *pixel, radius, point.descriptor);
  if (!best.clear()) return std::nullopt;
  return static_cast<std::size_t>(best.feature);
}

/// All points that are where a camera should see them, once it is known where it may be: more than
/// are found by what they look like alone. A feature is seen once.
std::vector<PlaceMatch> matches_around(const Setup& setup, const Features& features,
                                       const Pose& camera) {
  constexpr double kAround = 8.0;  // pixels
  std::vector<PlaceMatch> matches;
  std::vector<bool> taken(features.pixels.size(), false);
  for (std::size_t i = 0; i < setup.known->size(); ++i) {
    const MapPoint& point = (*setup.known)[i];
    const auto feature = seen_at(setup, features, camera, point, point.position, kAround);
    if (!feature || taken[*feature]) continue;
    taken[*feature] = true;
    matches.push_back({*feature, i});
  }
  return matches;
}

std::vector<PointMatch> points_of(const Setup& setup, const Features& features,
                                  std::span<const PlaceMatch> matches) {
  std::vector<PointMatch> points;
  for (const auto& match : matches) {
    points.push_back({(*setup.known)[match.place].position,
                      setup.cameras[0].ray(features.pixels[match.feature].cast<double>())});
  }
  return points;
}

/// Counts what tells the map from its mirror image: points on the wall that most of them are on are
/// the same in both, those beside it are seen where the one has them or the other.
void count_mirrored(const Setup& setup, const Features& features, MapView& view,
                    const Pose& camera) {
  std::vector<Eigen::Vector3d> seen;
  for (const std::int32_t i : view.points) {
    seen.push_back((*setup.known)[static_cast<std::size_t>(i)].position);
  }
  const Plane plane = plane_of(std::move(seen));
  for (const MapPoint& point : *setup.known) {
    const Eigen::Vector3d there = plane.mirrored(point.position);
    const auto here_pixel = pixel_of(setup.cameras[0], camera, point.position);
    const auto there_pixel = pixel_of(setup.cameras[0], camera, there);
    if (!here_pixel || !there_pixel || (*here_pixel - *there_pixel).norm() < 2 * kMostMiss)
      continue;
    const auto at = [&](const Eigen::Vector3d& place) {
      return seen_at(setup, features, camera, point, place, kMostMiss).has_value() ? 1 : 0;
    };
    view.direct += at(point.position);
    view.mirrored += at(there);
  }
}

std::optional<MapView> view_of(const State& state, const Setup& setup, const Features& features) {
  std::vector<KnownPlace> places;
  for (const MapPoint& point : *setup.known) {
    places.push_back({&point.descriptor, &point.position, &point.seen_from});
  }
  const double most_miss = kMostMiss / setup.cameras[0].focal();
  const auto alike = match_places(features, places, kFeatures);
  const auto first = robust_pnp(points_of(setup, features, alike), most_miss);
  if (!first) return std::nullopt;
  const auto matches = matches_around(setup, features, first->camera);
  const auto points = points_of(setup, features, matches);
  const auto found = robust_pnp(points, most_miss);
  if (!found || found->inliers.size() < kLeastInliers) return std::nullopt;
  // Some 20 of 200 features look like some point by chance, but hardly a point where it should be.
  if (3 * first->inliers.size() < alike.size() && found->inliers.size() < kLeastPoints) {
    return std::nullopt;
  }
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
  count_mirrored(setup, features, view, found->camera);
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

}  // namespace

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
  if (search.views < kLeastAgreeing || search.points.size() < kLeastPoints || !is_no_mirror) {
    return false;
  }
  move_to_map(state, setup, *view);
  return true;
}

}  // namespace pirt::slam
