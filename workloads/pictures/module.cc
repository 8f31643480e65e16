// The module libpirt_pictures.so: OpenCV's codecs. See decoder.h.
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "workloads/pictures/decoder.h"

namespace pirt {
namespace {

/// Takes what is written to the standard error stream while it lives: OpenCV gives no way to set
/// the codecs' handlers.
class StderrCapture {
 public:
  StderrCapture() : saved_(dup(STDERR_FILENO)), memory_(memfd_create("stderr", MFD_CLOEXEC)) {
    std::fflush(stderr);
    if (saved_ >= 0 && memory_ >= 0) dup2(memory_, STDERR_FILENO);
  }
  StderrCapture(const StderrCapture&) = delete;
  StderrCapture& operator=(const StderrCapture&) = delete;
  ~StderrCapture() {
    std::fflush(stderr);
    if (saved_ >= 0) dup2(saved_, STDERR_FILENO);
    if (saved_ >= 0) close(saved_);
    if (memory_ >= 0) close(memory_);
  }

  [[nodiscard]] std::string text() const {
    std::fflush(stderr);
    std::array<char, 4096> buffer{};
    const auto size = pread(memory_, buffer.data(), buffer.size(), 0);
    return size > 0 ? std::string(buffer.data(), static_cast<std::size_t>(size)) : "";
  }

 private:
  int saved_;
  int memory_;
};

}  // namespace

extern "C" void pirt_decode_picture(const std::string& bytes, DecodedPicture& picture) {
  try {
    const StderrCapture capture;
    // OpenCV has no view of constant memory; imdecode only reads.
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U,
                          const_cast<char*>(bytes.data()));
    picture.pixels = cv::imdecode(encoded, cv::IMREAD_COLOR);
    picture.warnings = capture.text();
  } catch (const cv::Exception& error) {
    picture.error = error.err;
  }
}

extern "C" void pirt_decode_unchanged(const std::string& bytes, cv::Mat& pixels) {
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U,
                          const_cast<char*>(bytes.data()));
    pixels = cv::imdecode(encoded, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    pixels.release();
  }
}

extern "C" void pirt_encode_png(const cv::Mat& image, std::string& bytes) {
  try {
    std::vector<unsigned char> encoded;
    cv::imencode(
        ".png", image, encoded,
        {cv::IMWRITE_PNG_COMPRESSION, 1, cv::IMWRITE_PNG_STRATEGY, cv::IMWRITE_PNG_STRATEGY_RLE});
    bytes.assign(encoded.begin(), encoded.end());
  } catch (const cv::Exception&) {
    bytes.clear();
  }
}

}  // namespace pirt
