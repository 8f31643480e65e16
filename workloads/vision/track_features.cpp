// track_features: the spec, the reference that defines it, and the comparison of tracks.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "workloads/model/grey_image.h"
#include "workloads/vision/image_data.h"

namespace pirt::vision {
namespace {

using Op = TrackFeatures;

constexpr int kFrames = 4;
constexpr int kWindow = 2 * Op::kRadius + 1;
constexpr int kSamples = kWindow * kWindow;

struct Point {
  double x = 0;
  double y = 0;
};

/// Beyond the border it repeats itself.
double at(const GreyImage& picture, int x, int y) {
  return picture.row(replicate(y, picture.height))[replicate(x, picture.width)];
}

double at(const GreyImage& picture, Point p) {
  const int x = static_cast<int>(std::floor(p.x)), y = static_cast<int>(std::floor(p.y));
  const double a = p.x - x, b = p.y - y;
  return (1 - b) * ((1 - a) * at(picture, x, y) + a * at(picture, x + 1, y)) +
         b * ((1 - a) * at(picture, x, y + 1) + a * at(picture, x + 1, y + 1));
}

GreyImage next_level(const GreyImage& below, const Op::Level& size) {
  constexpr std::array<int, 5> kWeights = {1, 4, 6, 4, 1};
  const Padded image(below.pixels, below.width, below.height, 2, reflect101);
  GreyImage level{size.width, size.height, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      int sum = 0;
      for (int j = 0; j < 5; ++j) {
        for (int i = 0; i < 5; ++i) {
          sum += kWeights[static_cast<std::size_t>(j)] * kWeights[static_cast<std::size_t>(i)] *
                 image.row(2 * y + j - 2)[2 * x + i - 2];
        }
      }
      level.pixels.push_back(static_cast<std::uint8_t>((sum + 128) >> 8));
    }
  }
  return level;
}

using Pyramid = std::vector<GreyImage>;

Pyramid pyramid(const Op& op, const Tensor& image) {
  const auto pixels = image.as<std::uint8_t>();
  Pyramid levels;
  levels.push_back({op.width, op.height, {pixels.begin(), pixels.end()}});
  const auto sizes = op.levels();
  for (std::size_t i = 1; i < sizes.size(); ++i) {
    levels.push_back(next_level(levels.back(), sizes[i]));
  }
  return levels;
}

/// At most @p margin pixels outside the picture; not for NaN.
bool is_inside(const GreyImage& picture, Point p, double margin) {
  return p.x >= -margin && p.x <= picture.width - 1 + margin && p.y >= -margin &&
         p.y <= picture.height - 1 + margin;
}

/// The window around a point of the previous picture, row by row.
struct Window {
  std::array<double, kSamples> value, ix, iy;
  double xx = 0, xy = 0, yy = 0;

  Window(const GreyImage& picture, Point p) {
    std::size_t i = 0;
    for (int dy = -Op::kRadius; dy <= Op::kRadius; ++dy) {
      for (int dx = -Op::kRadius; dx <= Op::kRadius; ++dx, ++i) {
        const auto sample = [&](int more_x, int more_y) {
          return at(picture, {p.x + dx + more_x, p.y + dy + more_y});
        };
        value[i] = sample(0, 0);
        ix[i] = (sample(1, 0) - sample(-1, 0)) / 2;
        iy[i] = (sample(0, 1) - sample(0, -1)) / 2;
        xx += ix[i] * ix[i] / kSamples;
        xy += ix[i] * iy[i] / kSamples;
        yy += iy[i] * iy[i] / kSamples;
      }
    }
  }

  [[nodiscard]] double smaller_eigenvalue() const {
    return (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy)) / 2;
  }

  /// What q moves by in one iteration.
  [[nodiscard]] Point step(const GreyImage& next, Point q) const {
    double ex = 0, ey = 0;
    std::size_t i = 0;
    for (int dy = -Op::kRadius; dy <= Op::kRadius; ++dy) {
      for (int dx = -Op::kRadius; dx <= Op::kRadius; ++dx, ++i) {
        const double difference = value[i] - at(next, {q.x + dx, q.y + dy});
        ex += difference * ix[i] / kSamples;
        ey += difference * iy[i] / kSamples;
      }
    }
    const double det = xx * yy - xy * xy;
    return {(yy * ex - xy * ey) / det, (xx * ey - xy * ex) / det};
  }
};

