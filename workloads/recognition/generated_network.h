// Generated networks as models: seeded weights, Darknet's layers as text, for who measures what
// recognition takes where no user's model is; and their definition in double precision.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "workloads/recognition/detect_objects.h"
#include "workloads/recognition/specs.h"

namespace pirt::recognition {

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

/// What the numbers of a detector's last convolution, [anchors * (5 + classes), rows, columns],
/// mean: all that it is sure of, before overlaps are suppressed.
[[nodiscard]] std::vector<Candidate> candidates_of_head(const GeneratedNetwork& detector,
                                                        std::span<const float> head,
                                                        double least_score);

/// What the detector sees, before overlaps are suppressed: all that it is sure of.
[[nodiscard]] std::vector<Candidate> reference_candidates(const GeneratedNetwork& detector,
                                                          std::span<const float> weights,
                                                          const Tensor& image, double least_score);
/// What the classifier says of each class.
[[nodiscard]] std::vector<double> reference_scores(const GeneratedNetwork& classifier,
                                                   std::span<const float> weights,
                                                   const Tensor& image);

}  // namespace pirt::recognition
