#include "workloads/vision/image_data.h"

#include <algorithm>
#include <utility>

namespace pirt::vision {

TensorSpec gray_spec(std::string name, int width, int height) {
  return {std::move(name), Element::kU8, {height, width}};
}

TensorSpec corners_spec(Element element) {
  return {"corners", element, {FeatureDetect::kMaxCorners, 2}, true, {{-1e5, 1e5}}};
}

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

std::vector<Tensor> only(Tensor tensor) {
  std::vector<Tensor> list;
  list.push_back(std::move(tensor));
  return list;
}

std::vector<std::string> merge_notes(std::vector<std::string> notes,
                                     const std::vector<std::string>& more) {
  for (const auto& note : more) {
    if (std::ranges::find(notes, note) == notes.end()) notes.push_back(note);
  }
  return notes;
}

Data gray_data(const DataRequest& request, int width, int height) {
  Picture picture = request.images->gray(picture_index(request.seed), width, height);
  Data data;
  data.inputs.push_back(std::move(picture.pixels));
  data.notes = std::move(picture.notes);
  return data;
}

Data gray_frame_data(const DataRequest& request, int width, int height) {
  Picture picture =
      request.images->gray_frame(picture_index(request.seed), request.frame, width, height);
  Data data;
  data.inputs.push_back(std::move(picture.pixels));
  data.notes = std::move(picture.notes);
  return data;
}

Data gray_pair_data(const DataRequest& request, int width, int height) {
  const int index = picture_index(request.seed);
  Picture previous = request.images->gray_frame(index, request.frame, width, height);
  Picture next = request.images->gray_frame(index, request.frame + 1, width, height);
  Data data;
  data.notes = merge_notes(std::move(previous.notes), next.notes);
  data.inputs.push_back(std::move(previous.pixels));
  data.inputs.push_back(std::move(next.pixels));
  return data;
}

int reflect101(int p, int length) {
  if (length == 1) return 0;
  while (p < 0 || p >= length) p = p < 0 ? -p : 2 * (length - 1) - p;
  return p;
}

int replicate(int p, int length) { return std::clamp(p, 0, length - 1); }

Padded::Padded(std::span<const std::uint8_t> pixels, int width, int height, int radius,
               int (*border)(int, int))
    : radius_(radius), stride_(static_cast<std::size_t>(width + 2 * radius)) {
  pixels_.reserve(stride_ * static_cast<std::size_t>(height + 2 * radius));
  for (int y = -radius; y < height + radius; ++y) {
    const auto* line =
        &pixels[static_cast<std::size_t>(border(y, height)) * static_cast<std::size_t>(width)];
    for (int x = -radius; x < width + radius; ++x) pixels_.push_back(line[border(x, width)]);
  }
}

Gradients sobel_gradients(std::span<const std::uint8_t> pixels, int width, int height) {
  const Padded image(pixels, width, height, 1, reflect101);
  Gradients gradients;
  gradients.gx.reserve(pixels.size());
  gradients.gy.reserve(pixels.size());
  for (int y = 0; y < height; ++y) {
    const int* above = image.row(y - 1);
    const int* here = image.row(y);
    const int* below = image.row(y + 1);
    for (int x = 0; x < width; ++x) {
      gradients.gx.push_back((above[x + 1] - above[x - 1]) + 2 * (here[x + 1] - here[x - 1]) +
                             (below[x + 1] - below[x - 1]));
      gradients.gy.push_back((below[x - 1] - above[x - 1]) + 2 * (below[x] - above[x]) +
                             (below[x + 1] - above[x + 1]));
    }
  }
  return gradients;
}

}  // namespace pirt::vision
