// Small networks without a training: Darknet's layers as text and seeded weights, for who measures
// what recognition takes where no user's model is, and their definition in double precision.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "workloads/recognition/detect_objects.h"

namespace pirt::recognition {

/// 3x3 convolutions of stride 2 with ReLU, then one of 1x1.
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

/// How many numbers the network has: of each layer the biases [filters], then the weights
/// [filters, inputs, rows, columns].
[[nodiscard]] std::int64_t weight_count(const GeneratedNetwork& network);
/// Scaled so that activations stay in range.
[[nodiscard]] std::vector<float> seeded_weights(const GeneratedNetwork& network,
                                                std::uint64_t seed);
/// Moves a detector's biases of objectness so that it is sure of @p count boxes of the picture, and
/// of no others, with as much room on either side as there is.
/// @param image  u8 [3, height, width]
void be_sure_of(std::size_t count, const GeneratedNetwork& detector, const Tensor& image,
                double least_score, std::span<float> weights);

/// The network as a model that OpenCV runs.
[[nodiscard]] Model open_generated(const GeneratedNetwork& network, std::span<const float> weights);

/// What the detector sees, before overlaps are suppressed: all that it is sure of.
[[nodiscard]] std::vector<Candidate> reference_candidates(const GeneratedNetwork& detector,
                                                          std::span<const float> weights,
                                                          const Tensor& image, double least_score);
/// What the classifier says of each class.
[[nodiscard]] std::vector<double> reference_scores(const GeneratedNetwork& classifier,
                                                   std::span<const float> weights,
                                                   const Tensor& image);

}  // namespace pirt::recognition
