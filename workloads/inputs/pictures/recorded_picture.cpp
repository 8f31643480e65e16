#include "workloads/inputs/pictures/recorded_picture.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "workloads/base/error.h"
#include "workloads/base/text/printable.h"
#include "workloads/inputs/pictures/decoder.h"
#include "workloads/inputs/pictures/image_format.h"
#include "workloads/inputs/recording/first_message.h"

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
                               {"mono16", CV_16UC1, kAsItIs},
                               {"bgr8", CV_8UC3, kAsItIs},
                               {"8UC3", CV_8UC3, kAsItIs},
                               {"rgb8", CV_8UC3, cv::COLOR_RGB2BGR},
                               {"bgra8", CV_8UC4, cv::COLOR_BGRA2BGR},
                               {"rgba8", CV_8UC4, cv::COLOR_RGBA2BGR}};

/// Its own, or what the calibration says.
struct Size {
  std::int64_t width, height;
  bool operator==(const Size&) const = default;
};

/// What is known of the camera.
struct Expected {
  std::optional<Size> size = {};
  std::atomic<bool>* is_deep = nullptr;
};

/// Before memory is taken for the pixels.
void check_size(const WireReader& in, const Size& size, const std::optional<Size>& expected) {
  if (!expected || size == *expected) return;
  in.fail(fmt::format("has {}x{} pixels, its camera's calibration says {}x{}", size.width,
                      size.height, expected->width, expected->height));
}

void narrow(cv::Mat& pixels, const WireReader& in, const Expected& expected) {
  const std::string why_not = take_upper_bits(pixels, expected.is_deep);
  if (!why_not.empty()) in.fail("is no grey picture: " + why_not);
}

cv::Mat decoded(const ImageMessage& message, const WireReader& in, const Expected& expected) {
  const std::string bytes(message.data);
  const ImageCheck check = check_image(bytes);
  if (!check.header) in.fail("is no whole PNG or JPEG picture: " + check.problem);
  check_size(in, {check.header->width, check.header->height}, expected.size);
  cv::Mat pixels = decode_unchanged(bytes);
  if (pixels.empty()) in.fail("has pixels that do not decode");
  if (pixels.type() == CV_16UC1) narrow(pixels, in, expected);
  if (pixels.depth() != CV_8U) in.fail("has more than 8 bits a channel");
  cv::Mat plain = pixels;
  if (pixels.channels() == 4) cv::cvtColor(pixels, plain, cv::COLOR_BGRA2BGR);
  return plain;
}

cv::Mat plain(const ImageMessage& message, const WireReader& in, const Expected& expected) {
  const auto* encoding = std::ranges::find(kEncodings, message.encoding, &Encoding::name);
  check_size(in, {message.width, message.height}, expected.size);
  const auto row = static_cast<std::size_t>(message.width) * CV_ELEM_SIZE(encoding->type);
  if (message.width == 0 || message.height == 0 || message.step < row) {
    in.fail("has rows that are shorter than its width");
  }
  if (message.step % static_cast<std::size_t>(CV_ELEM_SIZE1(encoding->type)) != 0) {
    in.fail("has rows of an odd number of bytes");
  }
  // OpenCV has no view of constant memory; nothing writes to it before it is copied.
  const cv::Mat view(message.height, message.width, encoding->type,
                     const_cast<char*>(message.data.data()), message.step);
  cv::Mat pixels;
  if (encoding->to_bgr == kAsItIs) {
    pixels = view.clone();
    if (pixels.type() == CV_16UC1) narrow(pixels, in, expected);
  } else {
    cv::cvtColor(view, pixels, encoding->to_bgr);
  }
  return pixels;
}

cv::Mat picture_of(const Recording& recording, std::size_t topic, std::size_t index,
                   const Expected& expected) {
  const std::string bytes = recording.message(topic, index);
  auto in = recording.reader(topic, index, bytes);
  const ImageMessage message =
      read_image(in, recording.topics()[topic].type == ImageMessage::kCompressedType);
  const std::string why_not = no_picture(message);
  if (!why_not.empty()) {
    in.fail(why_not +
            "; known are mono8, mono16, 8UC1, bgr8, 8UC3, rgb8, bgra8, rgba8, and PNG and JPEG of "
            "them");
  }
  return message.compressed ? decoded(message, in, expected) : plain(message, in, expected);
}

}  // namespace

std::string no_picture(const ImageMessage& message) {
  // "bayer_rggb8; jpeg compressed "
  const std::string encoding = message.encoding.substr(0, message.encoding.find(';'));
  const std::string named = "is encoded as '" + printable(message.encoding) + "'";
  if (encoding.starts_with("bayer_")) return named + ", the mosaic of a colour camera";
  if (encoding == "16UC1" || encoding == "32FC1" ||
      message.encoding.find("compressedDepth") != std::string::npos) {
    return named + ", which is depth";
  }
  if (encoding.ends_with("16") && encoding != "mono16") return named + ", which has 16 bits";
  if (message.compressed) return is_image(message.data) ? "" : named;
  const bool is_known =
      std::ranges::find(kEncodings, message.encoding, &Encoding::name) != std::end(kEncodings);
  return is_known ? "" : named;
}

std::vector<std::size_t> picture_topics(const Recording& recording) {
  std::vector<std::size_t> found;
  for (const auto type : {ImageMessage::kType, ImageMessage::kCompressedType}) {
    std::ranges::copy(recording.of_type(type), std::back_inserter(found));
  }
  std::ranges::sort(found);
  return found;
}

std::string no_pictures(const Recording& recording, std::size_t topic) {
  const bool is_compressed = recording.topics()[topic].type == ImageMessage::kCompressedType;
  std::string why_not;
  try {
    return first_message(recording, topic, [&](WireReader& in) {
      why_not = no_picture(read_image(in, is_compressed));
      // A stream may begin within a picture.
      if (is_compressed && why_not.ends_with('\'')) in.fail(why_not);  // no mosaic, no depth
      return why_not;
    });
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kBadInput) throw;
    return why_not.empty() ? std::string("cannot be read: ") + error.what() : why_not;
  }
}

std::size_t picture_topic(const Recording& recording, const std::string& name) {
  // Where there is none of that name, that is said.
  if (!name.empty()) static_cast<void>(recording.topic(name));
  std::string why_not;
  for (const std::size_t each : picture_topics(recording)) {
    const std::string& topic = recording.topics()[each].name;
    if (!name.empty() && topic != name) continue;
    const std::string problem = no_pictures(recording, each);
    if (problem.empty()) return each;
    why_not += "; " + topic + " " + problem;
  }
  throw_bad_input("'" + recording.file() + "' has no pictures" +
                  (name.empty() ? "" : " on " + name) +
                  ": no topic of sensor_msgs/Image or CompressedImage" +
                  (why_not.empty() ? "; it has " + recording.describe() : why_not) +
                  "; choose one: --topics left=TOPIC");
}

cv::Mat recorded_picture(const Recording& recording, std::size_t topic, std::size_t index,
                         std::atomic<bool>* is_deep) {
  return picture_of(recording, topic, index, {.is_deep = is_deep});
}

GreyImage recorded_grey(const Recording& recording, std::size_t topic, std::size_t index, int width,
                        int height, std::atomic<bool>* is_deep) {
  cv::Mat pixels = picture_of(recording, topic, index, {Size{width, height}, is_deep});
  if (pixels.channels() == 3) {
    cv::Mat grey;
    cv::cvtColor(pixels, grey, cv::COLOR_BGR2GRAY);
    pixels = grey;
  }
  return grey_of(pixels);
}

}  // namespace pirt
