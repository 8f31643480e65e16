// The vision kernels of the cpu backend, made of OpenCV's functions. Host tensors are used in
// place.
//
// Filters that OpenCV runs on one thread are split into bands of rows here; a filter on a part of a
// picture looks at the rows around that part (no BORDER_ISOLATED), so that the bands together give
// exactly what the whole would.
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "workloads/cpu/kernels.h"
#include "workloads/vision/corners.h"
#include "workloads/vision/vision.h"

namespace pirt::cpu {
namespace {

using Mats = std::vector<cv::Mat>;

int mat_depth(Element element) {
  switch (element) {
    case Element::kU8:
      return CV_8U;
    case Element::kI16:
      return CV_16S;
    case Element::kI32:
      return CV_32S;
    case Element::kF32:
      return CV_32F;
    case Element::kF64:
      break;
  }
  return CV_64F;
}

/// The tensor's memory as [rows, columns] or [rows, columns, channels].
cv::Mat view(const Tensor& tensor) {
  const auto& shape = tensor.spec().shape;
  const auto extent = [&](std::size_t axis) {
    return axis < shape.size() ? static_cast<int>(shape[axis]) : 1;
  };
  // OpenCV has no view of constant memory; inputs are only read.
  return {extent(0), extent(1), CV_MAKETYPE(mat_depth(tensor.spec().element), extent(2)),
          const_cast<std::byte*>(tensor.data())};
}

/// A kernel that is one function of the bound tensors.
class MatKernel : public Kernel {
 public:
  using Function = std::function<void(const Mats& inputs, Mats& outputs)>;
  explicit MatKernel(Function function) : function_(std::move(function)) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_.clear();
    outputs_.clear();
    for (const auto& tensor : inputs) inputs_.push_back(view(tensor));
    for (const auto& tensor : outputs) outputs_.push_back(view(tensor));
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) function_(inputs_, outputs_);
    return std::nullopt;
  }

 private:
  Function function_;
  Mats inputs_, outputs_;
};

std::unique_ptr<Kernel> make(MatKernel::Function function) {
  return std::make_unique<MatKernel>(std::move(function));
}

/// Calls @p band with ranges of rows that together cover @p rows, one a thread.
template <typename Band>
void for_bands(int rows, const Band& band) {
  cv::parallel_for_(cv::Range(0, rows), band, std::min(rows, cv::getNumThreads()));
}

std::unique_ptr<Kernel> make_gaussian_blur(const Workload&, std::span<const Tensor>) {
  return make([](const Mats& in, Mats& out) {
    cv::GaussianBlur(in[0], out[0], {5, 5}, 0.0, 0.0, cv::BORDER_REFLECT_101);
  });
}

std::unique_ptr<Kernel> make_filter7x7(const Workload&, std::span<const Tensor> parameters) {
  // Weights / 2^8 and their products with 8-bit pixels are exact in f32, and OpenCV rounds halves
  // to even: as defined.
  cv::Mat weights;
  view(parameters[0]).convertTo(weights, CV_32F, 1.0 / (1 << vision::Filter7x7::kShift));
  return make([weights](const Mats& in, Mats& out) {
    for_bands(in[0].rows, [&](const cv::Range& rows) {
      cv::Mat band = out[0].rowRange(rows);
      cv::filter2D(in[0].rowRange(rows), band, CV_8U, weights, {-1, -1}, 0.0,
                   cv::BORDER_REFLECT_101);
    });
  });
}

/// Both gradients in one pass over the picture. cv::spatialGradient does that on one thread and,
/// unlike the filters, takes the first and the last row of a part for the picture's border: the two
/// rows at each cut are computed again from the rows around it.
void gradients(const cv::Mat& image, cv::Mat& gx, cv::Mat& gy) {
  const int bands = std::clamp(image.rows / 4, 1, cv::getNumThreads());
  const auto cut = [&](int band) { return image.rows * band / bands; };
  const auto repair = [&](int row) {  // row - 1 and row
    cv::Mat x, y;
    cv::spatialGradient(image.rowRange(row - 2, row + 2), x, y, 3, cv::BORDER_REFLECT_101);
    x.rowRange(1, 3).copyTo(gx.rowRange(row - 1, row + 1));
    y.rowRange(1, 3).copyTo(gy.rowRange(row - 1, row + 1));
  };
  cv::parallel_for_(
      cv::Range(0, bands),
      [&](const cv::Range& range) {
        for (int band = range.start; band < range.end; ++band) {
          cv::Mat x = gx.rowRange(cut(band), cut(band + 1));
          cv::Mat y = gy.rowRange(cut(band), cut(band + 1));
          cv::spatialGradient(image.rowRange(cut(band), cut(band + 1)), x, y, 3,
                              cv::BORDER_REFLECT_101);
        }
      },
      bands);
  for (int band = 1; band < bands; ++band) repair(cut(band));
}

