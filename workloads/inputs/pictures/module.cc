// The module libpirt_pictures.so: OpenCV's codecs, and libjpeg for what OpenCV does not say of a
// JPEG. See decoder.h.
#include <csetjmp>
#include <opencv2/imgcodecs.hpp>
#include <vector>

// Each needs those above it.
// clang-format off
#include <cstdio>
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include "workloads/base/system/stderr_capture.h"
#include "workloads/inputs/pictures/decoder.h"

namespace pirt {
namespace {

/// A JPEG while it is decoded.
struct Jpeg {
  Jpeg() {
    info.err = jpeg_std_error(&errors);
    info.client_data = this;
    errors.error_exit = leave;
    errors.emit_message = take_warning;
  }
  Jpeg(const Jpeg&) = delete;
  Jpeg& operator=(const Jpeg&) = delete;
  ~Jpeg() { jpeg_destroy_decompress(&info); }

  [[noreturn]] static void leave(j_common_ptr of) {
    std::longjmp(static_cast<Jpeg*>(of->client_data)->failed, 1);
  }
  /// Damage is painted over, and no more than warned of. Some cameras pad their pictures, which is
  /// none.
  static void take_warning(j_common_ptr of, int level) {
    constexpr int kPadding = 16, kEnd = 0xd9;
    if (level >= 0) return;
    const int code = of->err->msg_code;
    const auto& about = of->err->msg_parm.i;
    const bool is_padded = code == JWRN_EXTRANEOUS_DATA && about[0] <= kPadding && about[1] == kEnd;
    if (code == JWRN_HIT_MARKER || code == JWRN_HUFF_BAD_CODE || code == JWRN_ARITH_BAD_CODE ||
        code == JWRN_JPEG_EOF || code == JWRN_MUST_RESYNC ||
        (code == JWRN_EXTRANEOUS_DATA && !is_padded)) {
      leave(of);
    }
  }

  jpeg_decompress_struct info{};
  jpeg_error_mgr errors{};
  std::jmp_buf failed{};
};

/// @return  False for four channels, which are left to OpenCV once they are known to be whole.
bool read_jpeg(jpeg_decompress_struct& info, const std::string& bytes, cv::Mat& pixels) {
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&info, TRUE);
  const int channels = info.num_components;
  info.out_color_space = channels == 1 ? JCS_GRAYSCALE : channels == 4 ? JCS_CMYK : JCS_EXT_BGR;
  jpeg_start_decompress(&info);
  pixels.create(static_cast<int>(info.output_height), static_cast<int>(info.output_width),
                CV_8UC(info.output_components));
  while (info.output_scanline < info.output_height) {
    unsigned char* row = pixels.ptr(static_cast<int>(info.output_scanline));
    jpeg_read_scanlines(&info, &row, 1);
  }
  jpeg_finish_decompress(&info);
  return channels != 4;
}

/// Grey, or B, G, R, as OpenCV has them; empty if it is damaged.
/// @return  False if it is no JPEG that is read here.
bool decode_jpeg(const std::string& bytes, cv::Mat& pixels) {
  if (!bytes.starts_with("\xff\xd8")) return false;
  Jpeg jpeg;
  if (setjmp(jpeg.failed) == 0) return read_jpeg(jpeg.info, bytes, pixels);
  pixels.release();
  return true;
}

}  // namespace

extern "C" void pirt_decode_picture(const std::string& bytes, DecodedPicture& picture) {
  try {
    cv::Mat unturned;
    if (decode_jpeg(bytes, unturned) && unturned.empty()) return;
    // There is no way to set the codecs' handlers.
    const StderrCapture capture;
    // OpenCV has no view of constant memory; imdecode only reads.
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U,
                          const_cast<char*>(bytes.data()));
    picture.pixels = cv::imdecode(encoded, cv::IMREAD_COLOR);
  } catch (const cv::Exception& error) {
    picture.error = error.err;
  }
}

extern "C" void pirt_decode_unchanged(const std::string& bytes, cv::Mat& pixels) {
  try {
    if (decode_jpeg(bytes, pixels)) return;
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
