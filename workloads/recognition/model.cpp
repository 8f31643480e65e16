#include "workloads/recognition/model.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "workloads/base/error.h"
#include "workloads/base/hash.h"
#include "workloads/base/system/module.h"
#include "workloads/base/text/numbers.h"
#include "workloads/base/text/printable.h"
#include "workloads/base/text/text.h"
#include "workloads/recognition/opencv_threads.h"

namespace pirt::recognition {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostModelBytes = std::size_t{1} << 31;
constexpr int kLargestSide = 4096;
constexpr int kLetterboxGrey = 114;  // Of Ultralytics' YOLO.
constexpr std::array<std::string_view, 3> kPreprocessNames = {"unit", "caffe", "imagenet"};
constexpr std::array<std::string_view, 2> kDetectorFitNames = {"stretch", "letterbox"};

struct Format {
  std::string_view extension;
  ModelFormat format;
  std::string_view name;
  std::string_view config;  ///< What its configuration is; empty = it has none.
  Preprocess preprocess;
};
constexpr std::array<Format, 3> kFormats = {
    {{".weights", ModelFormat::kDarknet, "Darknet", "the .cfg of its layers", Preprocess::kUnit},
     {".caffemodel", ModelFormat::kCaffe, "Caffe", "the .prototxt of its layers",
      Preprocess::kCaffe},
     {".onnx", ModelFormat::kOnnx, "ONNX", "", Preprocess::kUnit}}};

const Format& format_of(const ModelOptions& options) {
  const auto extension = options.model.extension().string();
  const auto found = std::ranges::find(kFormats, extension, &Format::extension);
  if (found == kFormats.end()) {
    throw_bad_input("cannot tell the format of the model '" + options.model.string() +
                    "' by its name; known are .weights (Darknet), .caffemodel and .onnx");
  }
  if (!found->config.empty() && !options.config) {
    throw_bad_input(fmt::format("the model '{}' needs {} too; give it with {}",
                                options.model.string(), found->config, options.config_option));
  }
  if (found->config.empty() && options.config) {
    throw_bad_input(fmt::format("the model '{}' has its layers in itself; leave out '{}'",
                                options.model.string(), options.config->string()));
  }
  return *found;
}

/// The whole number after "key" and @p mark on a line of its own, from @p begin on.
std::vector<int> numbers_after(const std::string& config, std::string_view key, char mark) {
  std::vector<int> numbers;
  for (std::string line : split(config, '\n')) {
    std::erase_if(line, [](char c) { return c == ' ' || c == '\t'; });
    if (!line.starts_with(std::string(key) + mark)) continue;
    const auto read =
        whole_number(std::string_view(line).substr(key.size() + 1), 1, kLargestSide).value;
    if (read) numbers.push_back(*read);
  }
  return numbers;
}

/// Width and height as the configuration says them; none if it does not, in a form known here.
std::optional<std::array<int, 2>> configured_size(ModelFormat format, const std::string& config) {
  if (format == ModelFormat::kDarknet) {
    const auto width = numbers_after(config, "width", '=');
    const auto height = numbers_after(config, "height", '=');
    if (!width.empty() && !height.empty()) return {{width[0], height[0]}};
  }
  if (format == ModelFormat::kCaffe) {
    // Images, channels, height, width; newer files have input_shape { dim: ... } instead.
    for (const std::string_view key : {"input_dim", "dim"}) {
      const auto dims = numbers_after(config, key, ':');
      if (dims.size() >= 4) return {{dims[3], dims[2]}};
    }
  }
  return std::nullopt;
}

/// As detectors of that format are trained.
Fit fit_of(ModelFormat format, const std::string& config) {
  const bool boxed =
      format == ModelFormat::kOnnx ||
      (format == ModelFormat::kDarknet && !numbers_after(config, "letter_box", '=').empty());
  return boxed ? Fit::kLetterbox : Fit::kStretch;
}

std::vector<std::string> read_names(const fs::path& file) {
  auto names = split(read_text(file), '\n');
  for (auto& name : names) {
    name = name.substr(name.find('|') + 1);
    name.erase(name.find_last_not_of(" \t") + 1);
  }
  while (!names.empty() && names.back().empty()) names.pop_back();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto bad = find_unprintable(names[i]);
    if (!names[i].empty() && !bad) continue;
    throw_bad_input(fmt::format("{}:{}: {}; a file of names has the name of a class on each line",
                                file.string(), i + 1, bad ? bad->what : "there is no name"));
  }
  if (names.empty()) throw_bad_input(file.string() + ": there are no names of classes in it");
  return names;
}

