// A picture of a run: the trajectory over truth and map, and what was followed in one frame.
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
  std::vector<Eigen::Vector3d> map;     ///< Points, in the trajectory's world.
  std::vector<Nanos> known_again;       ///< Of poses: where points of the map were known again.
  Alignment alignment = Alignment::kSe3;
  ShownFrame frame;
  std::string title;
};

/// Of a run's end: its trajectory, its points with those of a map that it found, and where it knew
/// them again; no truth, frame or title.
[[nodiscard]] Plot plot_of(const RunResult& run, const Setup& setup);

/// Both are looked at along the axis in which the trajectory extends least.
[[nodiscard]] std::string plot_svg(const Plot& plot);
[[nodiscard]] std::string plot_png(const Plot& plot);

}  // namespace pirt::slam
