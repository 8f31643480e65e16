// A grey picture that is no tensor: what sequences give and what follows points through them.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/base/math/pixel_index.h"

namespace pirt {

/// u8 [height, width], row-major.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;

  [[nodiscard]] bool empty() const { return pixels.empty(); }
  [[nodiscard]] const std::uint8_t* row(int y) const {
    return pixels.data() + pixel_index(0, y, width);
  }
  [[nodiscard]] std::uint8_t* row(int y) { return pixels.data() + pixel_index(0, y, width); }
};

}  // namespace pirt
