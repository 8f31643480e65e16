#include "workloads/inputs/pictures/recorded_picture.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "workloads/base/error.h"
#include "workloads/inputs/pictures/decoder.h"
#include "workloads/inputs/pictures/image_format.h"
#include "workloads/inputs/recording/messages.h"

namespace pirt {
namespace {

/// How sensor_msgs/image_encodings names what OpenCV has as @p type.
struct Encoding {
  std::string_view name;
  int type;
  int to_bgr;  ///< cv::ColorConversionCodes; below 0 = it is grey, or B, G, R already.
};
constexpr int kAsItIs = -1;
const Encoding kEncodings[] = {{"mono8", CV_8UC1, kAsItIs},
                               {"8UC1", CV_8UC1, kAsItIs},
                               {"bgr8", CV_8UC3, kAsItIs},
                               {"8UC3", CV_8UC3, kAsItIs},
                               {"rgb8", CV_8UC3, cv::COLOR_RGB2BGR},
                               {"bgra8", CV_8UC4, cv::COLOR_BGRA2BGR},
                               {"rgba8", CV_8UC4, cv::COLOR_RGBA2BGR}};

cv::Mat decoded(const ImageMessage& message, const WireReader& in) {
  const std::string bytes(message.data);
  const ImageCheck check = check_image(bytes);
  if (!check.header) in.fail("is no whole PNG or JPEG picture: " + check.problem);
  cv::Mat pixels = decode_unchanged(bytes);
  if (pixels.empty()) in.fail("has pixels that do not decode");
  if (pixels.depth() != CV_8U) in.fail("has more than 8 bits a channel");
  cv::Mat plain = pixels;
  if (pixels.channels() == 4) cv::cvtColor(pixels, plain, cv::COLOR_BGRA2BGR);
  return plain;
}

cv::Mat plain(const ImageMessage& message, const WireReader& in) {
  const auto* encoding = std::ranges::find(kEncodings, message.encoding, &Encoding::name);
  if (encoding == std::end(kEncodings)) {
    in.fail(fmt::format("is encoded as '{}'; known are mono8, 8UC1, bgr8, 8UC3, rgb8, bgra8, rgba8",
                        message.encoding));
  }
  const auto row = static_cast<std::size_t>(message.width) * CV_ELEM_SIZE(encoding->type);
  if (message.width == 0 || message.height == 0 || message.step < row) {
    in.fail("has rows that are shorter than its width");
  }
  // OpenCV has no view of constant memory; nothing writes to it before it is copied.
  const cv::Mat view(message.height, message.width, encoding->type,
                     const_cast<char*>(message.data.data()), message.step);
  cv::Mat pixels;
  if (encoding->to_bgr == kAsItIs) {
    pixels = view.clone();
  } else {
    cv::cvtColor(view, pixels, encoding->to_bgr);
  }
  return pixels;
}

}  // namespace

std::size_t picture_topic(const Recording& recording) {
  for (std::size_t i = 0; i < recording.topics().size(); ++i) {
    const Topic& topic = recording.topics()[i];
    const bool has_pictures =
        topic.type == ImageMessage::kType || topic.type == ImageMessage::kCompressedType;
    if (has_pictures && topic.messages > 0) return i;
  }
  throw_bad_input("'" + recording.file() +
                  "' has no pictures: no topic of sensor_msgs/Image or CompressedImage");
}

cv::Mat recorded_picture(const Recording& recording, std::size_t topic, std::size_t index) {
  const std::string bytes = recording.message(topic, index);
  auto in = recording.reader(topic, index, bytes);
  const ImageMessage message =
      read_image(in, recording.topics()[topic].type == ImageMessage::kCompressedType);
  return message.compressed ? decoded(message, in) : plain(message, in);
}

GreyImage recorded_grey(const Recording& recording, std::size_t topic, std::size_t index, int width,
                        int height) {
  cv::Mat pixels = recorded_picture(recording, topic, index);
  if (pixels.channels() == 3) {
    cv::Mat grey;
    cv::cvtColor(pixels, grey, cv::COLOR_BGR2GRAY);
    pixels = grey;
  }
  if (pixels.cols != width || pixels.rows != height) {
    throw_bad_input(
        fmt::format("'{}': message {} of {} has {}x{} pixels, its camera's calibration says {}x{}",
                    recording.file(), index + 1, recording.topics()[topic].name, pixels.cols,
                    pixels.rows, width, height));
  }
  GreyImage image{width, height, {}};
  image.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    std::memcpy(image.row(y), pixels.ptr(y), static_cast<std::size_t>(width));
  }
  return image;
}

}  // namespace pirt
