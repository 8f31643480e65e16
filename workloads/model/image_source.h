// Where the pictures that workloads compute on come from: an interface, since a workload is the
// same whoever took them (inputs/pictures/).
#pragma once

#include <cstdint>
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

}  // namespace pirt
