#include "workloads/slam/workload/step_tensors.h"

#include <algorithm>
#include <stdexcept>

#include "workloads/base/error.h"

namespace pirt::slam {
namespace {

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

void put_words(std::int64_t value, std::span<std::int32_t> words) {
  const auto bits = static_cast<std::uint64_t>(value);
  words[0] = static_cast<std::int32_t>(static_cast<std::uint32_t>(bits));
  words[1] = static_cast<std::int32_t>(static_cast<std::uint32_t>(bits >> 32U));
}

void put_words(Nanos time, std::span<std::int32_t> words) { put_words(time.count(), words); }

std::int64_t whole_of(std::span<const std::int32_t> words) {
  const auto low = static_cast<std::uint32_t>(words[0]);
  const auto high = static_cast<std::uint32_t>(words[1]);
  return static_cast<std::int64_t>(std::uint64_t{high} << 32U | low);
}

Nanos time_of_words(std::span<const std::int32_t> words) { return Nanos(whole_of(words)); }

}  // namespace

std::vector<Tensor> tensors_of(std::span<const ImuSample> samples, Nanos until) {
  auto tensors = make_tensors(sample_specs());
  for (std::size_t i = 0; i < 2; ++i) tensors[i].set_rows(std::ssize(samples));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    double* values = &tensors[0].as<double>()[6 * i];
    std::copy_n(samples[i].gyro_rad_s.data(), 3, values);
    std::copy_n(samples[i].accel_m_s2.data(), 3, values + 3);
    put_words(samples[i].time, tensors[1].as<std::int32_t>().subspan(2 * i, 2));
  }
  put_words(until, tensors[2].as<std::int32_t>());
  return tensors;
}

std::vector<ImuSample> samples_of(std::span<const Tensor> tensors) {
  if (tensors[0].rows() != tensors[1].rows()) {
    throw_bad_input("IMU samples and stamps that differ in number");
  }
  std::vector<ImuSample> samples;
  for (std::size_t i = 0; i < static_cast<std::size_t>(tensors[0].rows()); ++i) {
    const double* values = &tensors[0].as<double>()[6 * i];
    samples.push_back({time_of_words(tensors[1].as<std::int32_t>().subspan(2 * i, 2)),
                       Eigen::Vector3d(values), Eigen::Vector3d(values + 3)});
  }
  return samples;
}

Nanos time_of(const Tensor& until) { return time_of_words(until.as<std::int32_t>()); }

std::vector<Tensor> tensors_of(const Features& features) {
  auto tensors = make_tensors(feature_specs());
  for (Tensor& tensor : tensors) tensor.set_rows(std::ssize(features.pixels));
  write_points(features.pixels, tensors[0]);
  std::ranges::copy(features.scores, tensors[1].as<float>().begin());
  for (std::size_t i = 0; i < features.descriptors.size(); ++i) {
    std::ranges::copy(features.descriptors[i],
                      tensors[2].as<std::uint8_t>().subspan(32 * i, 32).begin());
  }
  return tensors;
}

Features features_of(std::span<const Tensor> tensors) {
  const auto count = static_cast<std::size_t>(tensors[0].rows());
  if (tensors[1].rows() != tensors[0].rows() || tensors[2].rows() != tensors[0].rows()) {
    throw_bad_input("features whose pixels, scores and descriptors differ in number");
  }
  Features features;
  features.pixels = points_of(tensors[0]);
  const auto scores = tensors[1].used<float>();
  features.scores.assign(scores.begin(), scores.end());
  features.descriptors.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::ranges::copy(tensors[2].as<std::uint8_t>().subspan(32 * i, 32),
                      features.descriptors[i].begin());
  }
  return features;
}

std::vector<Tensor> tensors_of(const BetterMap& better) {
  const auto count = std::ssize(better.points);
  if (count > kMostBetter) {
    throw_bad_input(std::to_string(count) + " points of a map are more than the " +
                    std::to_string(kMostBetter) + " that extend_map takes at once");
  }
  auto tensors = make_tensors(better_specs());
  for (std::size_t i = 0; i < 3; ++i) tensors[i].set_rows(count);
  tensors[3].as<std::int32_t>()[0] = better.in_map ? 1 : 0;
  for (std::size_t i = 0; i < better.points.size(); ++i) {
    const MapPoint& point = better.points[i];
    double* const values = &tensors[0].as<double>()[kBetterSize * i];
    std::copy_n(point.position.data(), 3, values);
    std::copy_n(point.covariance.data(), 9, values + 3);
    std::copy_n(point.seen_from.data(), 3, values + 12);
    const auto ids = tensors[1].as<std::int32_t>();
    put_words(point.id, ids.subspan(6 * i, 2));
    put_words(point.last_frame, ids.subspan(6 * i + 2, 2));
    put_words(point.milestone, ids.subspan(6 * i + 4, 2));
    std::ranges::copy(point.descriptor,
                      &tensors[2].as<std::uint8_t>()[i * point.descriptor.size()]);
  }
  return tensors;
}

