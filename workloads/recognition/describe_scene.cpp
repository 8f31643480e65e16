#include "workloads/recognition/describe_scene.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/model/slices.h"

namespace pirt::recognition {
namespace {

/// @source  The softmax, shifted by the largest score so that nothing overflows.
std::vector<double> probabilities(std::span<const float> scores) {
  std::vector<double> values(scores.begin(), scores.end());
  const double sum = std::accumulate(values.begin(), values.end(), 0.0);
  const bool already = std::ranges::min(values) >= 0 && std::abs(sum - 1) < 1e-3;
  if (already) return values;
  const double largest = std::ranges::max(values);
  double total = 0;
  for (double& value : values) total += value = std::exp(value - largest);
  for (double& value : values) value /= total;
  return values;
}

double rounded(double value, double steps) { return std::round(value * steps) / steps; }

}  // namespace

std::vector<Label> classify(Model& classifier, const Tensor& image, std::size_t count) {
  const auto outputs = classifier.run(image, Fit::kCrop);
  const auto is_vector = [](const NetworkOutput& output) {
    return output.values.size() > 1 &&
           std::ranges::count_if(output.shape, [](auto extent) { return extent > 1; }) == 1;
  };
  if (outputs.size() != 1 || !is_vector(outputs[0])) {
    throw_bad_input("the model '" + classifier.file() +
                    "' is no classifier: it has another output than one score for each class");
  }
  if (!std::ranges::all_of(outputs[0].values, [](float score) { return std::isfinite(score); })) {
    throw_bad_input("the model '" + classifier.file() +
                    "' gives scores that are no finite numbers; are its weights damaged?");
  }
  const auto scores = probabilities(outputs[0].values);
  classifier.check_classes(scores.size());
  std::vector<std::size_t> order(scores.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](auto a, auto b) { return scores[a] > scores[b]; });
  std::vector<Label> labels;
  for (const auto index : std::span(order).first(std::min(count, order.size()))) {
    labels.push_back({index, classifier.name_of(index), scores[index]});
  }
  return labels;
}

Scene describe_scene(const std::string& name, const Tensor& image, Model& detector,
                     Model* classifier, const DetectOptions& options, std::size_t labels) {
  Scene scene;
  scene.image = name;
  scene.objects = detect_objects(detector, image, options);
  scene.height = image.dim(1);
  scene.width = image.dim(2);
  if (classifier == nullptr) return scene;
  between_slices();
  scene.labels = classify(*classifier, image, labels);
  return scene;
}

std::string place_of(const Box& box, std::int64_t width, std::int64_t height) {
  constexpr std::array<std::string_view, 3> kRows = {"upper", "", "lower"};
  constexpr std::array<std::string_view, 3> kColumns = {"left", "", "right"};
  const auto third = [](double centre, std::int64_t size) {
    return static_cast<std::size_t>(std::clamp(3 * centre / static_cast<double>(size), 0.0, 2.0));
  };
  const auto row = kRows[third(box.y + box.height / 2, height)];
  const auto column = kColumns[third(box.x + box.width / 2, width)];
  if (row.empty() && column.empty()) return "centre";
  return fmt::format("{}{}{}", row, row.empty() || column.empty() ? "" : " ", column);
}

Json to_json(const Scene& scene) {
  Json json = {{"image", scene.image}, {"width", scene.width}, {"height", scene.height}};
  auto& objects = json["objects"] = Json::array();
  for (const auto& object : scene.objects) {
    const Box& box = object.box;
    objects.push_back({{"name", object.name},
                       {"score", rounded(object.score, 1e4)},
                       {"box", Json::array({rounded(box.x, 10), rounded(box.y, 10),
                                            rounded(box.width, 10), rounded(box.height, 10)})},
                       {"place", place_of(box, scene.width, scene.height)}});
  }
  if (scene.labels.empty()) return json;
  auto& labels = json["labels"] = Json::array();
  for (const auto& label : scene.labels) {
    labels.push_back({{"name", label.name}, {"score", rounded(label.score, 1e4)}});
  }
  return json;
}

}  // namespace pirt::recognition
