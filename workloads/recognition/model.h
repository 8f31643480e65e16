// A user's model: a trained network with the form that its input has and the names of its classes.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/tensor.h"
#include "workloads/recognition/network.h"

namespace pirt::recognition {

/// How a picture becomes a network's numbers.
enum class Preprocess : std::uint8_t {
  kUnit,      ///< R, G, B from 0 to 1: Darknet, YOLO in ONNX.
  kCaffe,     ///< B, G, R from 0 to 255, less 104, 117, 123: Caffe's models of ImageNet.
  kImagenet,  ///< R, G, B from 0 to 1, less ImageNet's mean, over its deviation: PyTorch's models.
};
/// "unit", "caffe", "imagenet".
[[nodiscard]] std::vector<std::string> preprocess_names();

/// How a picture of another shape comes to the network's size.
enum class Fit : std::uint8_t {
  kStretch,    ///< All of it, whatever becomes of its aspect: Darknet's detectors, and SSD.
  kLetterbox,  ///< All of it in its aspect, grey around it: YOLO's since its fifth version.
  kCrop,       ///< The middle, in its aspect: classifiers, as they were trained.
};
/// Of detectors: "stretch", "letterbox".
[[nodiscard]] std::vector<std::string> detector_fit_names();

/// Where a picture lies in a network's input, in pixels of that.
struct Placement {
  int x = 0, y = 0, width = 0, height = 0;
};
/// Of a picture of those columns and rows in its aspect, in the middle of a network of that size.
[[nodiscard]] Placement letterbox(int columns, int rows, int width, int height);

struct ModelOptions {
  std::filesystem::path model;  ///< .weights of Darknet, .caffemodel, .onnx
  std::optional<std::filesystem::path> config =
      std::nullopt;  ///< Darknet's .cfg, Caffe's .prototxt
  std::optional<std::filesystem::path> names =
      std::nullopt;  ///< A class a line; text before a '|' is left out.
  /// Default: what the configuration says. ONNX has to be told.
  std::optional<std::array<int, 2>> size = std::nullopt;  ///< Width, height.
  std::optional<Preprocess> preprocess = std::nullopt;    ///< Default: the format's.
  /// Of a detector. Default: kLetterbox for ONNX, and for Darknet where its configuration says
  /// letter_box=1.
  std::optional<Fit> fit = std::nullopt;
  std::string config_option = "--config";  ///< What the user gives `config` with.
  int threads = 1;                         ///< As OpencvThreads.
};

/// Of all that its answers follow from but the picture: what the files hold, and how it is used.
/// @throws Error{kBadInput} for files that cannot be read, or do not say what the options leave
/// open.
[[nodiscard]] std::uint64_t fingerprint(const ModelOptions& options);

/// The network of these files, as it is.
/// @param config  Darknet's .cfg, Caffe's .prototxt; none for ONNX.
/// @throws Error as Model.
[[nodiscard]] std::unique_ptr<Network> open_network(
    const std::filesystem::path& model, const std::optional<std::filesystem::path>& config);

/// What a network of that size is given for a picture: f32 [3, height, width].
/// @param image  u8 [3, height, width], order R, G, B, of any size.
/// @throws Error{kBadInput} for an image of another element type or shape.
[[nodiscard]] std::vector<float> network_input(const Tensor& image, int width, int height, Fit fit,
                                               Preprocess preprocess);

/// One thread at a time may use it.
class Model {
 public:
  /// @throws Error{kBadInput} naming the file that is no model, has no known format or does not fit
  /// its configuration; Error{kEnvironment} if libpirt_networks.so is not there.
  explicit Model(const ModelOptions& options);
  /// A model that is in memory, and computes on one thread. @param name  For messages.
  Model(std::string name, const ModelBytes& bytes, int width, int height, Preprocess preprocess);

  /// @param image  u8 [3, height, width], order R, G, B.
  /// @throws Error{kBadInput} for an image of another element type or shape, or if the network does
  /// not run on the size that it was given.
  [[nodiscard]] std::vector<NetworkOutput> run(const Tensor& image, Fit fit);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] ModelFormat format() const { return format_; }
  /// As a detector.
  [[nodiscard]] Fit fit() const { return fit_; }
  [[nodiscard]] const std::string& file() const { return file_; }
  /// Empty if no file of names was given.
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
  /// The name of a class; "class 7" without names.
  [[nodiscard]] std::string name_of(std::size_t index) const;
  /// @throws Error{kBadInput} if there are names, and not @p classes of them.
  void check_classes(std::size_t classes) const;

 private:
  std::string file_;
  ModelFormat format_;
  Preprocess preprocess_;
  Fit fit_ = Fit::kStretch;
  int width_ = 0;
  int height_ = 0;
  int threads_ = 1;
  std::vector<std::string> names_;
  std::unique_ptr<Network> network_;
};

}  // namespace pirt::recognition
