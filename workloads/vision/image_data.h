// What the vision workloads share: picture tensors, their data, and the border rules of the
// references.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "workloads/vision/vision.h"

namespace pirt::vision {

/// u8 [height, width].
[[nodiscard]] TensorSpec gray_spec(std::string name, int width, int height);

/// "corners" [<=500,2]: a list of x and y in pixels.
[[nodiscard]] TensorSpec corners_spec(Element element);

/// "640x480"
[[nodiscard]] std::string size_text(int width, int height);

/// A list of one tensor (tensors do not copy, so that an initializer list cannot hold them).
[[nodiscard]] std::vector<Tensor> only(Tensor tensor);

/// Data of one grey picture named "image".
[[nodiscard]] Data gray_data(const DataRequest& request, int width, int height);
/// The same of the request's frame of a sequence.
[[nodiscard]] Data gray_frame_data(const DataRequest& request, int width, int height);
/// Data of that frame and the next, "previous" and "next".
[[nodiscard]] Data gray_pair_data(const DataRequest& request, int width, int height);

/// The notes of both, each once.
[[nodiscard]] std::vector<std::string> merge_notes(std::vector<std::string> notes,
                                                   const std::vector<std::string>& more);

/// Position on a line of @p length pixels that @p p means when the border is mirrored without
/// repeating the edge pixel: gfedcb|abcdefgh|gfedcba. A line of one pixel is constant, as in
/// OpenCV's borderInterpolate.
[[nodiscard]] int reflect101(int p, int length);
/// The same when the edge pixel is repeated: aaaaaa|abcdefgh|hhhhhhh.
[[nodiscard]] int replicate(int p, int length);

/// A picture as integers with a border around it, so that loops over windows need no conditions.
class Padded {
 public:
  /// @param border  reflect101 or replicate.
  Padded(std::span<const std::uint8_t> pixels, int width, int height, int radius,
         int (*border)(int, int));

  /// Row @p y (from -radius to height - 1 + radius), pointing at column 0; columns -radius .. width
  /// - 1 + radius may be read.
  [[nodiscard]] const int* row(int y) const {
    return &pixels_[static_cast<std::size_t>(y + radius_) * stride_ +
                    static_cast<std::size_t>(radius_)];
  }

 private:
  int radius_;
  std::size_t stride_;
  std::vector<int> pixels_;
};

/// Horizontal and vertical 3x3 Sobel gradient, row-major [height, width], border reflect-101.
struct Gradients {
  std::vector<int> gx, gy;
};
[[nodiscard]] Gradients sobel_gradients(std::span<const std::uint8_t> pixels, int width,
                                        int height);

}  // namespace pirt::vision
