// What the recognition workloads take and make, and the generated networks that they run; what they
// compute is in workloads.h.
#pragma once

#include <cstdint>
#include <vector>

#include "workloads/model/workload.h"

namespace pirt::recognition {

/// A small network without a training: 3x3 convolutions of stride 2 with ReLU, then one of 1x1.
struct GeneratedNetwork {
  int width = 0;
  int height = 0;
  std::vector<int> filters;  ///< Of the 3x3 convolutions.
  int classes = 0;
  bool detects = true;  ///< A YOLO layer; otherwise the mean of the picture and a softmax.
};
/// 320x320, 8 classes, 1200 boxes. 0.17 G operations.
[[nodiscard]] GeneratedNetwork generated_detector();
/// 224x224, 100 classes. 0.08 G operations.
[[nodiscard]] GeneratedNetwork generated_classifier();

/// A convolution, padded so that its output is 1/stride of its input.
struct NetworkLayer {
  int inputs, outputs;  ///< Channels.
  int size, stride;
};
inline constexpr int kAnchors = 3;  ///< Boxes a cell of the YOLO layer.
inline constexpr int kBoxSize = 5;  ///< x, y, width, height, objectness; the classes follow.
[[nodiscard]] std::vector<NetworkLayer> layers_of(const GeneratedNetwork& network);

/// How many numbers it has: the biases [outputs], then the weights [outputs, inputs, size, size].
[[nodiscard]] std::size_t weight_count(const NetworkLayer& layer);
/// Of all its layers, one after the other.
[[nodiscard]] std::int64_t weight_count(const GeneratedNetwork& network);

/// Of the workloads' pictures.
inline constexpr int kPictureWidth = 640;
inline constexpr int kPictureHeight = 480;
inline constexpr int kLabels = 5;

/// Of all(), in its order: everything but the functions and the operation.
[[nodiscard]] std::vector<Workload> specs();

}  // namespace pirt::recognition
