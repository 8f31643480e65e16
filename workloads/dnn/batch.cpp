// Several images a call of a layer or of the chain.
#include <algorithm>
#include <atomic>
#include <cassert>
#include <cstring>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "workloads/base/system/thread.h"
#include "workloads/dnn/dnn.h"
#include "workloads/dnn/layers.h"

namespace pirt::dnn {
namespace {

const Workload& first_layer(const Workload& workload) {
  const auto* chain = dynamic_cast<const Sequence*>(workload.operation.get());
  return chain == nullptr ? workload : chain->layers.front();
}

/// A copy of image @p index of a batch, as the plain workload has it.
Tensor image_of(const Tensor& batch, std::int64_t index) {
  TensorSpec spec = batch.spec();
  spec.shape.erase(spec.shape.begin());
  Tensor image(std::move(spec));
  const auto bytes = static_cast<std::size_t>(image.spec().size_bytes());
  std::memcpy(image.data(), batch.data() + static_cast<std::size_t>(index) * bytes, bytes);
  return image;
}

void put_image(const Tensor& image, std::int64_t index, Tensor& batch) {
  const auto bytes = static_cast<std::size_t>(image.spec().size_bytes());
  std::memcpy(batch.data() + static_cast<std::size_t>(index) * bytes, image.data(), bytes);
}

std::vector<Tensor> images_of(std::span<const Tensor> batches, std::int64_t index) {
  std::vector<Tensor> images;
  for (const Tensor& batch : batches) images.push_back(image_of(batch, index));
  return images;
}

Data make_batch(const Workload& plain, const TensorSpec& input, const DataRequest& request) {
  Data data = plain.make_data(request);
  Tensor batch(input);
  put_image(data.inputs[0], 0, batch);
  for (std::int64_t i = 1; i < batch.dim(0); ++i) {
    DataRequest next = request;
    next.seed += static_cast<std::uint64_t>(i);
    std::vector<std::string> notes;
    put_image(make_input(first_layer(plain), next, notes), i, batch);
    for (std::string& note : notes) {
      if (std::ranges::find(data.notes, note) == data.notes.end()) {
        data.notes.push_back(std::move(note));
      }
    }
  }
  data.inputs[0] = std::move(batch);
  return data;
}

/// Image by image, on all cores: plain double precision takes a second and more for each.
std::vector<Tensor> reference(const Workload& plain, TensorSpec output, const Data& data) {
  output.element = Element::kF64;
  std::vector<Tensor> outputs;
  Tensor& batch = outputs.emplace_back(std::move(output));
  const std::int64_t images = batch.dim(0);
  const auto to = batch.as<double>();
  const std::size_t length = to.size() / static_cast<std::size_t>(images);
  std::atomic<std::int64_t> next = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto compute_some = [&] {
    for (std::int64_t i = next++; i < images; i = next++) {
      const Tensor image = image_of(data.inputs[0], i);
      const auto values = image.as<float>();
      const auto result = run_layers(plain, {values.begin(), values.end()}, data.parameters);
      std::ranges::copy(result, to.subspan(static_cast<std::size_t>(i) * length, length).begin());
    }
  };
  const auto compute = [&] {
    try {
      compute_some();
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
    }
  };
  std::vector<std::jthread> others(std::max(1U, std::thread::hardware_concurrency()) - 1);
  try {
    for (std::jthread& other : others) other = start_thread(compute);
  } catch (...) {
    next = images;  // the others end with the image that they are at
    throw;
  }
  compute();
  others.clear();
  if (failure) std::rethrow_exception(failure);
  return outputs;
}

/// The verdict of the first image that is wrong, or else of the one that came closest to it.
Verdict verify_images(const Workload& plain, std::int64_t images, std::span<const Tensor> outputs,
                      std::span<const Tensor> expected) {
  const auto fits = [images](const Tensor& tensor) {
    return !tensor.spec().shape.empty() && tensor.dim(0) == images;
  };
  if (!std::ranges::all_of(outputs, fits) || !std::ranges::all_of(expected, fits)) {
    return plain.verify(outputs, {});  // which says what is wrong with the shapes
  }
  Verdict closest;
  for (std::int64_t i = 0; i < images; ++i) {
    Verdict verdict = plain.verify(images_of(outputs, i), images_of(expected, i));
    verdict.detail = "image " + std::to_string(i) + ": " + verdict.detail;
    if (!verdict.ok) return verdict;
    if (i == 0 || verdict.worst_error > closest.worst_error) closest = std::move(verdict);
  }
  return closest;
}

}  // namespace

Workload batched(const Workload& plain, int batch) {
  assert(plain.batch == 1 && batch > 1);
  Workload w = plain;
  w.batch = batch;
  w.description = "batch of " + std::to_string(batch) + ": " + plain.description;
  for (auto* specs : {&w.inputs, &w.outputs}) {
    for (TensorSpec& spec : *specs) spec.shape.insert(spec.shape.begin(), batch);
  }
  if (w.ops) *w.ops *= batch;
  w.padding_ops *= batch;
  if (const auto* chain = dynamic_cast<const Sequence*>(plain.operation.get())) {
    auto op = std::make_shared<Sequence>();
    for (const Workload& layer : chain->layers) op->layers.push_back(batched(layer, batch));
    w.operation = std::move(op);
  }
  const auto spec = std::make_shared<const Workload>(plain);
  w.make_data = [spec, input = w.inputs[0]](const DataRequest& request) {
    return make_batch(*spec, input, request);
  };
  w.reference = [spec, output = w.outputs[0]](const Data& data) {
    return reference(*spec, output, data);
  };
  w.verify = [spec, batch](std::span<const Tensor> outputs, std::span<const Tensor> expected) {
    return verify_images(*spec, batch, outputs, expected);
  };
  return w;
}

}  // namespace pirt::dnn
