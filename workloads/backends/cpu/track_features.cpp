// track_features on the host's cores: OpenCV's pyrDown is the pyramid as defined; the tracking is
// our own, since cv::calcOpticalFlowPyrLK takes other derivatives, rounds samples to integers and
// stops each point when it likes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "workloads/backends/cpu/kernels.h"
#include "workloads/vision/vision.h"

namespace pirt::cpu {
namespace {

using Op = vision::TrackFeatures;

constexpr int kWindow = 2 * Op::kRadius + 1;
constexpr int kBordered = kWindow + 2;  // with what central differences need

struct Point {
  float x = 0;
  float y = 0;
};

bool is_inside(const cv::Mat& picture, Point p, float margin) {
  return p.x >= -margin && p.x <= static_cast<float>(picture.cols - 1) + margin && p.y >= -margin &&
         p.y <= static_cast<float>(picture.rows - 1) + margin;
}

template <int kSize>
using Samples = std::array<std::array<float, kSize>, kSize>;

/// Pixels around p, one more than samples each way, so that the loops over samples need no
/// conditions; those beyond the border repeat it.
template <int kSize>
Samples<kSize + 1> pixels_around(const cv::Mat& picture, int left, int top) {
  Samples<kSize + 1> pixels;
  const bool whole =
      left >= 0 && left + kSize < picture.cols && top >= 0 && top + kSize < picture.rows;
  for (int j = 0; j <= kSize; ++j) {
    auto& row = pixels[static_cast<std::size_t>(j)];
    const auto* from = picture.ptr<std::uint8_t>(std::clamp(top + j, 0, picture.rows - 1));
    for (int i = 0; i <= kSize; ++i) {
      const int x = whole ? left + i : std::clamp(left + i, 0, picture.cols - 1);
      row[static_cast<std::size_t>(i)] = from[x];
    }
  }
  return pixels;
}

template <int kSize>
Samples<kSize> samples_around(const cv::Mat& picture, Point p) {
  const float floor_x = std::floor(p.x), floor_y = std::floor(p.y);
  const auto pixels = pixels_around<kSize>(picture, static_cast<int>(floor_x) - kSize / 2,
                                           static_cast<int>(floor_y) - kSize / 2);
  const float a = p.x - floor_x, b = p.y - floor_y;
  const float w00 = (1 - a) * (1 - b), w10 = a * (1 - b), w01 = (1 - a) * b, w11 = a * b;
  Samples<kSize> samples;
  for (std::size_t j = 0; j < kSize; ++j) {
    for (std::size_t i = 0; i < kSize; ++i) {
      samples[j][i] = w00 * pixels[j][i] + w10 * pixels[j][i + 1] + w01 * pixels[j + 1][i] +
                      w11 * pixels[j + 1][i + 1];
    }
  }
  return samples;
}

/// The window of the previous picture: values and differences.
struct Window {
  Samples<kWindow> value, ix, iy;
  float xx = 0, xy = 0, yy = 0;

  Window(const cv::Mat& picture, Point p) {
    const auto around = samples_around<kBordered>(picture, p);
    // Sums by column: lanes of a vector.
    std::array<float, kWindow> sum_xx{}, sum_xy{}, sum_yy{};
    for (std::size_t j = 0; j < kWindow; ++j) {
      for (std::size_t i = 0; i < kWindow; ++i) {
        const float dx = (around[j + 1][i + 2] - around[j + 1][i]) * 0.5F;
        const float dy = (around[j + 2][i + 1] - around[j][i + 1]) * 0.5F;
        value[j][i] = around[j + 1][i + 1];
        ix[j][i] = dx;
        iy[j][i] = dy;
        sum_xx[i] += dx * dx;
        sum_xy[i] += dx * dy;
        sum_yy[i] += dy * dy;
      }
    }
    xx = mean(sum_xx), xy = mean(sum_xy), yy = mean(sum_yy);
  }

  [[nodiscard]] float smaller_eigenvalue() const {
    return (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy)) * 0.5F;
  }

  [[nodiscard]] Point step(const cv::Mat& next, Point q) const {
    const auto moved = samples_around<kWindow>(next, q);
    std::array<float, kWindow> sum_x{}, sum_y{};
    for (std::size_t j = 0; j < kWindow; ++j) {
      for (std::size_t i = 0; i < kWindow; ++i) {
        const float difference = value[j][i] - moved[j][i];
        sum_x[i] += difference * ix[j][i];
        sum_y[i] += difference * iy[j][i];
      }
    }
    const float ex = mean(sum_x), ey = mean(sum_y);
    const float det = xx * yy - xy * xy;
    return {(yy * ex - xy * ey) / det, (xx * ey - xy * ex) / det};
  }

