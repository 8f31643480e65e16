// What a picture shows, as metadata that can be searched: its objects, where they are, and what the
// whole is.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "workloads/base/text/json.h"
#include "workloads/recognition/detect_objects.h"

namespace pirt::recognition {

/// What a classifier says of a whole picture.
struct Label {
  std::size_t index = 0;
  std::string name;
  double score = 0;  ///< Of a probability: 0 to 1, of all classes 1 together.
};

/// The classes of the highest scores, highest first. Scores that are no probabilities yet (below 0,
/// or not 1 together) go through a softmax.
/// @param image  u8 [3, height, width], order R, G, B.
/// @throws Error{kBadInput} as Model::run(), and for a model with another output than one score for
/// each class.
[[nodiscard]] std::vector<Label> classify(Model& classifier, const Tensor& image,
                                          std::size_t count);

struct Scene {
  std::string image;  ///< As it was named.
  std::int64_t width = 0;
  std::int64_t height = 0;
  std::vector<Detection> objects;
  std::vector<Label> labels;
};

/// @param classifier  None: no labels.
[[nodiscard]] Scene describe_scene(const std::string& name, const Tensor& image, Model& detector,
                                   Model* classifier, const DetectOptions& options,
                                   std::size_t labels);

/// In words, by the box's centre: "upper left", "centre", "lower right".
[[nodiscard]] std::string place_of(const Box& box, std::int64_t width, std::int64_t height);

/// {"image", "width", "height", "objects": [{"name", "score", "box": [x, y, width, height],
/// "place"}], "labels": [{"name", "score"}]}; boxes in pixels; no "labels" without a classifier.
[[nodiscard]] Json to_json(const Scene& scene);

}  // namespace pirt::recognition
