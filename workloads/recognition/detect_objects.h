// Objects in a picture: what a detector's outputs mean.
#pragma once

#include <string>
#include <vector>

#include "workloads/recognition/detector_outputs.h"
#include "workloads/recognition/model.h"

namespace pirt::recognition {

/// In pixels of the picture, inside it.
struct Box {
  double x = 0;  ///< Left edge.
  double y = 0;  ///< Upper edge.
  double width = 0;
  double height = 0;
};

struct Detection {
  std::size_t index = 0;  ///< Of its class.
  std::string name;
  double score = 0;  ///< 0 to 1.
  Box box;
};

struct DetectOptions {
  double least_score = 0.5;
  /// Of two boxes of one class whose intersection is more than this part of their union, the one
  /// with the lower score is left out; of two of different classes beyond 0.8.
  double most_overlap = 0.45;
};

/// The objects that a detector sees, highest score first.
///
/// Understood are the outputs that candidates_of() knows.
/// @param image  u8 [3, height, width], order R, G, B.
/// @throws Error{kBadInput} as Model::run() and candidates_of().
[[nodiscard]] std::vector<Detection> detect_objects(Model& detector, const Tensor& image,
                                                    const DetectOptions& options);

/// What remains of @p candidates by @p options, highest score first; ties by class, then as given.
[[nodiscard]] std::vector<Candidate> suppress_overlaps(std::vector<Candidate> candidates,
                                                       const DetectOptions& options);

}  // namespace pirt::recognition