/// What the files hold, and how it is used.
struct ReadModel {
  ModelBytes bytes;
  std::vector<std::string> names = {};
  std::array<int, 2> size = {};
  Preprocess preprocess = Preprocess::kUnit;
  Fit fit = Fit::kStretch;
};

ReadModel read_model(const ModelOptions& options) {
  const Format& format = format_of(options);
  ReadModel read{.bytes = {format.format, read_file(options.model, kMostModelBytes), ""},
                 .preprocess = options.preprocess.value_or(format.preprocess)};
  if (read.bytes.model.empty()) throw_bad_input("'" + options.model.string() + "' is empty");
  if (options.config) read.bytes.config = read_text(*options.config);
  if (options.names) read.names = read_names(*options.names);
  read.fit = options.fit.value_or(fit_of(format.format, read.bytes.config));
  const auto size = options.size ? options.size : configured_size(format.format, read.bytes.config);
  if (!size) {
    throw_bad_input("the size of the input of '" + options.model.string() +
                    "' is not known; give it with --size WIDTHxHEIGHT, e.g. --size 640x640");
  }
  read.size = *size;
  return read;
}

/// @param what  The model, for the message: "'net.onnx' as a model of ONNX".
std::unique_ptr<Network> open_network(const ModelBytes& bytes, const std::string& what) {
  static auto* const open = reinterpret_cast<OpenNetworkFunction*>(
      module_symbol("libpirt_networks.so", kOpenNetworkName, "which runs users' models"));
  std::unique_ptr<Network> network;
  std::string error;
  open(bytes, network, error);
  if (!network) throw_bad_input("cannot use " + what + ": " + error);
  return network;
}

/// Of each channel of the network: which of R, G, B it is, what is taken off and what it is
/// multiplied by.
struct Channel {
  int from;
  float mean, scale;
};

std::array<Channel, 3> channels_of(Preprocess preprocess) {
  constexpr float kByte = 1 / 255.0F;
  switch (preprocess) {
    case Preprocess::kUnit:
      return {{{0, 0, kByte}, {1, 0, kByte}, {2, 0, kByte}}};
    case Preprocess::kCaffe:
      return {{{2, 104, 1}, {1, 117, 1}, {0, 123, 1}}};
    case Preprocess::kImagenet:
      break;
  }
  return {
      {{0, 123.675F, kByte / 0.229F}, {1, 116.28F, kByte / 0.224F}, {2, 103.53F, kByte / 0.225F}}};
}

/// What is left of a picture whose short side is brought to 256 pixels (beyond that, to 8/7 of the
/// network's) when the middle is cut out, as models of ImageNet are tested.
cv::Rect middle_of(int columns, int rows, int width, int height) {
  const double short_side =
      std::max(width, height) <= 256 ? 256.0 : std::max(width, height) * 8 / 7.0;
  const double scale = std::min(columns, rows) / short_side;
  const int kept_columns = std::clamp(static_cast<int>(std::lround(width * scale)), 1, columns);
  const int kept_rows = std::clamp(static_cast<int>(std::lround(height * scale)), 1, rows);
  return {(columns - kept_columns) / 2, (rows - kept_rows) / 2, kept_columns, kept_rows};
}

}  // namespace

std::vector<std::string> detector_fit_names() {
  return {kDetectorFitNames.begin(), kDetectorFitNames.end()};
}

Placement letterbox(int columns, int rows, int width, int height) {
  const double scale = std::min(double(width) / columns, double(height) / rows);
  const auto scaled = [scale](int side, int most) {
    return std::clamp(static_cast<int>(std::lround(side * scale)), 1, most);
  };
  Placement inner{.width = scaled(columns, width), .height = scaled(rows, height)};
  inner.x = (width - inner.width) / 2;
  inner.y = (height - inner.height) / 2;
  return inner;
}

std::vector<std::string> preprocess_names() {
  return {kPreprocessNames.begin(), kPreprocessNames.end()};
}

Model::Model(const ModelOptions& options) : file_(options.model.string()) {
  ReadModel read = read_model(options);
  format_ = read.bytes.format;
  preprocess_ = read.preprocess;
  fit_ = read.fit;
  names_ = std::move(read.names);
  width_ = read.size[0];
  height_ = read.size[1];
  threads_ = options.threads;
  network_ = open_network(
      read.bytes, fmt::format("'{}'{} as a model of {}", file_,
                              options.config ? " with '" + options.config->string() + "'" : "",
                              format_of(options).name));
}

