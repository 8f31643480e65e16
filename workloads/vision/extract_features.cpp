// extract_features: the spec, the reference that defines it, and the comparison of features.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "workloads/base/math/pixel_index.h"
#include "workloads/vision/features.h"
#include "workloads/vision/image_data.h"

namespace pirt::vision {
namespace {

using slam::FastCorner;
using slam::kFeatureRim;

constexpr std::int64_t kBytes = 32;  // of a descriptor

std::vector<TensorSpec> feature_specs(Element element) {
  return {{"pixels", element, {ExtractFeatures::kMost, 2}, true},
          {"scores", element, {ExtractFeatures::kMost}, true},
          {"descriptors", Element::kU8, {ExtractFeatures::kMost, kBytes}, true}};
}

/// A picture of integers; only what lies within is asked for.
struct Grid {
  int width = 0, height = 0;
  std::vector<int> values;
  [[nodiscard]] int at(int x, int y) const { return values[pixel_index(x, y, width)]; }
};

/// By how much the arc of 9 of the 16 pixels around (x, y) that differs most, brighter or darker,
/// does so at least.
int arc_contrast(const Grid& image, int x, int y) {
  constexpr std::size_t kArc = 9;
  int most = 0;
  for (std::size_t first = 0; first < slam::kFastCircle.size(); ++first) {
    int brighter = 255;
    int darker = 255;
    for (std::size_t i = 0; i < kArc; ++i) {
      const auto [dx, dy] = slam::kFastCircle[(first + i) % slam::kFastCircle.size()];
      const int difference = image.at(x + dx, y + dy) - image.at(x, y);
      brighter = std::min(brighter, difference);
      darker = std::min(darker, -difference);
    }
    most = std::max({most, brighter, darker});
  }
  return most;
}

float score_at(const Grid& image, int x, int y) {
  int xx = 0;
  int xy = 0;
  int yy = 0;
  for (int j = y - slam::kFeatureScoreHalf; j <= y + slam::kFeatureScoreHalf; ++j) {
    for (int i = x - slam::kFeatureScoreHalf; i <= x + slam::kFeatureScoreHalf; ++i) {
      const int gx = image.at(i + 1, j) - image.at(i - 1, j);
      const int gy = image.at(i, j + 1) - image.at(i, j - 1);
      xx += gx * gx;
      xy += gx * gy;
      yy += gy * gy;
    }
  }
  return slam::corner_score(xx, xy, yy);
}

/// FAST's corners that contrast more than each of their neighbours.
std::vector<FastCorner> corners_of(const Grid& image) {
  Grid contrast{image.width, image.height, std::vector<int>(image.values.size(), 0)};
  for (int y = 3; y < image.height - 3; ++y) {
    for (int x = 3; x < image.width - 3; ++x) {
      const int most = arc_contrast(image, x, y);
      if (most <= ExtractFeatures::kThreshold) continue;
      contrast.values[pixel_index(x, y, image.width)] = most;
    }
  }
  std::vector<FastCorner> corners;
  for (int y = kFeatureRim; y < image.height - kFeatureRim; ++y) {
    for (int x = kFeatureRim; x < image.width - kFeatureRim; ++x) {
      const int here = contrast.at(x, y);
      bool largest = here > 0;
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) {
          largest = largest && ((i == 0 && j == 0) || here > contrast.at(x + i, y + j));
        }
      }
      if (largest) corners.push_back({x, y, score_at(image, x, y)});
    }
  }
  return corners;
}

/// Where the gradients' energy around a corner has its centre.
std::pair<double, double> refined(const Grid& image, const FastCorner& corner) {
  double centre_x = corner.x;
  double centre_y = corner.y;
  for (int step = 0; step < slam::kFeatureRefineSteps; ++step) {
    const int cx = static_cast<int>(std::lround(centre_x));
    const int cy = static_cast<int>(std::lround(centre_y));
    double weight = 0;
    double sum_x = 0;
    double sum_y = 0;
    for (int dy = -slam::kFeatureWindowHalf; dy <= slam::kFeatureWindowHalf; ++dy) {
      for (int dx = -slam::kFeatureWindowHalf; dx <= slam::kFeatureWindowHalf; ++dx) {
        const int gx = image.at(cx + dx + 1, cy + dy) - image.at(cx + dx - 1, cy + dy);
        const int gy = image.at(cx + dx, cy + dy + 1) - image.at(cx + dx, cy + dy - 1);
        const double energy = gx * gx + gy * gy;
        weight += energy;
        sum_x += energy * dx;
        sum_y += energy * dy;
      }
    }
    if (weight == 0) break;
    const double x = cx + sum_x / weight;
    const double y = cy + sum_y / weight;
    if (std::hypot(x - corner.x, y - corner.y) > static_cast<double>(slam::kFeatureFarthest)) break;
    centre_x = x;
    centre_y = y;
  }
  return {centre_x, centre_y};
}

