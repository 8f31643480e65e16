// The module libpirt_pictures.so: OpenCV's codecs. See decoder.h.
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "workloads/base/system/stderr_capture.h"
#include "workloads/inputs/pictures/decoder.h"

namespace pirt {
extern "C" void pirt_decode_picture(const std::string& bytes, DecodedPicture& picture) {
  try {
    // There is no way to set the codecs' handlers.
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
    cv::imencode(".png", image, encoded);  // as OpenCV does it reads the quickest, too
    bytes.assign(encoded.begin(), encoded.end());
  } catch (const cv::Exception&) {
    bytes.clear();
  }
}

}  // namespace pirt
