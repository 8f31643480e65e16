// Standard normal values as a pure function of a seed.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "workloads/base/math/random.h"

namespace pirt {

/// @source Box and Muller, A note on the generation of random normal deviates, 1958.
class Gaussian {
 public:
  explicit Gaussian(std::uint64_t seed) : seed_(seed) {}
  double next() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    const double angle = 2 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }

 private:
  /// Within (0, 1), never 0.
  double uniform() {
    return (static_cast<double>(hash_u64(seed_, index_++) >> 11U) + 0.5) * 0x1p-53;
  }

  std::uint64_t seed_;
  std::uint64_t index_ = 0;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace pirt
