#include "workloads/vision/corners.h"

#include <algorithm>
#include <functional>

namespace pirt::vision {
namespace {

/// Accepted corners in cells as wide as the distance, so that only 3x3 cells are looked at. A cell
/// is a chain: distance 10 leaves room for several corners in one.
class CornerGrid {
 public:
  CornerGrid(int width, int height)
      : columns_(width / kCell + 1),
        rows_(height / kCell + 1),
        last_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), kNone) {}

  [[nodiscard]] bool has_room(Corner c) const {
    for (int row = std::max(c.y / kCell - 1, 0); row <= std::min(c.y / kCell + 1, rows_ - 1);
         ++row) {
      for (int col = std::max(c.x / kCell - 1, 0); col <= std::min(c.x / kCell + 1, columns_ - 1);
           ++col) {
        for (int i = last_[index(col, row)]; i != kNone;
             i = links_[static_cast<std::size_t>(i)].before) {
          const Corner other = links_[static_cast<std::size_t>(i)].corner;
          const int dx = c.x - other.x;
          const int dy = c.y - other.y;
          if (dx * dx + dy * dy < kCell * kCell) return false;
        }
      }
    }
    return true;
  }

  void add(Corner c) {
    int& last = last_[index(c.x / kCell, c.y / kCell)];
    links_.push_back({c, last});
    last = static_cast<int>(links_.size()) - 1;
  }

 private:
  static constexpr int kCell = FeatureDetect::kMinDistance;
  [[nodiscard]] std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  static constexpr int kNone = -1;
  struct Link {
    Corner corner;
    int before = kNone;  ///< Of the same cell.
  };

  int columns_;
  int rows_;
  std::vector<int> last_;  ///< Of each cell.
  std::vector<Link> links_;
};

}  // namespace

std::vector<Corner> select_corners(std::vector<std::uint64_t>& candidates,
                                   const FeatureDetect& operation) {
  constexpr std::size_t kInOrderAtATime = std::size_t{2} * FeatureDetect::kMaxCorners;
  CornerGrid grid(operation.width, operation.height);
  std::vector<Corner> corners;
  std::size_t in_order = std::ranges::is_sorted(candidates, std::greater{}) ? candidates.size() : 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    // As many as are looked at, which mostly are a part.
    if (i == in_order) {
      const auto from = candidates.begin() + static_cast<std::ptrdiff_t>(i);
      in_order = std::min(candidates.size(), i + kInOrderAtATime);
      const auto to = candidates.begin() + static_cast<std::ptrdiff_t>(in_order);
      std::nth_element(from, to, candidates.end(), std::greater{});
      std::sort(from, to, std::greater{});
    }
    const std::uint64_t candidate = candidates[i];
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