/// Where the point went; nothing if it is lost.
std::optional<Point> track(const Pyramid& previous, const Pyramid& next, Point p) {
  if (!is_inside(previous[0], p, 0)) return std::nullopt;
  Point q{p.x / (1 << Op::kLevels), p.y / (1 << Op::kLevels)};
  for (std::size_t level = Op::kLevels; level-- > 0;) {
    const double scale = 1 << level;
    q = {2 * q.x, 2 * q.y};
    const Window window(previous[level], {p.x / scale, p.y / scale});
    if (!(window.smaller_eigenvalue() >= Op::kLeastEigenvalue)) {
      if (level == 0) return std::nullopt;
      continue;
    }
    for (int i = 0; i < Op::kIterations; ++i) {
      if (!is_inside(next[level], q, 1)) return std::nullopt;
      const Point step = window.step(next[level], q);
      q = {q.x + step.x, q.y + step.y};
    }
    if (!is_inside(next[level], q, 1)) return std::nullopt;
  }
  if (!is_inside(next[0], q, 0)) return std::nullopt;
  return q;
}

TensorSpec tracks_spec(Element element) {
  TensorSpec spec = corners_spec(element);
  spec.name = "tracks";
  return spec;
}

TensorSpec status_spec() { return {"status", Element::kU8, {Op::kMaxPoints}, true}; }

std::vector<Tensor> reference(const Op& op, const Data& data) {
  const Pyramid previous = pyramid(op, data.inputs[0]);
  const Pyramid next = pyramid(op, data.inputs[1]);
  const auto corners = data.inputs[2].used<float>();
  auto outputs = only(Tensor(tracks_spec(Element::kF64)));
  outputs.emplace_back(status_spec());
  for (Tensor& output : outputs) output.set_rows(data.inputs[2].rows());
  const auto tracks = outputs[0].used<double>();
  const auto status = outputs[1].used<std::uint8_t>();
  for (std::size_t i = 0; i < status.size(); ++i) {
    const Point p{corners[2 * i], corners[2 * i + 1]};
    const auto found = track(previous, next, p);
    status[i] = found ? 1 : 0;
    tracks[2 * i] = found.value_or(p).x;
    tracks[2 * i + 1] = found.value_or(p).y;
  }
  return outputs;
}

std::int64_t count_ops(const Op& op, std::int64_t points) {
  constexpr std::int64_t kSample = 7;  // four products, three sums
  constexpr std::int64_t kPatch = std::int64_t{kWindow + 2} * (kWindow + 2);
  // The window with a border of 1 for its differences; two differences halved, three products
  // summed.
  constexpr std::int64_t kSetUp = kPatch * kSample + std::int64_t{kSamples} * (4 + 6);
  constexpr std::int64_t kIteration = kSamples * (kSample + 1 + 4);
  std::int64_t pyramids = 0;
  const auto levels = op.levels();
  for (std::size_t i = 1; i < levels.size(); ++i) {
    pyramids += std::int64_t{2} * 2 * 25 * levels[i].width * levels[i].height;
  }
  return pyramids + points * Op::kLevels * (kSetUp + Op::kIterations * kIteration);
}

/// Each frame has the strongest corners of its first picture: all of them, 3/4, half, a quarter.
Data make_data(const Workload& detect, const DataRequest& request, int width, int height) {
  Data data = gray_pair_data(request, width, height);
  Data image;
  image.inputs = copy_tensors(std::span(data.inputs).first(1));
  const auto found = detect.reference(image);
  const auto from = found[0].used<double>();
  Tensor corners(corners_spec(Element::kF32));
  std::ranges::transform(from, corners.as<float>().begin(),
                         [](double value) { return static_cast<float>(value); });
  corners.set_rows(found[0].rows() * (kFrames - request.frame % kFrames) / kFrames);
  data.inputs.push_back(std::move(corners));
  return data;
}

