#include "workloads/vision/corners.h"

#include <algorithm>
#include <functional>

namespace pirt::vision {
namespace {

/// Accepted corners in cells as wide as the distance, so that only 3x3 cells are looked at.
/// Distance 10 leaves room for several corners in a cell.
class CornerGrid {
 public:
  CornerGrid(int width, int height)
      : columns_(width / kCell + 1),
        rows_(height / kCell + 1),
        cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {}

  [[nodiscard]] bool has_room(Corner c) const {
    for (int row = std::max(c.y / kCell - 1, 0); row <= std::min(c.y / kCell + 1, rows_ - 1);
         ++row) {
      for (int col = std::max(c.x / kCell - 1, 0); col <= std::min(c.x / kCell + 1, columns_ - 1);
           ++col) {
        const auto too_close = [c](Corner other) {
          const int dx = c.x - other.x;
          const int dy = c.y - other.y;
          return dx * dx + dy * dy < kCell * kCell;
        };
        if (std::ranges::any_of(cells_[index(col, row)], too_close)) return false;
      }
    }
    return true;
  }

  void add(Corner c) { cells_[index(c.x / kCell, c.y / kCell)].push_back(c); }

 private:
  static constexpr int kCell = FeatureDetect::kMinDistance;
  [[nodiscard]] std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  int columns_;
  int rows_;
  std::vector<std::vector<Corner>> cells_;
};

}  // namespace

std::vector<Corner> select_corners(std::vector<std::uint64_t>& candidates,
                                   const FeatureDetect& operation) {
  std::ranges::sort(candidates, std::greater{});
  CornerGrid grid(operation.width, operation.height);
  std::vector<Corner> corners;
  for (const std::uint64_t candidate : candidates) {
    const auto pixel = static_cast<int>(candidate & 0xffffffffU);
    const Corner corner{.x = pixel % operation.width, .y = pixel / operation.width};
    if (!grid.has_room(corner)) continue;
    corners.push_back(corner);
    if (corners.size() == FeatureDetect::kMaxCorners) break;
    grid.add(corner);
  }
  return corners;
}

void write_corners(const std::vector<Corner>& corners, Tensor& list) {
  list.set_rows(static_cast<std::int64_t>(corners.size()));
  auto* out = list.as<float>().data();
  for (const Corner& corner : corners) {
    *out++ = static_cast<float>(corner.x);
    *out++ = static_cast<float>(corner.y);
  }
}

}  // namespace pirt::vision
