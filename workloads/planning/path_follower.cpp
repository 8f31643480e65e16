#include "workloads/planning/path_follower.h"

#include <cmath>

namespace pirt::planning {

Point PathFollower::ahead(Point position, double ahead_m) {
  double reach = ahead_m + (asked_ ? distance(before_, position) : 0);
  before_ = position;
  asked_ = true;
  for (std::size_t i = at_ + 1; i < path_.size(); ++i) {
    reach -= distance(path_[i - 1], path_[i]);
    if (reach < 0) break;
    if (distance(path_[i], position) < distance(path_[at_], position)) at_ = i;
  }
  double left = ahead_m;
  for (std::size_t i = at_; i + 1 < path_.size(); ++i) {
    const double step = distance(path_[i], path_[i + 1]);
    if (step > left) {
      const double part = left / step;
      return {std::lerp(path_[i].x, path_[i + 1].x, part),
              std::lerp(path_[i].y, path_[i + 1].y, part)};
    }
    left -= step;
  }
  return path_.back();
}

}  // namespace pirt::planning
