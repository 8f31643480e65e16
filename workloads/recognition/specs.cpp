#include "workloads/recognition/specs.h"

#include "workloads/model/host_function.h"

namespace pirt::recognition {
namespace {

constexpr std::int64_t kMostBoxes = 1200;

Workload make(const char* name, const char* text) {
  Workload w;
  w.name = w.kernel = name;
  w.description = text;
  w.tags = {"recognition", "image"};
  w.inputs = {{"image", Element::kU8, {3, kPictureHeight, kPictureWidth}}};
  w.parameters = {{"detector", Element::kF32, {weight_count(generated_detector())}}};
  w.outputs = {{"boxes", Element::kF32, {kMostBoxes, 4}, true},
               {"scores", Element::kF32, {kMostBoxes}, true},
               {"classes", Element::kI32, {kMostBoxes}, true}};
  return w;
}

}  // namespace

GeneratedNetwork generated_detector() {
  return {.width = 320, .height = 320, .filters = {16, 32, 64, 64}, .classes = 8, .detects = true};
}

GeneratedNetwork generated_classifier() {
  return {
      .width = 224, .height = 224, .filters = {16, 32, 64, 64}, .classes = 100, .detects = false};
}

std::vector<NetworkLayer> layers_of(const GeneratedNetwork& network) {
  std::vector<NetworkLayer> layers;
  int inputs = 3;
  for (const int filters : network.filters) {
    layers.push_back({inputs, filters, 3, 2});
    inputs = filters;
  }
  const int outputs = network.detects ? kAnchors * (kBoxSize + network.classes) : network.classes;
  layers.push_back({inputs, outputs, 1, 1});
  return layers;
}

std::size_t weight_count(const NetworkLayer& layer) {
  const auto side = static_cast<std::size_t>(layer.size);
  const std::size_t a_filter = static_cast<std::size_t>(layer.inputs) * side * side;
  return static_cast<std::size_t>(layer.outputs) * (1 + a_filter);
}

std::int64_t weight_count(const GeneratedNetwork& network) {
  std::size_t count = 0;
  for (const NetworkLayer& layer : layers_of(network)) count += weight_count(layer);
  return static_cast<std::int64_t>(count);
}

std::vector<Workload> specs() {
  std::vector<Workload> all;
  all.push_back(make("detect_objects",
                     "boxes of a small detector of seeded weights on a picture of 640x480"));
  all[0].operation = host_function({});
  all.push_back(make("describe_scene", "that detector and a classifier on a picture of 640x480"));
  // Between its networks.
  all[1].operation = host_function({0.6, 0.4});
  all[1].parameters.push_back(
      {"classifier", Element::kF32, {weight_count(generated_classifier())}});
  all[1].outputs.push_back({"labels", Element::kI32, {kLabels}});
  all[1].outputs.push_back({"label_scores", Element::kF32, {kLabels}});
  return all;
}

}  // namespace pirt::recognition
