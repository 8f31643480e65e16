#include "workloads/inputs/pictures/decoder.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>

#include "workloads/base/error.h"
#include "workloads/base/system/module.h"

namespace pirt {
namespace {

template <typename Function>
Function* load(const char* name) {
  return reinterpret_cast<Function*>(
      module_symbol("libpirt_pictures.so", name,
                    "which reads and writes pictures (or use no files of pictures)"));
}

}  // namespace

DecodedPicture decode_picture(const std::string& bytes) {
  static auto* const decode = load<DecodePictureFunction>(kDecodePictureName);
  DecodedPicture picture;
  decode(bytes, picture);
  return picture;
}

cv::Mat decode_unchanged(const std::string& bytes) {
  static auto* const decode = load<DecodeUnchangedFunction>(kDecodeUnchangedName);
  cv::Mat pixels;
  decode(bytes, pixels);
  return pixels;
}

std::string take_upper_bits(cv::Mat& pixels, std::atomic<bool>* is_deep) {
  constexpr double kLeast = 1 << 12, kBlack = 16;
  double brightest = 0;
  cv::minMaxLoc(pixels, nullptr, &brightest);
  if (brightest >= kLeast && is_deep != nullptr) *is_deep = true;
  const bool is_known = is_deep != nullptr && *is_deep;
  if (brightest >= kBlack && brightest < kLeast && !is_known) {
    return fmt::format(
        "its brightest pixel has {:.0f} of 65535: these are not 16 bits; scale it to 8", brightest);
  }
  constexpr int kStep = 256;
  cv::Mat upper(pixels.size(), CV_8UC1);
  for (int y = 0; y < pixels.rows; ++y) {
    const auto* const from = pixels.ptr<std::uint16_t>(y);
    std::transform(from, from + pixels.cols, upper.ptr(y),
                   [](std::uint16_t value) { return static_cast<std::uint8_t>(value / kStep); });
  }
  pixels = upper;
  return "";
}

GreyImage grey_of(const cv::Mat& pixels) {
  GreyImage image{pixels.cols, pixels.rows, {}};
  image.pixels.resize(pixels.total());
  for (int y = 0; y < pixels.rows; ++y) {
    std::copy_n(pixels.ptr(y), pixels.cols, image.row(y));
  }
  return image;
}

std::string encode_png(const cv::Mat& image) {
  static auto* const encode = load<EncodePngFunction>(kEncodePngName);
  std::string bytes;
  encode(image, bytes);
  if (bytes.empty()) throw_environment("OpenCV cannot write a PNG picture here");
  return bytes;
}

}  // namespace pirt
