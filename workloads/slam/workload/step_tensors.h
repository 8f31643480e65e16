// What goes into the SLAM's steps and comes out of them, as tensors: what the ports of their
// workloads carry (workloads.h says which port has what).
#pragma once

#include <span>
#include <vector>

#include "workloads/model/tensor.h"
#include "workloads/slam/filter/steps.h"
#include "workloads/slam/workload/specs.h"

namespace pirt::slam {

/// @throws std::logic_error for more than kMostSamples.
[[nodiscard]] std::vector<Tensor> tensors_of(std::span<const ImuSample> samples, Nanos until);
[[nodiscard]] std::vector<ImuSample> samples_of(std::span<const Tensor> tensors);
[[nodiscard]] Nanos time_of(const Tensor& until);

[[nodiscard]] std::vector<Tensor> tensors_of(const Features& features);
[[nodiscard]] Features features_of(std::span<const Tensor> tensors);

/// @throws Error{kBadInput} for more than kMostBetter points.
[[nodiscard]] std::vector<Tensor> tensors_of(const BetterMap& better);
[[nodiscard]] BetterMap better_of(std::span<const Tensor> tensors);

void write_tracks(std::span<const TrackedPoint> tracks, std::span<Tensor> tensors);
[[nodiscard]] std::vector<TrackedPoint> tracks_of(std::span<const Tensor> tensors);

/// f32 [<=n,2].
void write_points(std::span<const Eigen::Vector2f> points, Tensor& tensor);
[[nodiscard]] std::vector<Eigen::Vector2f> points_of(const Tensor& tensor);

/// Rotation body to world by rows, then position in metres; f64 [12].
void write_pose(const Pose& pose, Tensor& tensor);
[[nodiscard]] Pose pose_of(const Tensor& tensor);

/// A picture's pyramid, u8, the finest first.
[[nodiscard]] std::vector<TensorSpec> pyramid_specs(int width, int height);
void write_pyramid(const Pyramid& pyramid, std::span<Tensor> tensors);
[[nodiscard]] Pyramid pyramid_of(std::span<const Tensor> tensors);
[[nodiscard]] TensorSpec image_spec(int width, int height);
[[nodiscard]] Tensor tensor_of(const GreyImage& image);
[[nodiscard]] GreyImage image_of(const Tensor& tensor);

}  // namespace pirt::slam
