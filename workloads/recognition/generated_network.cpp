#include "workloads/recognition/generated_network.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <numeric>

#include "workloads/base/math/random.h"

namespace pirt::recognition {
namespace {

/// Width and height in pixels of the network's input.
constexpr std::array<std::array<int, 2>, kAnchors> kAnchorSizes = {
    {{32, 40}, {80, 64}, {144, 160}}};

/// Planar, row-major.
struct Maps {
  int channels = 0, width = 0, height = 0;
  std::vector<double> values = {};

  [[nodiscard]] std::size_t plane() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  [[nodiscard]] double at(std::size_t channel, std::size_t cell) const {
    return values[channel * plane() + cell];
  }
};

/// One tap of the window at all places: sums += weight * shifted input.
void add_tap(const Maps& in, std::size_t channel, const NetworkLayer& layer, int dx, int dy,
             double weight, Maps& out, std::size_t filter) {
  for (int y = 0; y < out.height; ++y) {
    const int from_y = y * layer.stride + dy;
    if (from_y < 0 || from_y >= in.height) continue;
    const double* row = &in.values[channel * in.plane()] + std::ptrdiff_t{from_y} * in.width;
    double* sums = &out.values[filter * out.plane()] + std::ptrdiff_t{y} * out.width;
    for (int x = 0; x < out.width; ++x) {
      const int from_x = x * layer.stride + dx;
      if (from_x >= 0 && from_x < in.width) sums[x] += weight * row[from_x];
    }
  }
}

Maps convolve(const Maps& in, const NetworkLayer& layer, std::span<const float> weights) {
  const int pad = layer.size / 2;
  Maps out{layer.outputs, (in.width + 2 * pad - layer.size) / layer.stride + 1,
           (in.height + 2 * pad - layer.size) / layer.stride + 1};
  const auto filters = static_cast<std::size_t>(layer.outputs);
  out.values.resize(filters * out.plane());
  std::size_t next = filters;  // The biases come first.
  for (std::size_t filter = 0; filter < filters; ++filter) {
    std::fill_n(&out.values[filter * out.plane()], out.plane(), double{weights[filter]});
    for (std::size_t channel = 0; channel < static_cast<std::size_t>(layer.inputs); ++channel) {
      for (int dy = -pad; dy <= pad; ++dy) {
        for (int dx = -pad; dx <= pad; ++dx) {
          add_tap(in, channel, layer, dx, dy, double{weights[next++]}, out, filter);
        }
      }
    }
  }
  return out;
}

/// The last convolution's outputs.
Maps forward(const GeneratedNetwork& network, std::span<const float> weights, const Tensor& image) {
  const auto input = network_input(image, network.width, network.height,
                                   network.detects ? Fit::kStretch : Fit::kCrop, Preprocess::kUnit);
  Maps maps{3, network.width, network.height, {input.begin(), input.end()}};
  const auto layers = layers_of(network);
  for (std::size_t i = 0; i < layers.size(); ++i) {
    maps = convolve(maps, layers[i], weights);
    weights = weights.subspan(weight_count(layers[i]));
    if (i + 1 == layers.size()) break;
    for (double& value : maps.values) value = std::max(0.0, value);
  }
  return maps;
}

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

/// A box of the YOLO layer and its best class.
struct RawBox {
  Candidate box;  ///< Its score is that of the class alone.
  double objectness = 0;
};

/// Numbers of a box.
std::size_t box_size_of(const GeneratedNetwork& detector) {
  return static_cast<std::size_t>(kBoxSize) + static_cast<std::size_t>(detector.classes);
}

std::vector<RawBox> boxes_of(const GeneratedNetwork& detector, const Maps& maps) {
  const std::size_t box_size = box_size_of(detector);
  std::vector<RawBox> boxes;
  for (std::size_t cell = 0; cell < maps.plane(); ++cell) {
    const auto columns = static_cast<std::size_t>(maps.width);
    const auto column = static_cast<double>(cell % columns);
    const std::size_t row = cell / columns;
    for (std::size_t anchor = 0; anchor < kAnchorSizes.size(); ++anchor) {
      const auto value = [&](std::size_t i) { return maps.at(anchor * box_size + i, cell); };
      const double x = (column + sigmoid(value(0))) / maps.width;
      const double y = (static_cast<double>(row) + sigmoid(value(1))) / maps.height;
      const double width = std::exp(value(2)) * kAnchorSizes[anchor][0] / detector.width;
      const double height = std::exp(value(3)) * kAnchorSizes[anchor][1] / detector.height;
      RawBox raw{{0, 0, x - width / 2, y - height / 2, x + width / 2, y + height / 2}, value(4)};
      for (std::size_t i = kBoxSize; i < box_size; ++i) {
        const double score = sigmoid(value(i));
        if (score > raw.box.score) raw.box.index = i - kBoxSize, raw.box.score = score;
      }
      boxes.push_back(raw);
    }
  }
  return boxes;
}

std::vector<Candidate> sure_ones(const GeneratedNetwork& detector, const Maps& head,
                                 double least_score) {
  std::vector<Candidate> candidates;
  for (const RawBox& raw : boxes_of(detector, head)) {
    Candidate box = raw.box;
    box.score *= sigmoid(raw.objectness);
    if (box.score >= least_score) candidates.push_back(box);
  }
  return candidates;
}

std::string config_of(const GeneratedNetwork& network) {
  std::string text =
      fmt::format("[net]\nwidth={}\nheight={}\nchannels=3\n", network.width, network.height);
  for (const NetworkLayer& layer : layers_of(network)) {
    text +=
        fmt::format("[convolutional]\nfilters={}\nsize={}\nstride={}\npad=1\nactivation={}\n",
                    layer.outputs, layer.size, layer.stride, layer.size > 1 ? "relu" : "linear");
  }
  if (!network.detects) return text + "[avgpool]\n[softmax]\ngroups=1\n";
  std::vector<int> anchors;
  for (const auto& anchor : kAnchorSizes)
    anchors.insert(anchors.end(), anchor.begin(), anchor.end());
  return text + fmt::format("[yolo]\nmask=0,1,2\nanchors={}\nclasses={}\nnum={}\n",
                            fmt::join(anchors, ","), network.classes, kAnchorSizes.size());
}

}  // namespace

std::vector<float> seeded_weights(const GeneratedNetwork& network, std::uint64_t seed) {
  Random random(derive_seed(seed, network.detects ? "detector" : "classifier"));
  std::vector<float> weights;
  for (const NetworkLayer& layer : layers_of(network)) {
    // Biases of 0, but for the classes of boxes, of which each is likely.
    for (int filter = 0; filter < layer.outputs; ++filter) {
      const bool of_class =
          network.detects && layer.size == 1 &&
          filter % (static_cast<int>(kBoxSize) + network.classes) >= static_cast<int>(kBoxSize);
      weights.push_back(of_class ? 4.0F : 0.0F);
    }
    // Uniform, of variance 2 / inputs: what goes through ReLU keeps its mean square.
    const double bound = std::sqrt(6.0 / (layer.inputs * layer.size * layer.size));
    for (auto i = static_cast<std::size_t>(layer.outputs); i < weight_count(layer); ++i) {
      weights.push_back(static_cast<float>(random.uniform(-bound, bound)));
    }
  }
  return weights;
}

void be_sure_of(std::size_t count, const GeneratedNetwork& detector, const Tensor& image,
                double least_score, std::span<float> weights) {
  // The bias at which each box reaches the score.
  std::vector<double> reached;
  for (const RawBox& raw : boxes_of(detector, forward(detector, weights, image))) {
    const double needed = least_score / raw.box.score;
    if (needed < 1) reached.push_back(std::log(needed / (1 - needed)) - raw.objectness);
  }
  std::ranges::sort(reached);
  if (reached.size() <= count) return;
  const auto bias = static_cast<float>((reached[count - 1] + reached[count]) / 2);
  const auto head = weights.last(weight_count(layers_of(detector).back()));
  for (std::size_t anchor = 0; anchor < kAnchorSizes.size(); ++anchor) {
    head[anchor * box_size_of(detector) + 4] = bias;
  }
}

Model open_generated(const GeneratedNetwork& network, std::span<const float> weights) {
  ModelBytes bytes{ModelFormat::kDarknet, std::string(20, '\0'), config_of(network)};
  bytes.model[4] =
      2;  // Version 0.2: the pictures that it saw, of which there are none, in 64 bits.
  const std::size_t header = bytes.model.size();
  bytes.model.resize(header + weights.size_bytes());
  std::memcpy(&bytes.model[header], weights.data(), weights.size_bytes());
  return {"generated", bytes, network.width, network.height, Preprocess::kUnit};
}

std::vector<Candidate> candidates_of_head(const GeneratedNetwork& detector,
                                          std::span<const float> head, double least_score) {
  int reduction = 1;
  for (const NetworkLayer& layer : layers_of(detector)) reduction *= layer.stride;
  return sure_ones(detector,
                   {.channels = layers_of(detector).back().outputs,
                    .width = detector.width / reduction,
                    .height = detector.height / reduction,
                    .values = {head.begin(), head.end()}},
                   least_score);
}

std::vector<Candidate> reference_candidates(const GeneratedNetwork& detector,
                                            std::span<const float> weights, const Tensor& image,
                                            double least_score) {
  return sure_ones(detector, forward(detector, weights, image), least_score);
}

std::vector<double> reference_scores(const GeneratedNetwork& classifier,
                                     std::span<const float> weights, const Tensor& image) {
  const Maps maps = forward(classifier, weights, image);
  std::vector<double> scores;
  for (std::size_t i = 0; i < static_cast<std::size_t>(maps.channels); ++i) {
    const double* plane = &maps.values[i * maps.plane()];
    scores.push_back(std::exp(std::accumulate(plane, plane + maps.plane(), 0.0) /
                              static_cast<double>(maps.plane())));
  }
  const double sum = std::accumulate(scores.begin(), scores.end(), 0.0);
  for (double& score : scores) score /= sum;
  return scores;
}

}  // namespace pirt::recognition
