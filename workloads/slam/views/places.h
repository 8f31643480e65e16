// Which places of the world a picture shows, by what they look like alone.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "workloads/vision/features.h"

namespace pirt::slam {

/// A place that may be known again; what it points to outlives it.
struct KnownPlace {
  const Descriptor* descriptor = nullptr;
  const Eigen::Vector3d* position = nullptr;
  const Eigen::Vector3d* seen_from = nullptr;  ///< Where it was described.
};

struct PlaceMatch {
  std::size_t feature = 0, place = 0;
};

/// Features whose nearest descriptor is clearly nearer than that of any place elsewhere: the same
/// point may be there several times. A place is seen once.
/// @param most  Features that are looked at, strongest first.
[[nodiscard]] std::vector<PlaceMatch> match_places(const Features& features,
                                                   std::span<const KnownPlace> places,
                                                   std::size_t most);

/// Whether the view of a point is near enough to the one that was described.
[[nodiscard]] bool looks_alike(const Eigen::Vector3d& point, const Eigen::Vector3d& seen_from,
                               const Eigen::Vector3d& camera);

/// The feature that looks most like something that should be seen near a pixel.
struct Candidate {
  int feature = -1;
  int bits = 60;  ///< That differ between two views of a place, at most.
  int second = 256;
  /// One was found, and no other one near it looks nearly as much alike.
  [[nodiscard]] bool clear() const { return feature >= 0 && bits * 10 < second * 8; }
};
[[nodiscard]] Candidate best_feature(const Features& features, const Eigen::Vector2d& pixel,
                                     double radius, const Descriptor& descriptor);

}  // namespace pirt::slam
