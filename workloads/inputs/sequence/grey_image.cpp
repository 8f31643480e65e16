// Grey pictures of a recorded camera, decoded as they are.
#include <fmt/core.h>

#include <opencv2/imgproc.hpp>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/inputs/pictures/decoder.h"
#include "workloads/inputs/pictures/image_format.h"
#include "workloads/inputs/sequence/sequence.h"

namespace pirt {
namespace {

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& why) {
  throw_bad_input(
      fmt::format("cannot use the picture '{}': {}; replace it, or take its row out of "
                  "data.csv",
                  file.string(), why));
}

}  // namespace

GreyImage read_grey_image(const std::filesystem::path& file, int width, int height,
                          std::atomic<bool>* is_deep) {
  const std::string bytes = read_file(file);
  const ImageCheck check = check_image(bytes);
  if (!check.header) refuse(file, check.problem);
  if (check.header->width != width || check.header->height != height) {
    refuse(file, fmt::format("it has {}x{} pixels, its camera's calibration says {}x{}",
                             check.header->width, check.header->height, width, height));
  }
  cv::Mat pixels = decode_unchanged(bytes);
  if (pixels.empty()) refuse(file, "its pixels do not decode");
  if (pixels.type() == CV_8UC3) cv::cvtColor(pixels, pixels, cv::COLOR_BGR2GRAY);
  if (pixels.type() == CV_8UC4) cv::cvtColor(pixels, pixels, cv::COLOR_BGRA2GRAY);
  if (pixels.type() == CV_16UC1) {
    const std::string why_not = take_upper_bits(pixels, is_deep);
    if (!why_not.empty()) refuse(file, why_not);
  }
  if (pixels.type() != CV_8UC1) {
    refuse(file, fmt::format("it has {} channels of {} bits, expected 8, or grey of 16",
                             pixels.channels(), 8 * pixels.elemSize1()));
  }
  return grey_of(pixels);
}

}  // namespace pirt
