// The specs of the AlexNet layers and of the chain.
#include "workloads/dnn/dnn.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "workloads/base/error.h"
#include "workloads/dnn/layers.h"

namespace pirt::dnn {
namespace {

/// Relative to the largest probability. Errors of the layers add up on the way and the softmax
/// turns that of the logits into a relative one. Ten times the worst that was observed: 4.0e-6 with
/// oneDNN 2.6 over six seeds.
constexpr double kChainTolerance = 4e-5;

Tensor f64_tensor(TensorSpec spec, std::span<const double> values) {
  spec.element = Element::kF64;
  Tensor tensor(std::move(spec));
  std::ranges::copy(values, tensor.as<double>().begin());
  return tensor;
}

std::vector<double> widen(const Tensor& tensor) {
  const auto values = tensor.as<float>();
  return {values.begin(), values.end()};
}

std::vector<Tensor> one_f64_output(const Workload& workload, std::span<const double> values) {
  std::vector<Tensor> outputs;
  outputs.push_back(f64_tensor(workload.outputs[0], values));
  return outputs;
}

std::string shape_text(std::int64_t c, std::int64_t h, std::int64_t w) {
  return std::to_string(c) + "x" + std::to_string(h) + "x" + std::to_string(w);
}

Workload layer(std::string name, std::string kernel, std::shared_ptr<const Operation> op) {
  Workload w;
  w.name = std::move(name);
  w.tags = {"dnn"};
  w.kernel = std::move(kernel);
  w.operation = std::move(op);
  return w;
}

/// AlexNet's layers in order (Krizhevsky et al., ImageNet classification with deep convolutional
/// neural networks, 2012), ungrouped and without local response normalization, as the paper's
/// operation counts say.
std::vector<Workload> alexnet_layers() {
  std::vector<Workload> layers;
  layers.push_back(make_conv2d_relu("conv1", {3, 227, 227, 96, 11, 11, 4, 0}));
  layers.push_back(make_max_pool("pool1", 96, 55, 55, 3, 2));
  layers.push_back(make_conv2d_relu("conv2", {96, 27, 27, 256, 5, 5, 1, 2}));
  layers.push_back(make_max_pool("pool2", 256, 27, 27, 3, 2));
  layers.push_back(make_conv2d_relu("conv3", {256, 13, 13, 384, 3, 3, 1, 1}));
  layers.push_back(make_conv2d_relu("conv4", {384, 13, 13, 384, 3, 3, 1, 1}));
  layers.push_back(make_conv2d_relu("conv5", {384, 13, 13, 256, 3, 3, 1, 1}));
  layers.push_back(make_max_pool("pool5", 256, 13, 13, 3, 2));
  layers.push_back(make_fully_connected("fc6", 256 * 6 * 6, 4096, Activation::kDropout));
  layers.push_back(make_fully_connected("fc7", 4096, 4096, Activation::kDropout));
  layers.push_back(make_fully_connected("fc8", 4096, 1000, Activation::kSoftmax));
  return layers;
}

std::vector<Workload> layers_where(bool pool) {
  std::vector<Workload> chosen;
  for (auto& one : alexnet_layers()) {
    if ((one.kernel == "max_pool") == pool) chosen.push_back(std::move(one));
  }
  return chosen;
}

}  // namespace

std::int64_t conv2d_ops(const ConvShape& s) {
  if (s.k_h > s.in_h + 2 * s.pad || s.k_w > s.in_w + 2 * s.pad) {
    throw_bad_input("the filter " + std::to_string(s.k_h) + "x" + std::to_string(s.k_w) +
                    " exceeds the padded input " + std::to_string(s.in_h + 2 * s.pad) + "x" +
                    std::to_string(s.in_w + 2 * s.pad) + "; enlarge the padding or the input");
  }
  return std::int64_t{2} * s.out_c * s.out_h() * s.out_w() * s.in_c * s.k_h * s.k_w;
}

std::int64_t conv2d_padding_ops(const ConvShape& s) {
  // Over all outputs of one dimension, the taps of a filter of `size` that lie within the input.
  const auto within = [&](int in, int out, int size) {
    std::int64_t taps = 0;
    for (int at = 0; at < out; ++at) {
      const int first = at * s.stride - s.pad;
      taps += std::max(0, std::min(first + size, in) - std::max(first, 0));
    }
    return taps;
  };
  return conv2d_ops(s) - std::int64_t{2} * s.out_c * s.in_c * within(s.in_h, s.out_h(), s.k_h) *
                             within(s.in_w, s.out_w(), s.k_w);
}

Workload make_conv2d_relu(std::string name, const ConvShape& s) {
  const std::int64_t ops = conv2d_ops(s);
  auto op = std::make_shared<Conv2dRelu>();
  op->shape = s;
  op->input = input_range(s.in_c == 3);
  Workload w = layer(std::move(name), "conv2d_relu", std::move(op));
  w.description = "convolution " + std::to_string(s.k_h) + "x" + std::to_string(s.k_w) +
                  " + ReLU, " + shape_text(s.in_c, s.in_h, s.in_w) + " to " +
                  shape_text(s.out_c, s.out_h(), s.out_w());
  w.inputs = {{"input", Element::kF32, {s.in_c, s.in_h, s.in_w}}};
  w.parameters = {{"weights", Element::kF32, {s.out_c, s.in_c, s.k_h, s.k_w}},
                  {"bias", Element::kF32, {s.out_c}}};
  w.outputs = {{"output", Element::kF32, {s.out_c, s.out_h(), s.out_w()}}};
  w.ops = ops;
  w.padding_ops = conv2d_padding_ops(s);
  if (s.in_c == 3) w.tags.emplace_back("image");
  w.at_size = [plain = w.name, s](int width, int height) {
    ConvShape sized = s;
    sized.in_w = width;
    sized.in_h = height;
    return make_conv2d_relu(plain, sized);
  };
  w.verify = verify_close(sum_tolerance(std::int64_t{s.in_c} * s.k_h * s.k_w));
  return finish_layer(std::move(w));
}

Workload make_max_pool(std::string name, int channels, int in_h, int in_w, int size, int stride) {
  if (size > in_h || size > in_w) {
    throw_bad_input("the pooling window " + std::to_string(size) + " exceeds the input " +
                    std::to_string(in_h) + "x" + std::to_string(in_w) + "; take a smaller one");
  }
  auto op = std::make_shared<MaxPool>();
  op->channels = channels;
  op->in_h = in_h;
  op->in_w = in_w;
  op->size = size;
  op->stride = stride;
  Workload w = layer(std::move(name), "max_pool", op);
  w.description = "max-pooling " + std::to_string(size) + "x" + std::to_string(size) + ", " +
                  shape_text(channels, in_h, in_w) + " to " +
                  shape_text(channels, op->out_h(), op->out_w());
  w.inputs = {{"input", Element::kF32, {channels, in_h, in_w}}};
  w.outputs = {{"output", Element::kF32, {channels, op->out_h(), op->out_w()}}};
  w.verify = verify_close(0.0);  // a maximum rounds nothing
  w.at_size = [=, plain = w.name](int width, int height) {
    return make_max_pool(plain, channels, height, width, size, stride);
  };
  return finish_layer(std::move(w));
}

Workload make_fully_connected(std::string name, int in, int out, Activation activation) {
  auto op = std::make_shared<FullyConnected>();
  op->in = in;
  op->out = out;
  op->input = input_range(false);
  op->activation = activation;
  Workload w = layer(std::move(name), "fully_connected", std::move(op));
  w.description = "fully connected " + std::to_string(in) + " to " + std::to_string(out) +
                  (activation == Activation::kSoftmax ? " + softmax" : "");
  w.inputs = {{"input", Element::kF32, {in}}};
  w.parameters = {{"weights", Element::kF32, {out, in}}, {"bias", Element::kF32, {out}}};
  w.outputs = {{"output", Element::kF32, {out}}};
  w.ops = std::int64_t{2} * in * out;
  w.verify =
      verify_close(activation == Activation::kSoftmax ? softmax_tolerance(in) : sum_tolerance(in));
  return finish_layer(std::move(w));
}

Workload finish_layer(Workload w) {
  // The functions keep a copy of the spec, taken before they themselves are set.
  const auto spec = std::make_shared<const Workload>(w);
  w.make_data = [spec](const DataRequest& request) {
    Data data;
    data.inputs.push_back(make_input(*spec, request, data.notes));
    data.parameters = make_parameters(*spec, request.seed, "");
    return data;
  };
  w.reference = [spec](const Data& data) {
    return one_f64_output(*spec, run_layer(*spec, widen(data.inputs[0]), data.parameters));
  };
  return w;
}

Workload make_sequence(std::string name, std::string description, std::vector<Workload> layers,
                       double relative_to_peak) {
  auto op = std::make_shared<Sequence>();
  op->layers = std::move(layers);
  Workload w = layer(std::move(name), "sequence", op);
  w.description = std::move(description);
  if (op->layers.front().has_tag("image")) w.tags.emplace_back("image");
  w.inputs = op->layers.front().inputs;
  w.outputs = op->layers.back().outputs;
  std::int64_t ops = 0;
  for (const auto& one : op->layers) {
    ops += one.ops.value_or(0);
    w.padding_ops += one.padding_ops;
    for (TensorSpec spec : one.parameters) {
      spec.name = one.name + "." + spec.name;
      w.parameters.push_back(std::move(spec));
    }
  }
  w.ops = ops;
  w.make_data = [op](const DataRequest& request) {
    Data data;
    data.inputs.push_back(make_input(op->layers.front(), request, data.notes));
    for (const auto& one : op->layers) {
      std::ranges::move(make_parameters(one, request.seed, one.name + "."),
                        std::back_inserter(data.parameters));
    }
    return data;
  };
  const auto spec = std::make_shared<const Workload>(w);
  w.reference = [spec](const Data& data) {
    return one_f64_output(*spec, run_layers(*spec, widen(data.inputs[0]), data.parameters));
  };
  w.verify = verify_close(relative_to_peak);
  return w;
}

namespace {

/// On such a core no longer than 2.1 ms.
constexpr std::int64_t kMostOpsOfAPart = 250'000'000;
constexpr std::int64_t kOpsPerByte = 8;

/// What it takes, in operations.
std::int64_t weight_of(const Workload& layer) {
  return std::max(layer.ops.value_or(0), kOpsPerByte * layer.bytes());
}

}  // namespace

int parts_of(const Workload& layer, int batch) {
  const bool whole = batch != 1 || layer.precision != Precision::kF32 || layer.parameters.empty() ||
                     layer.kernel == "max_pool";
  const auto* full = dynamic_cast<const FullyConnected*>(layer.operation.get());
  if (whole || (full != nullptr && full->activation == Activation::kSoftmax)) return 1;
  // Channels come in blocks of vectors.
  constexpr int kChannels = 32;
  int parts = 1;
  while (weight_of(layer) > parts * kMostOpsOfAPart &&
         layer.outputs[0].shape[0] % (2 * parts * kChannels) == 0) {
    parts *= 2;
  }
  return parts;
}

std::vector<double> slices_of(const Workload& chain) {
  const auto* sequence = dynamic_cast<const Sequence*>(chain.operation.get());
  if (sequence == nullptr) return {};
  std::vector<double> shares;
  double all = 0;
  for (const Workload& layer : sequence->layers) {
    const int parts = parts_of(layer, chain.batch);
    const auto weight = static_cast<double>(weight_of(layer));
    shares.insert(shares.end(), static_cast<std::size_t>(parts), weight / parts);
    all += weight;
  }
  for (double& share : shares) share /= all;
  return shares;
}

Workload make_alexnet() {
  return make_sequence("alexnet", "AlexNet, the whole chain, 3x227x227 to 1000 probabilities",
                       alexnet_layers(), kChainTolerance);
}

std::vector<Workload> table1() {
  auto layers = layers_where(false);
  for (auto& one : layers) one.tags.insert(one.tags.begin(), "table1");
  return layers;
}

std::vector<Workload> pools() { return layers_where(true); }

}  // namespace pirt::dnn
