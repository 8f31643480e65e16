// Pictures for the workloads: generated textures by default, the user's own PNG and JPEG files on
// request.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "workloads/model/image_source.h"

namespace pirt {

/// More than this part of some pictures is not one bad picture any more.
inline constexpr double kMostBadPart = 0.05;

/// Textured pictures (several octaves of value noise, edges, corners) as a pure function of the
/// seed.
[[nodiscard]] std::unique_ptr<ImageSource> generated_images(std::uint64_t seed);

/// The PNG and JPEG files of a folder in name order. Hidden files (macOS leaves "._x.jpg") and
/// folders are no pictures.
/// @throws Error{kBadInput} if it cannot be read or has none.
[[nodiscard]] std::vector<std::filesystem::path> pictures_of(const std::filesystem::path& folder);

/// The picture as it is, neither scaled nor cropped: u8 [3, height, width], order R, G, B, and
/// @p alpha of a PNG as the fourth, 255 where it has none.
/// @throws Error{kBadInput} if it does not decode or has more than 8 bits a channel; the message
/// names the file.
[[nodiscard]] Tensor rgb_pixels(const std::filesystem::path& file, bool alpha = false);

/// The PNG and JPEG files of a folder in name order, or one such file. Other files in the folder
/// are ignored; each picture is scaled to cover the wished size, keeping its aspect, and
/// centre-cropped. Or the pictures of a recording, of which up to 5 % may be none and are left out;
/// of a folder that has both, without metadata.yaml and @p topic, the files.
/// @param topic  Of a recording; empty = the first by name whose messages are pictures.
/// @throws Error{kBadInput} for a missing or unreadable path, a folder without images, or an image
/// that does not decode;
///         the message names the file. Everything is checked here, before anything is measured.
[[nodiscard]] std::unique_ptr<ImageSource> images_from(const std::filesystem::path& path,
                                                       const std::string& topic = {});

}  // namespace pirt
