#include "workloads/dnn/layers.h"

#include <algorithm>
#include <cmath>

#include "workloads/base/math/random.h"

namespace pirt::dnn {
namespace {

/// About zero mean and unit variance for a picture that uses its range, by fixed figures as
/// networks do.
float normalized(std::uint8_t pixel) { return (static_cast<float>(pixel) - 127.5F) / 64.0F; }

/// Dense, positive, mean square 3. (0, 3] keeps fc8's logits near +-6: its softmax then neither
/// spreads evenly nor settles on one.
constexpr float kActivationRange = 3.0F;

/// The image in double precision with its zero border, so that the loops below need no conditions.
struct PaddedPlanes {
  std::size_t height, width;
  std::vector<double> values;  ///< [in_c, height, width]

  PaddedPlanes(const ConvShape& s, std::span<const double> in)
      : height(static_cast<std::size_t>(s.in_h + 2 * s.pad)),
        width(static_cast<std::size_t>(s.in_w + 2 * s.pad)),
        values(static_cast<std::size_t>(s.in_c) * height * width, 0.0) {
    const auto pad = static_cast<std::size_t>(s.pad);
    const auto in_w = static_cast<std::size_t>(s.in_w);
    const auto* line = in.data();
    for (std::size_t c = 0; c < static_cast<std::size_t>(s.in_c); ++c) {
      for (std::size_t y = 0; y < static_cast<std::size_t>(s.in_h); ++y, line += in_w) {
        std::copy_n(line, in_w, &values[(c * height + y + pad) * width + pad]);
      }
    }
  }
};

/// 24 random bits as a float in [-1, 1), exactly.
float signed_unit(std::uint32_t bits) {
  return static_cast<float>(static_cast<std::int32_t>(bits) >> 8) * 0x1p-23F;
}

/// Uniform in [-limit, limit). One hash gives two values, since AlexNet has 62 million.
void fill_signed(std::span<float> values, std::uint64_t seed, float limit) {
  for (std::size_t i = 0; i + 1 < values.size(); i += 2) {
    const std::uint64_t hash = hash_u64(seed, i);
    values[i] = limit * signed_unit(static_cast<std::uint32_t>(hash));
    values[i + 1] = limit * signed_unit(static_cast<std::uint32_t>(hash >> 32));
  }
  if (values.size() % 2 != 0) {
    const std::size_t last = values.size() - 1;
    values[last] = limit * signed_unit(static_cast<std::uint32_t>(hash_u64(seed, last)));
  }
}

/// sqrt(6 / fan-in) before a ReLU (He et al., Delving deep into rectifiers, 2015), sqrt(3 / fan-in)
/// where none follows: both keep the mean square of what goes through.
float weight_limit(const Workload& layer, const TensorSpec& weights) {
  const auto fan_in = static_cast<double>(weights.count()) / static_cast<double>(weights.shape[0]);
  const double gain = layer.kernel == "conv2d_relu" ? 2.0 : 1.0;
  return static_cast<float>(std::sqrt(3.0 * gain / fan_in));
}

Tensor make_picture(const TensorSpec& spec, const DataRequest& request,
                    std::vector<std::string>& notes) {
  const Picture picture =
      request.images->rgb(picture_index(request.seed), static_cast<int>(spec.shape[2]),
                          static_cast<int>(spec.shape[1]));
  notes = picture.notes;
  Tensor input(spec);
  std::ranges::transform(picture.pixels.as<std::uint8_t>(), input.as<float>().begin(), normalized);
  return input;
}

}  // namespace

std::vector<double> conv2d_relu(const ConvShape& s, std::span<const double> in,
                                std::span<const float> weights, std::span<const float> bias) {
  const PaddedPlanes image(s, in);
  const auto out_h = static_cast<std::size_t>(s.out_h());
  const auto out_w = static_cast<std::size_t>(s.out_w());
  const auto stride = static_cast<std::size_t>(s.stride);
  std::vector<double> out(static_cast<std::size_t>(s.out_c) * out_h * out_w);
  const float* weight = weights.data();
  for (std::size_t oc = 0; oc < static_cast<std::size_t>(s.out_c); ++oc) {
    double* plane = &out[oc * out_h * out_w];
    std::fill_n(plane, out_h * out_w, static_cast<double>(bias[oc]));
    // One weight at a time over the whole output plane: the innermost loop runs along a row and
    // vectorizes.
    for (std::size_t ic = 0; ic < static_cast<std::size_t>(s.in_c); ++ic) {
      for (std::size_t ky = 0; ky < static_cast<std::size_t>(s.k_h); ++ky) {
        for (std::size_t kx = 0; kx < static_cast<std::size_t>(s.k_w); ++kx) {
          const double w = *weight++;
          for (std::size_t y = 0; y < out_h; ++y) {
            const double* line =
                &image.values[(ic * image.height + y * stride + ky) * image.width + kx];
            double* row = plane + y * out_w;
            for (std::size_t x = 0; x < out_w; ++x) row[x] += w * line[x * stride];
          }
        }
      }
    }
    for (std::size_t i = 0; i < out_h * out_w; ++i) plane[i] = std::max(0.0, plane[i]);
  }
  return out;
}

std::vector<double> max_pool(const MaxPool& op, std::span<const double> in) {
  const auto in_w = static_cast<std::size_t>(op.in_w);
  std::vector<double> out;
  for (int c = 0; c < op.channels; ++c) {
    const double* plane =
        &in[static_cast<std::size_t>(c) * static_cast<std::size_t>(op.in_h) * in_w];
    for (int y = 0; y < op.out_h(); ++y) {
      for (int x = 0; x < op.out_w(); ++x) {
        const double* window = plane + static_cast<std::size_t>(y * op.stride) * in_w +
                               static_cast<std::size_t>(x * op.stride);
        double largest = window[0];
        for (int j = 0; j < op.size; ++j) {
          for (int i = 0; i < op.size; ++i) {
            largest = std::max(
                largest, window[static_cast<std::size_t>(j) * in_w + static_cast<std::size_t>(i)]);
          }
        }
        out.push_back(largest);
      }
    }
  }
  return out;
}

std::vector<double> fully_connected(const FullyConnected& op, std::span<const double> in,
                                    std::span<const float> weights, std::span<const float> bias) {
  std::vector<double> out;
  const float* row = weights.data();
  for (std::size_t o = 0; o < static_cast<std::size_t>(op.out); ++o, row += in.size()) {
    double sum = bias[o];
    for (std::size_t i = 0; i < in.size(); ++i) sum += static_cast<double>(row[i]) * in[i];
    out.push_back(sum);
  }
  if (op.activation == Activation::kSoftmax) {
    const double peak = *std::ranges::max_element(out);
    double total = 0.0;
    for (double& value : out) total += value = std::exp(value - peak);
    for (double& value : out) value /= total;
  }
  return out;
}

std::vector<double> run_layer(const Workload& layer, std::span<const double> in,
                              std::span<const Tensor> parameters) {
  const Operation* op = layer.operation.get();
  if (const auto* conv = dynamic_cast<const Conv2dRelu*>(op)) {
    return conv2d_relu(conv->shape, in, parameters[0].as<float>(), parameters[1].as<float>());
  }
  if (const auto* pool = dynamic_cast<const MaxPool*>(op)) return max_pool(*pool, in);
  return fully_connected(operation_as<FullyConnected>(layer), in, parameters[0].as<float>(),
                         parameters[1].as<float>());
}

std::vector<double> run_layers(const Workload& workload, std::vector<double> values,
                               std::span<const Tensor> parameters) {
  const auto* chain = dynamic_cast<const Sequence*>(workload.operation.get());
  if (chain == nullptr) return run_layer(workload, values, parameters);
  for (const Workload& layer : chain->layers) {
    values = run_layer(layer, values, parameters.first(layer.parameters.size()));
    parameters = parameters.subspan(layer.parameters.size());
  }
  return values;
}

ValueRange input_range(bool picture) {
  if (picture) return {normalized(0), normalized(255)};
  return {0.0F, kActivationRange};
}

Tensor make_input(const Workload& layer, const DataRequest& request,
                  std::vector<std::string>& notes) {
  const TensorSpec& spec = layer.inputs[0];
  if (layer.has_tag("image")) return make_picture(spec, request, notes);
  Tensor input(spec);
  const std::uint64_t seed = derive_seed(request.seed, layer.name + ".input");
  auto values = input.as<float>();
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = kActivationRange * (static_cast<float>(hash_u64(seed, i) >> 40) + 1.0F) * 0x1p-24F;
  }
  return input;
}

std::vector<Tensor> make_parameters(const Workload& layer, std::uint64_t seed,
                                    const std::string& prefix) {
  constexpr float kBiasLimit = 0.05F;
  std::vector<Tensor> parameters;
  for (TensorSpec spec : layer.parameters) {
    const std::uint64_t own_seed = derive_seed(seed, layer.name + "." + spec.name);
    const float limit = spec.name == "bias" ? kBiasLimit : weight_limit(layer, spec);
    spec.name = prefix + spec.name;
    fill_signed(parameters.emplace_back(std::move(spec)).as<float>(), own_seed, limit);
  }
  return parameters;
}

double sum_tolerance(std::int64_t terms) {
  return 4.0 * 0x1p-24 * std::sqrt(static_cast<double>(terms));
}

double softmax_tolerance(std::int64_t terms) { return 10.0 * sum_tolerance(terms); }

}  // namespace pirt::dnn
