#include "workloads/recognition/detect_objects.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt::recognition {
namespace {

/// Boxes of different classes that share more than this part of their union are one thing, of
/// which the model is not sure what it is.
constexpr double kSameThing = 0.8;

/// How an output's rows lie in memory and what their numbers mean.
struct Layout {
  std::size_t rows = 0;
  std::size_t classes = 0;
  std::size_t row_stride = 0;
  std::size_t value_stride = 1;
  bool objectness = true;        ///< Number 4 is one; the scores come after it.
  bool multiplied = false;       ///< The scores have the objectness in them already.
  double width = 1, height = 1;  ///< What the box is in parts of.
};

std::string shape_text(const NetworkOutput& output) {
  std::vector<std::string> parts;
  for (const auto extent : output.shape) parts.push_back(std::to_string(extent));
  return "[" + join(parts, ", ") + "]";
}

[[noreturn]] void throw_no_detector(const Model& model, const NetworkOutput& output) {
  throw_bad_input(
      fmt::format("the model '{}' is no detector that is known here: an output has the shape {}",
                  model.file(), shape_text(output)));
}

bool is_ssd(const NetworkOutput& output) {
  return output.shape.size() == 4 && output.shape[0] == 1 && output.shape[1] == 1 &&
         output.shape[3] == 7;
}

Layout yolo_layout(const Model& model, const NetworkOutput& output) {
  const auto& shape = output.shape;
  const auto extent = [&](std::size_t axis) { return static_cast<std::size_t>(shape[axis]); };
  Layout layout;
  if (shape.size() == 2 && model.format() == ModelFormat::kDarknet && shape[1] > 5) {
    layout = {extent(0), extent(1) - 5, extent(1)};
    layout.multiplied = true;
    return layout;
  }
  if (shape.size() != 3 || shape[0] != 1) throw_no_detector(model, output);
  if (shape[1] >= shape[2] && shape[2] > 5) {
    layout = {extent(1), extent(2) - 5, extent(2)};
  } else if (shape[1] < shape[2] && shape[1] > 4) {
    layout = {extent(2), extent(1) - 4, 1, extent(2)};
    layout.objectness = false;
  } else {
    throw_no_detector(model, output);
  }
  layout.width = model.width();
  layout.height = model.height();
  return layout;
}

void append_yolo(const Model& model, const NetworkOutput& output, double least,
                 std::vector<Candidate>& candidates) {
  const Layout layout = yolo_layout(model, output);
  model.check_classes(layout.classes);
  for (std::size_t row = 0; row < layout.rows; ++row) {
    const auto value = [&](std::size_t i) {
      return double{output.values[row * layout.row_stride + i * layout.value_stride]};
    };
    const std::size_t first = layout.objectness ? 5 : 4;
    Candidate best;
    for (std::size_t i = 0; i < layout.classes; ++i) {
      if (value(first + i) > best.score) best.index = i, best.score = value(first + i);
    }
    if (layout.objectness && !layout.multiplied) best.score *= value(4);
    if (!(best.score >= least)) continue;
    const double half_width = value(2) / layout.width / 2;
    const double half_height = value(3) / layout.height / 2;
    best.left = value(0) / layout.width - half_width;
    best.right = value(0) / layout.width + half_width;
    best.top = value(1) / layout.height - half_height;
    best.bottom = value(1) / layout.height + half_height;
    candidates.push_back(best);
  }
}

/// Rows of image, class, score, left, top, right, bottom.
void append_ssd(const NetworkOutput& output, double least, std::vector<Candidate>& candidates) {
  for (std::size_t row = 0; row + 7 <= output.values.size(); row += 7) {
    const auto value = std::span(output.values).subspan(row, 7);
    if (!(value[2] >= least) || !(value[1] >= 0)) continue;
    candidates.push_back(
        {static_cast<std::size_t>(value[1]), value[2], value[3], value[4], value[5], value[6]});
  }
}

double area(const Candidate& box) {
  return std::max(0.0, box.right - box.left) * std::max(0.0, box.bottom - box.top);
}

double overlap(const Candidate& a, const Candidate& b) {
  const Candidate both{0,
                       0,
                       std::max(a.left, b.left),
                       std::max(a.top, b.top),
                       std::min(a.right, b.right),
                       std::min(a.bottom, b.bottom)};
  const double shared = area(both);
  return shared / (area(a) + area(b) - shared);
}

/// The part of it that is inside the picture.
void clip(Candidate& box) {
  for (double* edge : {&box.left, &box.top, &box.right, &box.bottom}) {
    *edge = std::clamp(*edge, 0.0, 1.0);
  }
}

bool is_box(const Candidate& box) {
  return std::isfinite(box.left) && std::isfinite(box.top) && box.right > box.left &&
         box.bottom > box.top && std::isfinite(box.right) && std::isfinite(box.bottom);
}

}  // namespace

std::vector<Candidate> suppress_overlaps(std::vector<Candidate> candidates,
                                         const DetectOptions& options) {
  std::erase_if(candidates, [](const Candidate& box) { return !is_box(box); });
  std::ranges::for_each(candidates, clip);
  std::erase_if(candidates, [](const Candidate& box) { return !(area(box) > 0); });
  std::ranges::stable_sort(candidates, [](const Candidate& a, const Candidate& b) {
    return a.score != b.score ? a.score > b.score : a.index < b.index;
  });
  std::vector<Candidate> kept;
  for (const auto& box : candidates) {
    const bool seen = std::ranges::any_of(kept, [&](const Candidate& other) {
      const double most = other.index == box.index ? options.most_overlap : kSameThing;
      return overlap(other, box) > most;
    });
    if (!seen) kept.push_back(box);
  }
  return kept;
}

std::vector<Detection> detect_objects(Model& detector, const Tensor& image,
                                      const DetectOptions& options) {
  std::vector<Candidate> candidates;
  for (const auto& output : detector.run(image, Fit::kStretch)) {
    if (is_ssd(output)) {
      append_ssd(output, options.least_score, candidates);
    } else {
      append_yolo(detector, output, options.least_score, candidates);
    }
  }
  const auto height = static_cast<double>(image.dim(1));
  const auto width = static_cast<double>(image.dim(2));
  std::vector<Detection> detections;
  for (const auto& box : suppress_overlaps(std::move(candidates), options)) {
    detections.push_back({box.index,
                          detector.name_of(box.index),
                          box.score,
                          {box.left * width, box.top * height, (box.right - box.left) * width,
                           (box.bottom - box.top) * height}});
  }
  return detections;
}

}  // namespace pirt::recognition