std::unique_ptr<Kernel> make_sobel(const Workload&, std::span<const Tensor>) {
  return make([](const Mats& in, Mats& out) { gradients(in[0], out[0], out[1]); });
}

std::unique_ptr<Kernel> make_undistort(const Workload& workload, std::span<const Tensor>) {
  const auto& op = operation_as<vision::Undistort>(workload);
  const auto& c = op.camera;
  const cv::Matx33d matrix(c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
  const cv::Vec4d distortion(c.k1, c.k2, c.p1, c.p2);
  // Fixed-point maps: 1/32 pixel, what the workload is defined in.
  cv::Mat positions, fractions;
  cv::initUndistortRectifyMap(matrix, distortion, cv::noArray(), matrix, {op.width, op.height},
                              CV_16SC2, positions, fractions);
  return make([positions, fractions](const Mats& in, Mats& out) {
    cv::remap(in[0], out[0], positions, fractions, cv::INTER_LINEAR, cv::BORDER_CONSTANT,
              cv::Scalar());
  });
}

/// cv::goodFeaturesToTrack in bands: OpenCV's own is one thread from the responses on.
class FeatureDetect {
 public:
  explicit FeatureDetect(const vision::FeatureDetect& operation)
      : operation_(operation),
        response_(operation.height, operation.width, CV_32F),
        largest_(operation.height, operation.width, CV_32F) {}

  void operator()(const Mats& in, Mats& out) {
    peak_ = 0;
    candidates_.clear();
    for_bands(in[0].rows, [&](const cv::Range& rows) { respond(in[0], rows); });
    for_bands(in[0].rows, [&](const cv::Range& rows) { collect(rows); });
    const auto corners = vision::select_corners(candidates_, operation_);
    auto* rows = out[0].ptr<cv::Point2f>();
    std::fill_n(rows, Op::kMaxCorners, cv::Point2f());
    for (const auto& corner : corners) {
      *rows++ = {static_cast<float>(corner.x), static_cast<float>(corner.y)};
    }
    out[1].at<int>(0) = static_cast<int>(corners.size());
  }

 private:
  using Op = vision::FeatureDetect;

  /// Responses of @p rows, and their part of the peak. Gradients look around a part; the block sums
  /// do not, so that a row more is computed at each side.
  void respond(const cv::Mat& image, const cv::Range& rows) {
    const cv::Range more(std::max(rows.start - 1, 0), std::min(rows.end + 1, image.rows));
    cv::Mat response;
    cv::cornerMinEigenVal(image.rowRange(more), response, Op::kBlock, 3);
    response.rowRange(rows.start - more.start, rows.end - more.start)
        .copyTo(response_.rowRange(rows));
    double peak = 0;
    cv::minMaxLoc(response_.rowRange(rows), nullptr, &peak);
    const std::lock_guard guard(*merge_);
    peak_ = std::max(peak_, peak);
  }

  /// Candidates among @p rows: above the threshold, and no neighbour larger.
  void collect(const cv::Range& rows) {
    cv::Mat largest = largest_.rowRange(rows);
    cv::dilate(response_.rowRange(rows), largest, cv::Mat());
    const auto threshold = static_cast<float>(peak_ * Op::kQuality);
    std::vector<std::uint64_t> found;
    for (int y = std::max(rows.start, 1); y < std::min(rows.end, response_.rows - 1); ++y) {
      const auto* response = response_.ptr<float>(y);
      const auto* neighbours = largest_.ptr<float>(y);
      for (int x = 1; x < response_.cols - 1; ++x) {
        if (response[x] > threshold && response[x] == neighbours[x]) {
          const auto pixel =
              static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(response_.cols) +
              static_cast<std::uint64_t>(x);
          found.push_back(std::uint64_t{std::bit_cast<std::uint32_t>(response[x])} << 32U | pixel);
        }
      }
    }
    const std::lock_guard guard(*merge_);
    candidates_.insert(candidates_.end(), found.begin(), found.end());
  }

  vision::FeatureDetect operation_;
  cv::Mat response_, largest_;
  double peak_ = 0;
  std::vector<std::uint64_t> candidates_;
  std::shared_ptr<std::mutex> merge_ = std::make_shared<std::mutex>();
};

std::unique_ptr<Kernel> make_feature_detect(const Workload& workload, std::span<const Tensor>) {
  return make(FeatureDetect(operation_as<vision::FeatureDetect>(workload)));
}

/// Dense Lucas-Kanade: products of derivatives, their window sums by box filters on integers, one
/// 2x2 system a pixel.
class OpticalFlow {
 public:
  OpticalFlow(int width, int height) {
    for (auto& plane : derivatives_) plane.create(height, width, CV_16S);
    for (auto& plane : products_) plane.create(height, width, CV_32S);
    for (auto& plane : sums_) plane.create(height, width, CV_32S);
  }

  void operator()(const Mats& in, Mats& out) {
    const int height = in[0].rows;
    for_bands(height, [&](const cv::Range& rows) { multiply(in, rows); });
    for_bands(height, [&](const cv::Range& rows) {
      sum(rows);
      for (int y = rows.start; y < rows.end; ++y) solve(y, out[0].ptr<float>(y));
    });
  }

 private:
  enum Derivative : std::uint8_t { kX, kY, kT };
  enum Product : std::uint8_t { kXX, kXY, kYY, kXT, kYT };
  static constexpr std::array<std::pair<Derivative, Derivative>, 5> kFactors = {
      {{kX, kX}, {kX, kY}, {kY, kY}, {kX, kT}, {kY, kT}}};

  void multiply(const Mats& in, const cv::Range& rows) {
    const cv::Mat previous = in[0].rowRange(rows);
    std::array<cv::Mat, 3> d;
    for (std::size_t i = 0; i < d.size(); ++i) d[i] = derivatives_[i].rowRange(rows);
    // An aperture of 1 is the plain difference [-1 0 1].
    cv::Sobel(previous, d[kX], CV_16S, 1, 0, 1, 1.0, 0.0, cv::BORDER_REPLICATE);
    cv::Sobel(previous, d[kY], CV_16S, 0, 1, 1, 1.0, 0.0, cv::BORDER_REPLICATE);
    cv::subtract(in[1].rowRange(rows), previous, d[kT], cv::noArray(), CV_16S);
    for (std::size_t i = 0; i < kFactors.size(); ++i) {
      cv::Mat product = products_[i].rowRange(rows);
      cv::multiply(d[kFactors[i].first], d[kFactors[i].second], product, 1.0, CV_32S);
    }
  }

  void sum(const cv::Range& rows) {
    constexpr int kWindow = vision::OpticalFlow::kWindow;
    for (std::size_t i = 0; i < sums_.size(); ++i) {
      cv::Mat sums = sums_[i].rowRange(rows);
      cv::boxFilter(products_[i].rowRange(rows), sums, CV_32S, {kWindow, kWindow},
                    {kWindow / 2, kWindow / 2}, false, cv::BORDER_REPLICATE);
    }
  }

  void solve(int y, float* flow) const {
    const auto* xx = sums_[kXX].ptr<int>(y);
    const auto* xy = sums_[kXY].ptr<int>(y);
    const auto* yy = sums_[kYY].ptr<int>(y);
    const auto* xt = sums_[kXT].ptr<int>(y);
    const auto* yt = sums_[kYT].ptr<int>(y);
    const auto product = [](int a, int b) { return std::int64_t{a} * b; };
    for (int x = 0; x < sums_[kXX].cols; ++x) {
      const std::int64_t det = product(xx[x], yy[x]) - product(xy[x], xy[x]);
      const std::int64_t u = product(xy[x], yt[x]) - product(yy[x], xt[x]);
      const std::int64_t v = product(xy[x], xt[x]) - product(xx[x], yt[x]);
      const double scale = det == 0 ? 0.0 : 2.0 / static_cast<double>(det);
      *flow++ = static_cast<float>(static_cast<double>(u) * scale);
      *flow++ = static_cast<float>(static_cast<double>(v) * scale);
    }
  }

  std::array<cv::Mat, 3> derivatives_;
  std::array<cv::Mat, 5> products_, sums_;
};

std::unique_ptr<Kernel> make_optical_flow(const Workload& workload, std::span<const Tensor>) {
  const auto& op = operation_as<vision::OpticalFlow>(workload);
  return make(OpticalFlow(op.width, op.height));
}

constexpr std::array<KernelEntry, 6> kKernels = {{{"gaussian_blur", make_gaussian_blur},
                                                  {"filter7x7", make_filter7x7},
                                                  {"sobel", make_sobel},
                                                  {"undistort", make_undistort},
                                                  {"feature_detect", make_feature_detect},
                                                  {"optical_flow", make_optical_flow}}};

}  // namespace

std::span<const KernelEntry> vision_kernels() { return kKernels; }

}  // namespace pirt::cpu