BetterMap better_of(std::span<const Tensor> tensors) {
  if (tensors[0].rows() != tensors[1].rows() || tensors[0].rows() != tensors[2].rows()) {
    throw_bad_input("points of a map, their ids and descriptors that differ in number");
  }
  BetterMap better;
  better.in_map = tensors[3].as<std::int32_t>()[0] != 0;
  better.points.resize(static_cast<std::size_t>(tensors[0].rows()));
  for (std::size_t i = 0; i < better.points.size(); ++i) {
    MapPoint& point = better.points[i];
    const double* const values = &tensors[0].as<double>()[kBetterSize * i];
    point.position = Eigen::Vector3d(values);
    point.covariance = Eigen::Matrix3d(values + 3);
    point.seen_from = Eigen::Vector3d(values + 12);
    const auto ids = tensors[1].as<std::int32_t>();
    point.id = whole_of(ids.subspan(6 * i, 2));
    point.last_frame = whole_of(ids.subspan(6 * i + 2, 2));
    point.milestone = whole_of(ids.subspan(6 * i + 4, 2));
    std::copy_n(&tensors[2].as<std::uint8_t>()[i * point.descriptor.size()],
                point.descriptor.size(), point.descriptor.begin());
  }
  return better;
}

void write_tracks(std::span<const TrackedPoint> tracks, std::span<Tensor> tensors) {
  for (std::size_t i = 0; i < 2; ++i) tensors[i].set_rows(std::ssize(tracks));
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    tensors[0].as<float>()[2 * i] = tracks[i].pixel.x();
    tensors[0].as<float>()[2 * i + 1] = tracks[i].pixel.y();
    tensors[1].as<std::uint8_t>()[i] = tracks[i].found ? 1 : 0;
  }
}

std::vector<TrackedPoint> tracks_of(std::span<const Tensor> tensors) {
  if (tensors[0].rows() != tensors[1].rows()) {
    throw_bad_input("tracks and flags of found that differ in number");
  }
  std::vector<TrackedPoint> tracks;
  for (const auto& pixel : points_of(tensors[0])) {
    tracks.push_back({pixel, tensors[1].as<std::uint8_t>()[tracks.size()] != 0});
  }
  return tracks;
}

void write_points(std::span<const Eigen::Vector2f> points, Tensor& tensor) {
  tensor.set_rows(std::ssize(points));
  for (std::size_t i = 0; i < points.size(); ++i) {
    tensor.as<float>()[2 * i] = points[i].x();
    tensor.as<float>()[2 * i + 1] = points[i].y();
  }
}

std::vector<Eigen::Vector2f> points_of(const Tensor& tensor) {
  const auto values = tensor.used<float>();
  std::vector<Eigen::Vector2f> points;
  for (std::size_t i = 0; i + 1 < values.size(); i += 2) {
    points.emplace_back(values[i], values[i + 1]);
  }
  return points;
}

void write_pose(const Pose& pose, Tensor& tensor) {
  const auto values = tensor.as<double>();
  Eigen::Map<RowMajor>(values.data()) = pose.rotation;
  std::copy_n(pose.position.data(), 3, &values[9]);
}

Pose pose_of(const Tensor& tensor) {
  const auto values = tensor.as<double>();
  return {Eigen::Map<const RowMajor>(values.data()), Eigen::Vector3d(&values[9])};
}

std::vector<TensorSpec> pyramid_specs(int width, int height) {
  std::vector<TensorSpec> specs;
  for (int level = 0; level < kPyramidLevels; ++level) {
    specs.push_back({"level" + std::to_string(level), Element::kU8, {height, width}});
    width = (width + 1) / 2;
    height = (height + 1) / 2;
  }
  return specs;
}

void write_pyramid(const Pyramid& pyramid, std::span<Tensor> tensors) {
  for (std::size_t i = 0; i < pyramid.levels.size(); ++i) {
    std::ranges::copy(pyramid.levels[i].pixels, tensors[i].as<std::uint8_t>().begin());
  }
}

Pyramid pyramid_of(std::span<const Tensor> tensors) {
  Pyramid pyramid;
  for (const Tensor& tensor : tensors) pyramid.levels.push_back(image_of(tensor));
  return pyramid;
}

TensorSpec image_spec(int width, int height) { return {"image", Element::kU8, {height, width}}; }

Tensor tensor_of(const GreyImage& image) {
  Tensor tensor(image_spec(image.width, image.height));
  std::ranges::copy(image.pixels, tensor.as<std::uint8_t>().begin());
  return tensor;
}

GreyImage image_of(const Tensor& tensor) {
  const auto pixels = tensor.as<std::uint8_t>();
  return {static_cast<int>(tensor.dim(1)),
          static_cast<int>(tensor.dim(0)),
          {pixels.begin(), pixels.end()}};
}

}  // namespace pirt::slam
