// The sequential part of feature_detect, for backends that find the candidates themselves: from
// candidates to the final corner list.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/vision/vision.h"

namespace pirt::vision {

struct Corner {
  int x = 0;
  int y = 0;
  friend bool operator==(const Corner&, const Corner&) = default;
};

/// Strongest first (ties: the later pixel first, as OpenCV sorts), each at least
/// FeatureDetect::kMinDistance from every one accepted before, at most FeatureDetect::kMaxCorners.
///
/// @param candidates  Bits of the response (f32, not negative) << 32 | y * width + x, in any order:
///                    as integers they order as the rule wants. Sorted in place, as far as needed.
[[nodiscard]] std::vector<Corner> select_corners(std::vector<std::uint64_t>& candidates,
                                                 const FeatureDetect& operation);

/// As feature_detect's output: f32 [<=500,2], as many rows as there are corners.
void write_corners(const std::vector<Corner>& corners, Tensor& list);

}  // namespace pirt::vision
