#include "workloads/recognition/workloads.h"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <numeric>
#include <utility>

#include "workloads/model/host_function.h"
#include "workloads/recognition/describe_scene.h"
#include "workloads/recognition/generated_network.h"

namespace pirt::recognition {
namespace {

constexpr std::size_t kSure = 12;
constexpr DetectOptions kOptions = {};

/// @tparam T  float or double.
template <typename T>
void put(std::span<const Detection> objects, std::span<Tensor> outputs) {
  for (Tensor& output : outputs.first(3)) output.set_rows(std::ssize(objects));
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const Box& box = objects[i].box;
    const std::array numbers = {box.x, box.y, box.width, box.height};
    std::ranges::transform(numbers, outputs[0].as<T>().subspan(4 * i).begin(),
                           [](double value) { return static_cast<T>(value); });
    outputs[1].as<T>()[i] = static_cast<T>(objects[i].score);
    outputs[2].as<std::int32_t>()[i] = static_cast<std::int32_t>(objects[i].index);
  }
}

template <typename T>
void put(std::span<const Label> labels, std::span<Tensor> outputs) {
  for (std::size_t i = 0; i < labels.size(); ++i) {
    outputs[3].as<std::int32_t>()[i] = static_cast<std::int32_t>(labels[i].index);
    outputs[4].as<T>()[i] = static_cast<T>(labels[i].score);
  }
}

/// What remains of them, in pixels of the workload's picture.
std::vector<Detection> objects_of(std::vector<Candidate> candidates) {
  std::vector<Detection> objects;
  for (const Candidate& box : suppress_overlaps(std::move(candidates), kOptions)) {
    objects.push_back(
        {box.index,
         "",
         box.score,
         {box.left * kPictureWidth, box.top * kPictureHeight,
          (box.right - box.left) * kPictureWidth, (box.bottom - box.top) * kPictureHeight}});
  }
  return objects;
}

KernelFunction prepare_detector(std::span<const Tensor> parameters) {
  auto detector =
      std::make_shared<Model>(open_generated(generated_detector(), parameters[0].as<float>()));
  return [detector](std::span<const Tensor> inputs, std::span<Tensor> outputs) {
    put<float>(detect_objects(*detector, inputs[0], kOptions), outputs);
  };
}

KernelFunction prepare_describer(std::span<const Tensor> parameters) {
  auto detector =
      std::make_shared<Model>(open_generated(generated_detector(), parameters[0].as<float>()));
  auto classifier =
      std::make_shared<Model>(open_generated(generated_classifier(), parameters[1].as<float>()));
  return [detector, classifier](std::span<const Tensor> inputs, std::span<Tensor> outputs) {
    const Scene scene =
        describe_scene("", inputs[0], *detector, classifier.get(), kOptions, kLabels);
    put<float>(scene.objects, outputs);
    put<float>(scene.labels, outputs);
  };
}

std::vector<Label> best_labels(std::span<const double> scores) {
  std::vector<std::size_t> order(scores.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](auto a, auto b) { return scores[a] > scores[b]; });
  std::vector<Label> labels;
  for (const auto index : std::span(order).first(kLabels))
    labels.push_back({index, "", scores[index]});
  return labels;
}

std::vector<Tensor> reference(const Data& data) {
  const bool describes = data.parameters.size() > 1;
  auto wide = specs()[describes ? 1 : 0].outputs;
  for (TensorSpec& spec : wide) {
    if (spec.element == Element::kF32) spec.element = Element::kF64;
  }
  auto outputs = make_tensors(wide);
  put<double>(objects_of(reference_candidates(generated_detector(), data.parameters[0].as<float>(),
                                              data.inputs[0], kOptions.least_score)),
              outputs);
  if (!describes) return outputs;
  const auto scores =
      reference_scores(generated_classifier(), data.parameters[1].as<float>(), data.inputs[0]);
  put<double>(best_labels(scores), outputs);
  return outputs;
}

Data make_data(const DataRequest& request, bool describes) {
  Data data;
  Picture picture = request.images->rgb(picture_index(request.seed), kPictureWidth, kPictureHeight);
  data.notes = std::move(picture.notes);
  auto weights = seeded_weights(generated_detector(), request.seed);
  be_sure_of(kSure, generated_detector(), picture.pixels, kOptions.least_score, weights);
  data.inputs.push_back(std::move(picture.pixels));
  data.parameters = make_tensors(specs()[describes ? 1 : 0].parameters);
  std::ranges::copy(weights, data.parameters[0].as<float>().begin());
  if (describes) {
    std::ranges::copy(seeded_weights(generated_classifier(), request.seed),
                      data.parameters[1].as<float>().begin());
  }
  return data;
}

}  // namespace

void write_objects(std::vector<Candidate> candidates, std::span<Tensor> outputs) {
  put<float>(objects_of(std::move(candidates)), outputs);
}

double least_score() { return kOptions.least_score; }

std::vector<Workload> all() {
  auto all = specs();
  for (Workload& w : all) {
    const bool describes = w.parameters.size() > 1;
    auto function = std::make_shared<HostFunction>(operation_as<HostFunction>(w));
    function->prepare = describes ? prepare_describer : prepare_detector;
    w.operation = std::move(function);
    w.make_data = [describes](const DataRequest& request) { return make_data(request, describes); };
    w.reference = reference;
    w.verify = verify_mixed(1e-4);
  }
  return all;
}

}  // namespace pirt::recognition
