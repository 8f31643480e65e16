#include "workloads/recognition/scene_workload.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/text/json.h"
#include "workloads/recognition/describe_scene.h"
#include "workloads/recognition/specs.h"

namespace pirt::recognition {
namespace {

constexpr std::int64_t kMostName = 32;
constexpr std::int64_t kMostText = std::int64_t{1} << 18;

TensorSpec text_spec(const char* name, std::int64_t most_bytes) {
  return {.name = name, .element = Element::kU8, .shape = {most_bytes}, .varies = true};
}

KernelFunction open(const SceneModels& models) {
  auto detector = std::make_shared<Model>(models.detector);
  auto classifier = models.classifier ? std::make_shared<Model>(*models.classifier) : nullptr;
  return [detector = std::move(detector), classifier = std::move(classifier)](
             std::span<const Tensor> inputs, std::span<Tensor> outputs) {
    const Scene scene =
        describe_scene(text_of(inputs[1]), inputs[0], *detector, classifier.get(), {}, kLabels);
    set_text(outputs[0], json_text(to_json(scene)));
  };
}

Workload workload_of(std::shared_ptr<const DescribeByModels> operation) {
  Workload w;
  w.name = "describe";
  w.kernel = "describe_scene";
  w.description =
      fmt::format("a user's models on a picture of {}x{}", operation->width, operation->height);
  w.tags = {"recognition", "image"};
  w.inputs = {{"image", Element::kU8, {3, operation->height, operation->width}},
              text_spec("name", kMostName)};
  w.outputs = {text_spec("text", kMostText)};
  w.make_data = [operation, inputs = w.inputs](const DataRequest& request) {
    Picture picture =
        request.images->rgb(picture_index(request.seed), operation->width, operation->height);
    Data data;
    data.notes = std::move(picture.notes);
    data.inputs.push_back(std::move(picture.pixels));
    data.inputs.emplace_back(inputs[1]);
    set_text(data.inputs[1], "sample");
    return data;
  };
  w.operation = std::move(operation);
  return w;
}

}  // namespace

Workload make_describe(const SceneModels& models, int width, int height) {
  auto operation = std::make_shared<DescribeByModels>();
  operation->width = width;
  operation->height = height;
  operation->models = models;
  Hash64 hash;
  hash.add(fingerprint(models.detector));
  hash.add(models.classifier ? fingerprint(*models.classifier) : 0);
  operation->fingerprint = fmt::format("{:016x}", hash.value());
  operation->prepare = [models](std::span<const Tensor>) { return open(models); };
  return workload_of(std::move(operation));
}

Workload resized(const DescribeByModels& operation, int width, int height) {
  auto other = std::make_shared<DescribeByModels>(operation);
  other->width = width;
  other->height = height;
  return workload_of(std::move(other));
}

KernelFunction open_described(const Workload& describe) {
  KernelFunction function = operation_as<HostFunction>(describe).prepare({});
  std::vector<Tensor> inputs = make_tensors(describe.inputs);
  set_text(inputs[1], "");
  std::vector<Tensor> outputs = make_tensors(describe.outputs);
  function(inputs, outputs);
  return function;
}

std::string text_of(const Tensor& tensor) {
  const auto bytes = tensor.used<std::uint8_t>();
  return {bytes.begin(), bytes.end()};
}

void set_text(Tensor& tensor, std::string_view text) {
  if (std::ssize(text) > tensor.spec().shape[0]) {
    throw_bad_input("a picture with too many objects to describe");
  }
  tensor.set_rows(std::ssize(text));
  std::ranges::copy(text, tensor.as<std::uint8_t>().begin());
}

}  // namespace pirt::recognition
