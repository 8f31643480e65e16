// Where a pixel, or a cell of any grid, lies among those of a picture.
#pragma once

#include <cstddef>

namespace pirt {

/// Of column @p x in row @p y, rows of @p width one after the other; nothing is negative.
[[nodiscard]] constexpr std::size_t pixel_index(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

}  // namespace pirt
