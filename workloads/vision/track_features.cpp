// track_features: the spec, the reference that defines it, and the comparison of tracks.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "workloads/vision/image_data.h"
#include "workloads/vision/pyramid.h"

namespace pirt::vision {
namespace {

constexpr int kTrackedFrames = 4;
slam::Pyramid pyramid(const TrackFeatures& op, const Tensor& image) {
  const auto pixels = image.as<std::uint8_t>();
  return slam::make_pyramid({op.width, op.height, {pixels.begin(), pixels.end()}},
                            TrackFeatures::kLevels);
}

TensorSpec tracks_spec(Element element) {
  TensorSpec spec = corners_spec(element);
  spec.name = "tracks";
  return spec;
}

TensorSpec status_spec() { return {"status", Element::kU8, {TrackFeatures::kMaxPoints}, true}; }

std::vector<Tensor> track(const TrackFeatures& op, const Data& data) {
  const slam::Pyramid previous = pyramid(op, data.inputs[0]);
  const slam::Pyramid next = pyramid(op, data.inputs[1]);
  const auto corners = data.inputs[2].used<float>();
  auto outputs = only(Tensor(tracks_spec(Element::kF64)));
  outputs.emplace_back(status_spec());
  for (Tensor& output : outputs) output.set_rows(data.inputs[2].rows());
  const auto tracks = outputs[0].used<double>();
  const auto status = outputs[1].used<std::uint8_t>();
  for (std::size_t i = 0; i < status.size(); ++i) {
    const Eigen::Vector2f p(corners[2 * i], corners[2 * i + 1]);
    const auto found = slam::track_feature(previous, next, p, p, {});
    status[i] = found.found ? 1 : 0;
    const Eigen::Vector2f& q = found.found ? found.pixel : p;
    tracks[2 * i] = q.x();
    tracks[2 * i + 1] = q.y();
  }
  return outputs;
}

/// What these points take: how many steps there are, they decide.
std::int64_t count_ops(const TrackFeatures& op, const Data& data) {
  constexpr std::int64_t kWindow = 2 * TrackFeatures::kRadius + 1;
  constexpr std::int64_t kSamples = kWindow * kWindow;
  constexpr std::int64_t kSample = 7;  // four products, three sums
  // The window with a border of 1 for its differences; two differences halved and summed, three
  // products summed.
  constexpr std::int64_t kTake = (kWindow + 2) * (kWindow + 2) * kSample + kSamples * (4 + 2 + 6);
  // The difference, its sum and its two products' sums.
  constexpr std::int64_t kStep = kSamples * (kSample + 2 + 4);
  // Whether what was found looks alike, and how it has deformed: four products of gradients and
  // places, and of the six motions 21 products' sums, six sums, six with the difference.
  constexpr std::int64_t kLook = kSamples * (3 + 4 + 42 + 6 + 12);
  std::int64_t pyramids = 0;
  const auto levels = op.levels();
  for (std::size_t i = 1; i < levels.size(); ++i) {
    pyramids += std::int64_t{2} * 2 * 9 * levels[i].width * levels[i].height;
  }
  const slam::Pyramid previous = pyramid(op, data.inputs[0]);
  const slam::Pyramid next = pyramid(op, data.inputs[1]);
  const auto corners = data.inputs[2].used<float>();
  slam::TrackWork work;
  for (std::size_t i = 0; 2 * i < corners.size(); ++i) {
    const Eigen::Vector2f p(corners[2 * i], corners[2 * i + 1]);
    static_cast<void>(slam::track_feature(previous, next, p, p, {}, &work));
  }
  return pyramids + work.windows * kTake + work.steps * kStep + work.looks * kLook;
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
  corners.set_rows(found[0].rows() * (kTrackedFrames - request.frame % kTrackedFrames) /
                   kTrackedFrames);
  data.inputs.push_back(std::move(corners));
  return data;
}

/// A lost point's track is the point itself, in both. A tracked one may be off by 0.01 pixels: sums
/// in another order may end the steps one earlier or later, and this one is no longer. Where a
/// window repeats itself or moved farther than the steps reach, small errors grow, and what nearly
/// is lost may be: at most 0.5 % of the points (none below 200) may differ by more, or in status.
Verdict verify_tracks(std::span<const Tensor> outputs, std::span<const Tensor> expected) {
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
  w.frames = kTrackedFrames;
  w.ops_of = [op](const Data& data) { return count_ops(*op, data); };
  w.make_data = [=, detect = make_feature_detect(width, height)](const DataRequest& request) {
    return make_data(detect, request, width, height);
  };
  w.reference = [op](const Data& data) { return track(*op, data); };
  w.verify = verify_tracks;
  return w;
}

}  // namespace pirt::vision