 private:
  static float mean(const std::array<float, kWindow>& columns) {
    float sum = 0;
    for (const float column : columns) sum += column;
    return sum / (kWindow * kWindow);
  }
};

class TrackFeatures : public Kernel {
 public:
  TrackFeatures(const Op& operation, std::shared_ptr<BandTeam> team) : team_(std::move(team)) {
    const auto levels = operation.levels();
    for (Pyramid* pyramid : {&previous_, &next_}) {
      for (std::size_t i = 1; i < levels.size(); ++i) {
        (*pyramid)[i].create(levels[i].height, levels[i].width, CV_8U);
      }
    }
    size_ = {operation.width, operation.height};
  }

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    // OpenCV has no view of constant memory; inputs are only read.
    const auto view = [&](const Tensor& image) {
      return cv::Mat(size_, CV_8U, const_cast<std::byte*>(image.data()));
    };
    previous_[0] = view(inputs[0]);
    next_[0] = view(inputs[1]);
    points_ = &inputs[2];
    outputs_ = outputs;
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) compute();
    return std::nullopt;
  }

 private:
  using Pyramid = std::array<cv::Mat, Op::kLevels>;

  void compute() {
    const std::array pyramids = {&previous_, &next_};
    // A level needs all of the one below: the two pictures are the parts.
    for_bands(*team_, static_cast<int>(pyramids.size()), Halo(0), [&](const Band& band) {
      for (int i = band.rows.start; i < band.rows.end; ++i) {
        Pyramid& levels = *pyramids[static_cast<std::size_t>(i)];
        for (std::size_t level = 1; level < levels.size(); ++level) {
          cv::pyrDown(levels[level - 1], levels[level], levels[level].size(),
                      cv::BORDER_REFLECT_101);
        }
      }
    });
    for (Tensor& output : outputs_) output.set_rows(points_->rows());
    for_bands(*team_, static_cast<int>(points_->rows()), Halo(0), [&](const Band& band) {
      for (int i = band.rows.start; i < band.rows.end; ++i) track(static_cast<std::size_t>(i));
    });
  }

  void track(std::size_t index) const {
    const auto points = points_->used<float>();
    const Point p{points[2 * index], points[2 * index + 1]};
    Point q;
    const bool tracked = find(p, q);
    const auto tracks = outputs_[0].as<float>();
    tracks[2 * index] = tracked ? q.x : p.x;
    tracks[2 * index + 1] = tracked ? q.y : p.y;
    outputs_[1].as<std::uint8_t>()[index] = tracked ? 1 : 0;
  }

  /// Whether the point is tracked; then @p q is where it went.
  [[nodiscard]] bool find(Point p, Point& q) const {
    if (!is_inside(previous_[0], p, 0)) return false;
    q = {p.x / (1 << Op::kLevels), p.y / (1 << Op::kLevels)};
    for (std::size_t level = Op::kLevels; level-- > 0;) {
      const auto scale = static_cast<float>(1 << level);
      q = {2 * q.x, 2 * q.y};
      const Window window(previous_[level], {p.x / scale, p.y / scale});
      if (!(window.smaller_eigenvalue() >= static_cast<float>(Op::kLeastEigenvalue))) {
        if (level == 0) return false;
        continue;
      }
      for (int i = 0; i < Op::kIterations; ++i) {
        if (!is_inside(next_[level], q, 1)) return false;
        const Point step = window.step(next_[level], q);
        q = {q.x + step.x, q.y + step.y};
      }
      if (!is_inside(next_[level], q, 1)) return false;
    }
    return is_inside(next_[0], q, 0);
  }

  std::shared_ptr<BandTeam> team_;
  cv::Size size_;
  Pyramid previous_, next_;
  const Tensor* points_ = nullptr;
  std::span<Tensor> outputs_;
};

}  // namespace

std::unique_ptr<Kernel> make_track_features(const Workload& workload, std::span<const Tensor>,
                                            const std::shared_ptr<BandTeam>& team) {
  return std::make_unique<TrackFeatures>(operation_as<Op>(workload), team);
}

}  // namespace pirt::cpu