std::unique_ptr<Network> open_network(const fs::path& model,
                                      const std::optional<fs::path>& config) {
  const ModelOptions options{.model = model, .config = config, .config_option = "config"};
  const Format& format = format_of(options);
  return open_network({.format = format.format,
                       .model = read_file(model, kMostModelBytes),
                       .config = config ? read_text(*config) : ""},
                      fmt::format("'{}' as a model of {}", model.string(), format.name));
}

std::uint64_t fingerprint(const ModelOptions& options) {
  const ReadModel read = read_model(options);
  Hash64 hash;
  hash.add(static_cast<std::uint64_t>(read.bytes.format)).add(read.bytes.model);
  hash.add(read.bytes.config).add(std::uint64_t{read.names.size()});
  for (const std::string& name : read.names) hash.add(name);
  for (const int side : read.size) hash.add(static_cast<std::uint64_t>(side));
  hash.add(static_cast<std::uint64_t>(read.preprocess)).add(static_cast<std::uint64_t>(read.fit));
  return hash.value();
}

Model::Model(std::string name, const ModelBytes& bytes, int width, int height,
             Preprocess preprocess)
    : file_(std::move(name)),
      format_(bytes.format),
      preprocess_(preprocess),
      width_(width),
      height_(height),
      network_(open_network(bytes, "'" + file_ + "'")) {}

std::vector<float> network_input(const Tensor& image, int width, int height, Fit fit,
                                 Preprocess preprocess) {
  if (image.spec().element != Element::kU8 || image.spec().shape.size() != 3 || image.dim(0) != 3) {
    throw_bad_input("a picture has to be u8 [3, height, width], not " + image.spec().describe());
  }
  const int rows = static_cast<int>(image.dim(1));
  const int columns = static_cast<int>(image.dim(2));
  const std::size_t plane = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const cv::Rect part =
      fit == Fit::kCrop ? middle_of(columns, rows, width, height) : cv::Rect(0, 0, columns, rows);
  const int interpolation = fit == Fit::kCrop ? cv::INTER_AREA : cv::INTER_LINEAR;
  const Placement inner = fit == Fit::kLetterbox
                              ? letterbox(columns, rows, width, height)
                              : Placement{.x = 0, .y = 0, .width = width, .height = height};
  std::vector<float> input(3 * plane);
  const auto channels = channels_of(preprocess);
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const auto* from = image.data() + std::ptrdiff_t{channels[i].from} * rows * columns;
    // OpenCV has no view of constant memory; resize only reads.
    const cv::Mat given(rows, columns, CV_8U, const_cast<std::byte*>(from));
    cv::Mat scaled(height, width, CV_8U, cv::Scalar(kLetterboxGrey));
    cv::Mat within = scaled({inner.x, inner.y, inner.width, inner.height});
    cv::resize(given(part), within, within.size(), 0, 0, interpolation);
    std::transform(scaled.begin<std::uint8_t>(), scaled.end<std::uint8_t>(),
                   input.begin() + static_cast<std::ptrdiff_t>(i * plane), [&](std::uint8_t value) {
                     return (static_cast<float>(value) - channels[i].mean) * channels[i].scale;
                   });
  }
  return input;
}

std::vector<NetworkOutput> Model::run(const Tensor& image, Fit fit) {
  const OpencvThreads in_use(threads_);  // Also of the resize.
  const auto input = network_input(image, width_, height_, fit, preprocess_);
  std::string error;
  const std::array shape = {1, 3, height_, width_};
  auto outputs = network_->run(input, shape, error);
  if (!error.empty()) {
    throw_bad_input(
        fmt::format("the model '{}' does not run on {}x{} pixels: {}; is that its size, "
                    "and do its files belong together?",
                    file_, width_, height_, error));
  }
  return outputs;
}

std::string Model::name_of(std::size_t index) const {
  return index < names_.size() ? names_[index] : fmt::format("class {}", index);
}

void Model::check_classes(std::size_t classes) const {
  if (names_.empty() || names_.size() == classes) return;
  throw_bad_input(fmt::format("the model '{}' has {} classes, and there are {} names", file_,
                              classes, names_.size()));
}

}  // namespace pirt::recognition
