// What the numbers of a detector's outputs mean: which of the known layouts each has.
#pragma once

#include <string>
#include <vector>

#include "workloads/recognition/network.h"

namespace pirt::recognition {

/// A row of a detector's output: scores of `classes` classes and a box in parts of the network's
/// input.
struct Candidate {
  std::size_t index = 0;
  double score = 0;
  double left = 0, top = 0, right = 1, bottom = 1;
};

/// What has to be known of a detector to read its outputs.
struct DetectorFacts {
  std::string file;  ///< For messages.
  ModelFormat format = ModelFormat::kOnnx;
  int width = 0, height = 0;  ///< Of its input, in pixels.
  std::size_t names = 0;      ///< Of classes; 0 = not given.
};

/// The boxes of at least that score, overlapping ones too.
///
/// Known are, told apart by shape and by how many names there are:
/// - [rows, 5 + classes] of Darknet's YOLO: cx, cy, w, h in parts of the picture, objectness,
/// scores
///   that have it in them;
/// - [1, rows, 5 + classes] (YOLOv5): cx, cy, w, h in pixels of the input, objectness, scores;
/// - [1, 4 + classes, rows] (YOLOv8): the same without objectness;
/// - [1, rows, 6], end to end (YOLOv10): left, top, right, bottom in pixels, score, class. As many
///   columns have an objectness and one class: those have a row for each cell of the grids of 8, 16
///   and 32 (and 64) pixels, 1 or 3 times;
/// - [1, 1, rows, 7] (SSD): image, class, score, left, top, right, bottom in parts of the input.
/// @throws Error{kBadInput} for another shape, another number of names than classes, and a score
/// that is not between 0 and 1.
[[nodiscard]] std::vector<Candidate> candidates_of(const DetectorFacts& detector,
                                                   const NetworkOutput& output, double least_score);

}  // namespace pirt::recognition