/// A lost point's track is the point itself, in both. A tracked one may be off by 0.01 pixels: the
/// f32 sums of 225 products err by some 1e-7 of the largest, which is 2e-3 pixels over the least
/// eigenvalue. Where a window repeats itself or moved farther than the iterations reach, these do
/// not contract and small errors grow: at most 0.5 % of the points (none below 200) may differ by
/// more, or in status. Observed on both backends: at most 7e-5 pixels in generated pictures; in
/// real ones, also of different scenes, 0.007 pixels, and 1 of 25 000 points beyond the bound.
Verdict verify(std::span<const Tensor> outputs, std::span<const Tensor> expected) {
  constexpr double kAllowed = 0.005;
  constexpr double kBoundPixels = 0.01;
  const auto fail = [](std::string why) {
    return Verdict{false, std::numeric_limits<double>::infinity(), "tracks: " + std::move(why)};
  };
  const bool as_specified = outputs.size() == 2 && expected.size() == 2 &&
                            outputs[0].spec() == tracks_spec(Element::kF32) &&
                            outputs[1].spec() == status_spec();
  if (!as_specified) return fail("f32 tracks and a u8 status are expected");
  const std::int64_t points = expected[0].rows();
  if (outputs[0].rows() != points || outputs[1].rows() != points) {
    return fail(fmt::format("{} and {} rows where {} are expected", outputs[0].rows(),
                            outputs[1].rows(), points));
  }
  const auto got = outputs[0].used<float>();
  const auto want = expected[0].used<double>();
  const auto status = outputs[1].used<std::uint8_t>();
  const auto wanted_status = expected[1].used<std::uint8_t>();
  std::int64_t differing = 0;
  double worst = 0;
  for (std::size_t i = 0; i < status.size(); ++i) {
    const double dx = got[2 * i] - want[2 * i], dy = got[2 * i + 1] - want[2 * i + 1];
    const double off = std::hypot(dx, dy);
    if (!std::isfinite(off)) return fail(fmt::format("point {} is not finite", i));
    const bool same = status[i] == wanted_status[i] && off <= (status[i] == 1 ? kBoundPixels : 0);
    if (same) {
      worst = std::max(worst, off);
    } else {
      ++differing;
    }
  }
  const double share =
      static_cast<double>(differing) / static_cast<double>(std::max<std::int64_t>(points, 1));
  return {share <= kAllowed, share,
          fmt::format("tracks: {} of {} are not the reference's, bound {:.1f} %; the others are "
                      "off by at most {:.2g} pixels, bound {}",
                      differing, points, 100.0 * kAllowed, worst, kBoundPixels)};
}

}  // namespace

std::array<TrackFeatures::Level, TrackFeatures::kLevels> TrackFeatures::levels() const {
  std::array<Level, kLevels> all{};
  all[0] = {width, height};
  for (std::size_t i = 1; i < all.size(); ++i) {
    all[i] = {(all[i - 1].width + 1) / 2, (all[i - 1].height + 1) / 2};
  }
  return all;
}

Workload make_track_features(int width, int height) {
  auto op = std::make_shared<TrackFeatures>();
  op->width = width;
  op->height = height;

  Workload w;
  w.name = "track_features";
  w.description =
      "pyramidal Lucas-Kanade of at most 500 points, 8-bit grey " + size_text(width, height);
  w.tags = {"vision", "image"};
  w.kernel = "track_features";
  w.operation = op;
  w.inputs = {gray_spec("previous", width, height), gray_spec("image", width, height),
              corners_spec(Element::kF32)};
  w.outputs = {tracks_spec(Element::kF32), status_spec()};
  w.frames = kFrames;
  w.ops_of = [op](const Data& data) { return count_ops(*op, data.inputs[2].rows()); };
  w.make_data = [=, detect = make_feature_detect(width, height)](const DataRequest& request) {
    return make_data(detect, request, width, height);
  };
  w.reference = [op](const Data& data) { return reference(*op, data); };
  w.verify = verify;
  return w;
}

}  // namespace pirt::vision