int blurred_at(const Grid& image, int x, int y) {
  int sum = 0;
  for (int j = 0; j < 7; ++j) {
    for (int i = 0; i < 7; ++i) {
      sum += slam::kFeatureBlur[static_cast<std::size_t>(j)] *
             slam::kFeatureBlur[static_cast<std::size_t>(i)] * image.at(x + i - 3, y + j - 3);
    }
  }
  return (sum + (1 << 15)) >> 16;
}

std::vector<Tensor> reference(const ExtractFeatures& op, const Data& data) {
  const auto pixels = data.inputs[0].as<std::uint8_t>();
  const Grid image{op.width, op.height, {pixels.begin(), pixels.end()}};
  std::vector<FastCorner> best;
  if (op.width > 2 * kFeatureRim && op.height > 2 * kFeatureRim) {
    best = slam::best_corners(corners_of(image), op.width, op.height,
                              {.most = ExtractFeatures::kMost,
                               .cell = ExtractFeatures::kCell,
                               .threshold = ExtractFeatures::kThreshold});
  }
  auto outputs = make_tensors(feature_specs(Element::kF64));
  for (Tensor& output : outputs) output.set_rows(std::ssize(best));
  const auto pattern = slam::descriptor_pattern();
  for (std::size_t i = 0; i < best.size(); ++i) {
    const FastCorner& corner = best[i];
    const auto [x, y] = refined(image, corner);
    outputs[0].as<double>()[2 * i] = x;
    outputs[0].as<double>()[2 * i + 1] = y;
    outputs[1].as<double>()[i] = static_cast<double>(corner.score);
    const auto bits = outputs[2].as<std::uint8_t>().subspan(kBytes * i, kBytes);
    for (std::size_t k = 0; k < pattern.size(); ++k) {
      const auto& [ax, ay, bx, by] = pattern[k];
      if (blurred_at(image, corner.x + ax, corner.y + ay) <
          blurred_at(image, corner.x + bx, corner.y + by)) {
        bits[k / 8] = static_cast<std::uint8_t>(bits[k / 8] | (1U << (k % 8)));
      }
    }
  }
  return outputs;
}

/// As many, of the same scores (relative 1e-5) and bits, and within 0.01 pixels. What decides is
/// integers or, for the order, f32 in one way; the centres' f32 divisions err by 1e-7 of 640.
/// Observed on both backends: at most 4e-5 pixels.
Verdict verify_features(std::span<const Tensor> outputs, std::span<const Tensor> expected) {
  constexpr double kBoundPixels = 0.01;
  constexpr double kBoundScore = 1e-5;
  const auto fail = [](std::string why) {
    return Verdict{false, std::numeric_limits<double>::infinity(), "features: " + std::move(why)};
  };
  const auto specs = feature_specs(Element::kF32);
  const bool as_specified = outputs.size() == specs.size() && expected.size() == specs.size() &&
                            std::ranges::equal(outputs, specs, {}, &Tensor::spec);
  if (!as_specified) return fail("f32 pixels and scores and u8 descriptors are expected");
  const std::int64_t count = expected[0].rows();
  for (const Tensor& output : outputs) {
    if (output.rows() != count) {
      return fail(fmt::format("{} rows of {} where {} are expected", output.rows(),
                              output.spec().name, count));
    }
  }
  std::int64_t differing = 0;
  double worst = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const double off =
        std::hypot(outputs[0].as<float>()[2 * i] - expected[0].as<double>()[2 * i],
                   outputs[0].as<float>()[2 * i + 1] - expected[0].as<double>()[2 * i + 1]);
    const double score = outputs[1].as<float>()[i];
    const double wanted = expected[1].as<double>()[i];
    if (!std::isfinite(off) || !std::isfinite(score)) {
      return fail(fmt::format("feature {} is not finite", i));
    }
    const bool same =
        off <= kBoundPixels && std::abs(score - wanted) <= kBoundScore * wanted &&
        std::ranges::equal(outputs[2].as<std::uint8_t>().subspan(kBytes * i, kBytes),
                           expected[2].as<std::uint8_t>().subspan(kBytes * i, kBytes));
    if (same) worst = std::max(worst, off);
    differing += same ? 0 : 1;
  }
  return {differing == 0, differing == 0 ? worst : static_cast<double>(differing),
          fmt::format("features: {} of {} are not the reference's; the others are off by at most "
                      "{:.2g} pixels, bound {}",
                      differing, count, worst, kBoundPixels)};
}

}  // namespace

Workload make_extract_features(int width, int height) {
  auto op = std::make_shared<ExtractFeatures>();
  op->width = width;
  op->height = height;

  Workload w;
  w.name = "extract_features";
  w.description =
      "at most 400 FAST corners with 256-bit descriptors, 8-bit grey " + size_text(width, height);
  w.tags = {"vision", "image", "slam"};
  w.kernel = "extract_features";
  w.operation = op;
  w.inputs = {gray_spec("image", width, height)};
  w.outputs = feature_specs(Element::kF32);
  w.make_data = [=](const DataRequest& request) { return gray_data(request, width, height); };
  w.reference = [op](const Data& data) { return reference(*op, data); };
  w.verify = verify_features;
  return w;
}

}  // namespace pirt::vision
