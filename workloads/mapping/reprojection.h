// The camera of bal.h, for plain numbers and for those that carry derivatives.
#pragma once

#include <ceres/rotation.h>

#include <array>

namespace pirt::mapping {

/// @param camera  9 numbers, @p point 3, as bal.h has them.
/// @return  The pixel.
template <typename T>
[[nodiscard]] std::array<T, 2> project(const T* camera, const T* point) {
  std::array<T, 3> p;
  ceres::AngleAxisRotatePoint(camera, point, p.data());
  for (std::size_t i = 0; i < 3; ++i) p[i] += camera[3 + i];
  const T x = -p[0] / p[2];
  const T y = -p[1] / p[2];
  const T square = x * x + y * y;
  const T scale = camera[6] * (T(1) + square * (camera[7] + camera[8] * square));
  return {scale * x, scale * y};
}

}  // namespace pirt::mapping
