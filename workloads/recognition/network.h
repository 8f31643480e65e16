// A network that somebody trained, run by OpenCV's dnn module, which is loaded with the first one.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace pirt::recognition {

enum class ModelFormat : std::uint8_t { kDarknet, kCaffe, kOnnx };

/// What one output of a network gave.
struct NetworkOutput {
  std::vector<std::int64_t> shape;
  std::vector<float> values;
  std::string name = {};  ///< That the network has for it.
};

/// One thread at a time may use it.
class Network {
 public:
  virtual ~Network() = default;
  /// On as many threads as OpenCV has (opencv_threads.h). Outputs come in OpenCV's order, of ONNX
  /// in that of their names, whatever the file's is.
  /// @param shape  Of the input, [1, 3, height, width] of a picture.
  /// @param error  Set if the network does not run on it; the outputs are empty then.
  virtual std::vector<NetworkOutput> run(std::span<const float> input, std::span<const int> shape,
                                         std::string& error) = 0;
};

/// The bytes of a model's files.
struct ModelBytes {
  ModelFormat format = ModelFormat::kOnnx;
  std::string model;   ///< Weights.
  std::string config;  ///< The layers; empty for ONNX.
};

/// What the module exports, with C linkage: the network, or none with @p error set.
using OpenNetworkFunction = void(const ModelBytes& bytes, std::unique_ptr<Network>& network,
                                 std::string& error);
inline constexpr const char* kOpenNetworkName = "pirt_open_network";

}  // namespace pirt::recognition
