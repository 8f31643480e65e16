#include "workloads/inputs/pictures/decoder.h"

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

std::string encode_png(const cv::Mat& image) {
  static auto* const encode = load<EncodePngFunction>(kEncodePngName);
  std::string bytes;
  encode(image, bytes);
  if (bytes.empty()) throw_environment("OpenCV cannot write a PNG picture here");
  return bytes;
}

}  // namespace pirt
