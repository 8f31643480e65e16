// The module libpirt_networks.so: OpenCV's dnn. See network.h.
#include <algorithm>
#include <cstring>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>

#include "workloads/base/system/stderr_capture.h"
#include "workloads/recognition/network.h"

namespace pirt::recognition {
namespace {

namespace logging = cv::utils::logging;

int ignore_error(int, const char*, const char*, const char*, int, void*) { return 0; }

/// OpenCV prints what it throws, and logs it besides. Silent while there is one on any thread.
class SilentErrors {
 public:
  SilentErrors() {
    const std::lock_guard lock(mutex_);
    if (count_++ > 0) return;
    cv::redirectError(ignore_error);
    before_ = logging::setLogLevel(logging::LOG_LEVEL_SILENT);
  }
  SilentErrors(const SilentErrors&) = delete;
  SilentErrors& operator=(const SilentErrors&) = delete;
  ~SilentErrors() {
    const std::lock_guard lock(mutex_);
    if (--count_ > 0) return;
    cv::redirectError(nullptr);
    logging::setLogLevel(before_);
  }

 private:
  static inline std::mutex mutex_;
  static inline int count_ = 0;
  static inline logging::LogLevel before_ = logging::LOG_LEVEL_INFO;
};

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

class OpenCvNetwork : public Network {
 public:
  explicit OpenCvNetwork(cv::dnn::Net net)
      : net_(std::move(net)), outputs_(net_.getUnconnectedOutLayersNames()) {
    net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  }

  std::vector<NetworkOutput> run(std::span<const float> input, std::span<const int> shape,
                                 std::string& error) override {
    const SilentErrors silent;
    try {
      // OpenCV has no view of constant memory; it only reads.
      net_.setInput(cv::Mat(std::vector<int>(shape.begin(), shape.end()), CV_32F,
                            const_cast<float*>(input.data())));
      std::vector<cv::Mat> results;
      net_.forward(results, outputs_);
      std::vector<NetworkOutput> outputs;
      for (std::size_t i = 0; i < results.size(); ++i) {
        outputs.push_back(output_of(results[i]));
        outputs.back().name = outputs_[i];
      }
      return outputs;
    } catch (const cv::Exception& failed) {
      error = first_line(failed.err);
      return {};
    }
  }

 private:
  static NetworkOutput output_of(const cv::Mat& result) {
    if (result.type() != CV_32F || !result.isContinuous()) {
      CV_Error(cv::Error::StsNotImplemented, "an output is not of 32-bit floats");
    }
    NetworkOutput output;
    for (int axis = 0; axis < result.dims; ++axis) output.shape.push_back(result.size[axis]);
    const auto* begin = result.ptr<float>();
    output.values.assign(begin, begin + result.total());
    return output;
  }

  cv::dnn::Net net_;
  std::vector<std::string> outputs_;
};

/// OpenCV does not look whether the file has the weights that it takes. What is behind them it does
/// not read: files of networks that begin alike are used so.
void check_darknet_size(cv::dnn::Net& net, const std::string& model) {
  // Version and revision, then the pictures of its training: 8 bytes from version 0.2 on, 4 before.
  std::int32_t version[2] = {};
  std::memcpy(version, model.data(), std::min(sizeof version, model.size()));
  if (version[0] < 0 || version[1] < 0) {
    CV_Error(cv::Error::StsBadArg,
             cv::format("its header says version %d.%d", version[0], version[1]));
  }
  const std::size_t header = std::int64_t{version[0]} * 10 + version[1] >= 2 ? 20 : 16;
  std::size_t weights = 0;
  bool is_finite = true;
  for (const auto& name : net.getLayerNames()) {
    const auto layer = net.getLayer(net.getLayerId(name));
    if (layer->type == "Region") continue;  // Its anchors come from the configuration.
    for (const cv::Mat& blob : layer->blobs) {
      weights += blob.total();
      is_finite = is_finite && cv::checkRange(blob);
    }
  }
  const std::size_t needed = header + weights * sizeof(float);
  if (!is_finite) CV_Error(cv::Error::StsBadArg, "some of its weights are no numbers");
  if (model.size() >= needed) return;
  CV_Error(cv::Error::StsBadArg,
           cv::format("it has %zu bytes where its configuration needs %zu", model.size(), needed));
}

cv::dnn::Net read_net(const ModelBytes& bytes) {
  switch (bytes.format) {
    case ModelFormat::kDarknet: {
      auto net = cv::dnn::readNetFromDarknet(bytes.config.data(), bytes.config.size(),
                                             bytes.model.data(), bytes.model.size());
      check_darknet_size(net, bytes.model);
      return net;
    }
    case ModelFormat::kCaffe:
      return cv::dnn::readNetFromCaffe(bytes.config.data(), bytes.config.size(), bytes.model.data(),
                                       bytes.model.size());
    case ModelFormat::kOnnx:
      break;
  }
  return cv::dnn::readNetFromONNX(bytes.model.data(), bytes.model.size());
}

}  // namespace

extern "C" void pirt_open_network(const ModelBytes& bytes, std::unique_ptr<Network>& network,
                                  std::string& error) {
  // What reads models, protobuf among it, also prints; one at a time, as there is one stream.
  static std::mutex reading;
  const std::lock_guard one_at_a_time(reading);
  const SilentErrors silent;
  const StderrCapture capture;
  try {
    auto net = read_net(bytes);
    if (net.empty() || net.getUnconnectedOutLayers().empty()) {
      error = "it has no layers";
    } else {
      network = std::make_unique<OpenCvNetwork>(std::move(net));
    }
  } catch (const cv::Exception& failed) {
    error = first_line(failed.err);
  } catch (const std::exception& failed) {
    error = failed.what();
  }
  if (!error.empty() && !capture.text().empty()) error += " (" + first_line(capture.text()) + ")";
}

}  // namespace pirt::recognition
