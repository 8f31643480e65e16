#include "workloads/slam/views/places.h"

#include <algorithm>
#include <array>
#include <map>

namespace pirt::slam {
namespace {

constexpr int kMostBits = 50;    // that differ between two views of a place, anywhere
constexpr double kApart = 0.05;  // of the distance at which a point was seen: another place

bool same_place(const KnownPlace& a, const KnownPlace& b) {
  const double seen_at = (*a.position - *a.seen_from).norm();
  return (*a.position - *b.position).norm() < kApart * seen_at;
}

/// The nearest few descriptors, nearest first.
struct Nearest {
  struct Entry {
    int bits = 257;
    std::size_t place = 0;
  };
  std::array<Entry, 8> entries;

  void look(int bits, std::size_t place) {
    if (bits >= entries.back().bits) return;
    std::size_t at = entries.size() - 1;
    for (; at > 0 && bits < entries[at - 1].bits; --at) entries[at] = entries[at - 1];
    entries[at] = {bits, place};
  }
  /// Of the first that is elsewhere; where all are the same place, of the last of them.
  [[nodiscard]] int second(std::span<const KnownPlace> places) const {
    for (std::size_t i = 1; i < entries.size(); ++i) {
      if (entries[i].bits > 256) break;
      if (!same_place(places[entries[0].place], places[entries[i].place])) return entries[i].bits;
    }
    return entries.back().bits;
  }
};

}  // namespace

std::vector<PlaceMatch> match_places(const Features& features, std::span<const KnownPlace> places,
                                     std::size_t most) {
  struct Seen {
    int bits;
    std::size_t feature;
  };
  std::map<std::size_t, Seen> by_place;
  for (std::size_t f = 0; f < std::min(most, features.pixels.size()); ++f) {
    Nearest nearest;
    for (std::size_t i = 0; i < places.size(); ++i) {
      nearest.look(distance(features.descriptors[f], *places[i].descriptor), i);
    }
    const auto& best = nearest.entries.front();
    if (best.bits > kMostBits || best.bits * 10 >= nearest.second(places) * 8) continue;
    const auto [it, first] = by_place.try_emplace(best.place, Seen{best.bits, f});
    if (!first && best.bits < it->second.bits) it->second = {best.bits, f};
  }
  std::vector<PlaceMatch> matches;
  for (const auto& [place, seen] : by_place) matches.push_back({seen.feature, place});
  return matches;
}

bool looks_alike(const Eigen::Vector3d& point, const Eigen::Vector3d& seen_from,
                 const Eigen::Vector3d& camera) {
  const Eigen::Vector3d then = seen_from - point;
  const Eigen::Vector3d now = camera - point;
  const double ratio = now.norm() / then.norm();
  constexpr double kLeastCosine = 0.8;
  return ratio > 0.6 && ratio < 1.7 && now.dot(then) > kLeastCosine * now.norm() * then.norm();
}

Candidate best_feature(const Features& features, const Eigen::Vector2d& pixel, double radius,
                       const Descriptor& descriptor) {
  Candidate best;
  const Eigen::Vector2f centre = pixel.cast<float>();
  const auto reach = static_cast<float>(radius * radius);
  for (std::size_t i = 0; i < features.pixels.size(); ++i) {
    if ((features.pixels[i] - centre).squaredNorm() > reach) continue;
    const int bits = distance(features.descriptors[i], descriptor);
    if (bits < best.bits) {
      best.second = best.feature >= 0 ? best.bits : best.second;
      best.bits = bits;
      best.feature = static_cast<int>(i);
    } else {
      best.second = std::min(best.second, bits);
    }
  }
  return best;
}

}  // namespace pirt::slam
