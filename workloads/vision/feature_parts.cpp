// The parts of extracting features that compute on no picture.
#include <algorithm>
#include <cassert>
#include <cmath>

#include "workloads/base/math/gaussian.h"
#include "workloads/vision/features.h"

namespace pirt::slam {
namespace {

constexpr int kReach = 15;  // of the descriptor's patch

/// Gaussian offsets with a sigma of a fifth of the patch, as BRIEF's authors found best.
std::array<PatchPair, 256> make_pattern() {
  Gaussian gaussian(20100905);
  const auto offset = [&] {
    const double value = gaussian.next() * (2 * kReach + 1) / 5.0;
    return static_cast<std::int8_t>(std::lround(std::clamp(value, -1.0 * kReach, 1.0 * kReach)));
  };
  std::array<PatchPair, 256> pattern{};
  for (auto& pair : pattern) {
    pair.ax = offset();
    pair.ay = offset();
    do {
      pair.bx = offset();
      pair.by = offset();
    } while (pair.ax == pair.bx && pair.ay == pair.by);
  }
  return pattern;
}

}  // namespace

float corner_score(int xx, int xy, int yy) {
  const auto a = static_cast<float>(xx);
  const auto b = static_cast<float>(yy);
  const auto c = static_cast<float>(xy);
  return 0.5F * (a + b) - std::sqrt(0.25F * (a - b) * (a - b) + c * c);
}

std::vector<FastCorner> best_corners(std::span<const FastCorner> found, int width, int height,
                                     const FeatureOptions& options) {
  const int columns = (width + options.cell - 1) / options.cell;
  const int rows = (height + options.cell - 1) / options.cell;
  std::vector<std::vector<FastCorner>> cells(static_cast<std::size_t>(columns * rows));
  for (const auto& corner : found) {
    assert(corner.x >= 0 && corner.y >= 0 && corner.x < width && corner.y < height);
    const int cell = (corner.y / options.cell) * columns + corner.x / options.cell;
    cells[static_cast<std::size_t>(cell)].push_back(corner);
  }
  const std::size_t share = static_cast<std::size_t>(options.most) / cells.size() + 1;
  const auto stronger = [](const FastCorner& a, const FastCorner& b) {
    if (a.score != b.score) return a.score > b.score;
    return a.y != b.y ? a.y < b.y : a.x < b.x;
  };
  std::vector<FastCorner> best;
  for (auto& cell : cells) {
    std::ranges::sort(cell, stronger);
    for (std::size_t i = 0, kept = 0; i < cell.size() && kept < share; ++i) {
      const bool near = std::any_of(
          best.end() - static_cast<std::ptrdiff_t>(kept), best.end(), [&](const auto& other) {
            return std::abs(other.x - cell[i].x) < 8 && std::abs(other.y - cell[i].y) < 8;
          });
      if (near) continue;
      best.push_back(cell[i]);
      ++kept;
    }
  }
  std::ranges::sort(best, stronger);
  if (std::ssize(best) > options.most) best.resize(static_cast<std::size_t>(options.most));
  return best;
}

std::span<const PatchPair, 256> descriptor_pattern() {
  static const auto pattern = make_pattern();
  return pattern;
}

}  // namespace pirt::slam
