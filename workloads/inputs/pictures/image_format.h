// Whether bytes are a whole PNG or JPEG file, found out before a decoder sees them: decoders fill
// in what is missing without an error and allocate whatever size a header names.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace pirt {

enum class ImageFormat : std::uint8_t { kPng, kJpeg };

struct ImageHeader {
  ImageFormat format = ImageFormat::kPng;
  std::int64_t width = 0;   ///< Pixels.
  std::int64_t height = 0;  ///< Pixels.
  int bits = 8;             ///< A channel; of a palette, its index.
  /// Of a grey PNG the value, at 8 bits, of pixels that are transparent: decoders drop it.
  std::optional<int> transparent_grey = {};
};

/// More than any camera of a robot has; a header that asks for more is taken for damage before
/// memory is.
inline constexpr std::int64_t kMostPixels = 100'000'000;

struct ImageCheck {
  std::optional<ImageHeader> header;  ///< Present if the file is whole.
  std::string problem;  ///< Otherwise what is wrong, e.g. "it ends within its pixel data".
};

/// Walks the file's structure: PNG chunks with their checksums from IHDR to IEND; JPEG segments
/// from SOI to EOI. Does not decode pixels; more than kMostPixels are a problem, too.
/// @source  PNG (Third Edition), W3C 2025, sections 5 and D; ITU-T T.81, annex B.
[[nodiscard]] ImageCheck check_image(std::string_view bytes);
/// Whether it begins as one of them.
[[nodiscard]] bool is_image(std::string_view bytes);

}  // namespace pirt
