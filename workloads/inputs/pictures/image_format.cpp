#include "workloads/inputs/pictures/image_format.h"

#include <fmt/core.h>
#include <zlib.h>

#include <utility>

namespace pirt {
namespace {

constexpr std::string_view kPngSignature = "\x89PNG\r\n\x1a\n";
constexpr std::string_view kJpegSignature = "\xff\xd8\xff";

ImageCheck problem(std::string text) { return {std::nullopt, std::move(text)}; }

std::uint32_t big_endian(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) {
    value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  }
  return value;
}

std::uint32_t crc_of(std::string_view bytes) {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

/// A chunk is its length (4 bytes), type (4), data, and a checksum (4) of type and data.
ImageCheck check_png(std::string_view bytes) {
  ImageHeader header{ImageFormat::kPng, 0, 0, 8};
  bool pixels = false;
  std::size_t at = kPngSignature.size();
  while (true) {
    if (bytes.size() - at < 12) return problem("it is cut off: the end of the PNG is missing");
    const std::size_t length = big_endian(bytes, at, 4);
    if (bytes.size() - at - 12 < length) {
      return problem("it is cut off: the end of the PNG is missing");
    }
    const std::string_view type = bytes.substr(at + 4, 4);
    if (crc_of(bytes.substr(at + 4, 4 + length)) != big_endian(bytes, at + 8 + length, 4)) {
      return problem("it is corrupt: a PNG checksum is wrong");
    }
    const bool first = at == kPngSignature.size();
    if (first != (type == "IHDR") || (first && length != 13)) {
      return problem("it is corrupt: the PNG header is not where it belongs");
    }
    if (first) {
      header.width = big_endian(bytes, at + 8, 4);
      header.height = big_endian(bytes, at + 12, 4);
      header.bits = static_cast<int>(big_endian(bytes, at + 16, 1));
    }
    pixels = pixels || type == "IDAT";
    const bool is_grey = big_endian(bytes, kPngSignature.size() + 17, 1) == 0;
    if (type == "tRNS" && is_grey && length == 2 && header.bits <= 8) {
      const int white = (1 << header.bits) - 1;
      header.transparent_grey =
          (static_cast<int>(big_endian(bytes, at + 8, 2)) & white) * 255 / white;
    }
    at += 12 + length;
    if (type == "IEND") break;
  }
  if (!pixels) return problem("it is corrupt: the PNG has no pixels");
  return {header, ""};
}

/// End of the entropy-coded data that begins at @p at: the next marker that is neither a stuffed 0
/// nor a restart (D0 .. D7).
std::size_t end_of_scan(std::string_view bytes, std::size_t at) {
  for (at = bytes.find('\xff', at); at < bytes.size(); at = bytes.find('\xff', at + 1)) {
    if (at + 1 == bytes.size()) return bytes.size();
    const auto marker = static_cast<unsigned char>(bytes[at + 1]);
    if (marker != 0 && marker != 0xff && (marker < 0xd0 || marker > 0xd7)) return at;
  }
  return bytes.size();
}

bool is_start_of_frame(unsigned marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

/// A segment is FF, a marker, its length with these two bytes, and data; a scan's pixels follow its
/// segment.
ImageCheck check_jpeg(std::string_view bytes) {
  ImageHeader header{ImageFormat::kJpeg, 0, 0, 8};
  bool pixels = false;
  std::size_t at = 2;
  while (true) {
    if (at + 2 > bytes.size()) return problem("it is cut off: the end of the JPEG is missing");
    if (bytes[at] != '\xff') return problem("it is corrupt: a JPEG marker is missing");
    const auto marker = static_cast<unsigned char>(bytes[at + 1]);
    if (marker == 0xff) {  // a fill byte
      ++at;
      continue;
    }
    if (marker == 0xd9) break;
    if (at + 4 > bytes.size()) return problem("it is cut off: the end of the JPEG is missing");
    const std::size_t length = big_endian(bytes, at + 2, 2);
    if (length < 2) return problem("it is corrupt: a JPEG segment is too short");
    if (bytes.size() - at - 2 < length) {
      return problem("it is cut off: the end of the JPEG is missing");
    }
    if (is_start_of_frame(marker)) {
      if (length < 8) return problem("it is corrupt: the JPEG frame header is too short");
      header.bits = static_cast<int>(big_endian(bytes, at + 4, 1));
      header.height = big_endian(bytes, at + 5, 2);
      header.width = big_endian(bytes, at + 7, 2);
    }
    at += 2 + length;
    if (marker == 0xda) {
      pixels = true;
      at = end_of_scan(bytes, at);
    }
  }
  if (header.width == 0 || header.height == 0 || !pixels) {
    return problem("it is corrupt: the JPEG has no picture");
  }
  return {header, ""};
}

}  // namespace

bool is_image(std::string_view bytes) {
  return bytes.starts_with(kPngSignature) || bytes.starts_with(kJpegSignature);
}

ImageCheck check_image(std::string_view bytes) {
  if (bytes.empty()) return problem("it is empty");
  if (!is_image(bytes)) return problem("it is neither a PNG nor a JPEG file");
  ImageCheck check = bytes.starts_with(kPngSignature) ? check_png(bytes) : check_jpeg(bytes);
  if (!check.header) return check;
  const auto [width, height] = std::pair(check.header->width, check.header->height);
  if (width > kMostPixels || height > kMostPixels || width * height > kMostPixels) {
    return problem(
        fmt::format("{}x{} pixels are too many (the limit is {})", width, height, kMostPixels));
  }
  return check;
}

}  // namespace pirt
