// A picture of a run: the trajectory over the truth, and what was followed in one frame.
#pragma once

#include <string>
#include <vector>

#include "workloads/slam/run/pipeline.h"

namespace pirt::slam {

/// A frame to show: its picture, and the pixels of tracks (those of landmarks apart).
struct ShownFrame {
  GreyImage image;
  std::vector<Eigen::Vector2f> tracks, landmarks;
};
[[nodiscard]] ShownFrame show(const State& state, const GreyImage& image);

struct Plot {
  std::vector<StampedPose> trajectory;  ///< As estimated; shown aligned if there is truth.
  std::vector<TruthRow> truth;          ///< May be empty.
  Alignment alignment = Alignment::kSe3;
  ShownFrame frame;
  std::string title;
};

/// Both are looked at along the axis in which the trajectory extends least.
[[nodiscard]] std::string plot_svg(const Plot& plot);
[[nodiscard]] std::string plot_png(const Plot& plot);

}  // namespace pirt::slam
