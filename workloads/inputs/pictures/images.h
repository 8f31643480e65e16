// Pictures for the workloads: generated textures by default, the user's own PNG and JPEG files on
// request.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "workloads/model/tensor.h"

namespace pirt {

struct Picture {
  Tensor pixels;
  std::vector<std::string> notes;  ///< "input_resized", "input_cropped"; empty when used as it is.
};

/// Immutable after construction; any thread may call it.
class ImageSource {
 public:
  virtual ~ImageSource() = default;

  /// Picture number @p index (wraps around) as u8 [height, width].
  [[nodiscard]] virtual Picture gray(int index, int width, int height) const = 0;
  /// The same in colour, planar, as u8 [3, height, width], order R, G, B.
  [[nodiscard]] virtual Picture rgb(int index, int width, int height) const = 0;
  /// Frame number @p frame (from 0 on) of the sequence that begins with picture @p index, as gray()
  /// gives it: small steady motion from frame to frame where the source can give it.
  [[nodiscard]] virtual Picture gray_frame(int index, int frame, int width, int height) const = 0;
  /// The first two frames of a sequence.
  [[nodiscard]] std::pair<Picture, Picture> gray_pair(int index, int width, int height) const {
    return {gray_frame(index, 0, width, height), gray_frame(index, 1, width, height)};
  }
  /// One line for the database: "generated, seed 1" or "5 images of DIR".
  [[nodiscard]] virtual std::string describe() const = 0;
  /// Hash of what the pictures contain (file bytes, or generator and seed): part of a run's
  /// identity.
  [[nodiscard]] virtual std::uint64_t content_hash() const = 0;
};

/// Which picture of a source the data of @p seed take: seed 1 the first, so that who gives one
/// picture gets it.
[[nodiscard]] int picture_index(std::uint64_t seed);

/// Textured pictures (several octaves of value noise, edges, corners) as a pure function of the
/// seed.
[[nodiscard]] std::unique_ptr<ImageSource> generated_images(std::uint64_t seed);

/// The PNG and JPEG files of a folder in name order. Hidden files (macOS leaves "._x.jpg") and
/// folders are no pictures.
/// @throws Error{kBadInput} if it cannot be read or has none.
[[nodiscard]] std::vector<std::filesystem::path> pictures_of(const std::filesystem::path& folder);

/// The picture as it is, neither scaled nor cropped: u8 [3, height, width], order R, G, B.
/// @throws Error{kBadInput} if it does not decode or has more than 8 bits a channel; the message
/// names the file.
[[nodiscard]] Tensor rgb_pixels(const std::filesystem::path& file);

/// The PNG and JPEG files of a folder in name order, or one such file. Other files in the folder
/// are ignored; each picture is scaled to cover the wished size, keeping its aspect, and
/// centre-cropped.
/// @throws Error{kBadInput} for a missing or unreadable path, a folder without images, or an image
/// that does not decode;
///         the message names the file. Everything is checked here, before anything is measured.
[[nodiscard]] std::unique_ptr<ImageSource> images_from(const std::filesystem::path& path);

}  // namespace pirt
