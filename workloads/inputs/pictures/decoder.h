// Decoding PNG and JPEG, in a module of its own that is loaded with the first picture: OpenCV's
// codecs bring a hundred libraries, and each start of a process would pay 0.1 s for them.
#pragma once

#include <atomic>
#include <opencv2/core.hpp>
#include <string>

#include "workloads/model/grey_image.h"

namespace pirt {

struct DecodedPicture {
  cv::Mat pixels;     ///< B, G, R, 8 bits; empty if it does not decode, or a JPEG is damaged.
  std::string error;  ///< What OpenCV threw; empty = nothing.
};

/// Palettes, grey, 16 bits, alpha (dropped) and the EXIF orientation are OpenCV's work. What the
/// codecs write to the standard error stream is dropped: the process's other threads must be quiet
/// meanwhile, as they are before measuring.
/// @throws Error{kEnvironment} if the module is not there.
[[nodiscard]] DecodedPicture decode_picture(const std::string& bytes);

/// As it is, without conversion to colour or 8 bits; empty if it does not decode, or a JPEG is
/// damaged. Any number of threads may call it at once.
[[nodiscard]] cv::Mat decode_unchanged(const std::string& bytes);

/// Of grey pixels of 16 bits the upper 8.
/// @param is_deep  Of the camera: set by a picture that uses the upper bits, after which dark ones
///                 are taken, too. Null = each picture is judged for itself.
/// @return  Empty, or why that is no picture: it is of 12 bits or less in the lower ones. One that
/// is black is a picture.
[[nodiscard]] std::string take_upper_bits(cv::Mat& pixels, std::atomic<bool>* is_deep = nullptr);

/// A copy. @param pixels  CV_8UC1.
[[nodiscard]] GreyImage grey_of(const cv::Mat& pixels);

/// @param image  8 or 16 bits, grey or B, G, R.
/// @return       A PNG file, packed for speed rather than size.
/// @throws Error{kEnvironment} if it cannot be made.
[[nodiscard]] std::string encode_png(const cv::Mat& image);

/// What the module exports, with C linkage.
using DecodePictureFunction = void(const std::string& bytes, DecodedPicture& picture);
inline constexpr const char* kDecodePictureName = "pirt_decode_picture";
using DecodeUnchangedFunction = void(const std::string& bytes, cv::Mat& pixels);
inline constexpr const char* kDecodeUnchangedName = "pirt_decode_unchanged";
/// Leaves @p bytes empty if it cannot.
using EncodePngFunction = void(const cv::Mat& image, std::string& bytes);
inline constexpr const char* kEncodePngName = "pirt_encode_png";

}  // namespace pirt
