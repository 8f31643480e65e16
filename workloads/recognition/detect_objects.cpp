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

/// From parts of the network's input to parts of the picture that lies in it.
void to_picture(const Model& detector, const Placement& inner, Candidate& box) {
  for (double* edge : {&box.left, &box.right}) {
    *edge = (*edge * detector.width() - inner.x) / inner.width;
  }
  for (double* edge : {&box.top, &box.bottom}) {
    *edge = (*edge * detector.height() - inner.y) / inner.height;
  }
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
  const DetectorFacts facts{.file = detector.file(),
                            .format = detector.format(),
                            .width = detector.width(),
                            .height = detector.height(),
                            .names = detector.names().size()};
  std::vector<Candidate> candidates;
  for (const auto& output : detector.run(image, detector.fit())) {
    const auto found = candidates_of(facts, output, options.least_score);
    candidates.insert(candidates.end(), found.begin(), found.end());
  }
  if (detector.fit() == Fit::kLetterbox) {
    const auto inner = letterbox(static_cast<int>(image.dim(2)), static_cast<int>(image.dim(1)),
                                 detector.width(), detector.height());
    for (Candidate& box : candidates) to_picture(detector, inner, box);
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
