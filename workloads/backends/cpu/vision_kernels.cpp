// The vision kernels of the cpu backend, made of OpenCV's functions. Host tensors are used in
// place.
//
// Pictures are split into bands of rows over the unit's threads (bands.h); each step says its halo,
// so that the bands together give exactly what the whole would.
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

#include "workloads/backends/cpu/kernels.h"
#include "workloads/vision/corners.h"
#include "workloads/vision/vision.h"

namespace pirt::cpu {
namespace {

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

using Team = std::shared_ptr<BandTeam>;

/// Row @p y of what OpenCV's blur of the whole picture gives, to the bit: 5x5 binomial over 2^8.
void blur_row(const cv::Mat& image, int y, std::vector<std::uint16_t>& column_sums, cv::Mat& to) {
  constexpr int kReach = 2;
  const auto row = [&](int dy) {
    return image.ptr(cv::borderInterpolate(y + dy, image.rows, cv::BORDER_REFLECT_101));
  };
  const uchar *a = row(-2), *b = row(-1), *c = row(0), *d = row(1), *e = row(2);
  const int width = image.cols;
  column_sums.resize(static_cast<std::size_t>(width + 2 * kReach));
  std::uint16_t* const sums = column_sums.data() + kReach;
  for (int x = 0; x < width; ++x) {
    sums[x] = static_cast<std::uint16_t>(a[x] + e[x] + 4 * (b[x] + d[x]) + 6 * c[x]);
  }
  for (const int x : {-2, -1, width, width + 1}) {
    sums[x] = sums[cv::borderInterpolate(x, width, cv::BORDER_REFLECT_101)];
  }
  uchar* const out = to.ptr(y);
  for (int x = 0; x < width; ++x) {
    const int sum = sums[x - 2] + sums[x + 2] + 4 * (sums[x - 1] + sums[x + 1]) + 6 * sums[x];
    out[x] = static_cast<uchar>((sum + 128) >> 8);
  }
}

/// Of parts OpenCV has a slower blur, in other arithmetic, and of the rows at a cut between two
/// bands it would compute six to get two: these are our own.
std::unique_ptr<Kernel> make_gaussian_blur(const Workload&, std::span<const Tensor>,
                                           const Team& team) {
  return make([team](const Mats& in, Mats& out) {
    constexpr int kReach = 2;
    for_bands(*team, in[0].rows, Halo(kReach), [&](const Band& band) {
      const auto [begin, end] = std::pair(band.rows.start, band.rows.end);
      cv::Mat to = out[0].rowRange(band.rows);
      cv::GaussianBlur(band.alone(in[0]), to, {5, 5}, 0.0, 0.0, cv::BORDER_REFLECT_101);
      std::vector<std::uint16_t> column_sums;
      const auto blur_rows = [&](int from, int up_to) {
        for (int y = from; y < up_to; ++y) blur_row(in[0], y, column_sums, out[0]);
      };
      if (begin > 0) blur_rows(begin, std::min(begin + kReach, end));
      if (end < in[0].rows) blur_rows(std::max(end - kReach, begin), end);
    });
  });
}

std::unique_ptr<Kernel> make_filter7x7(const Workload&, std::span<const Tensor> parameters,
                                       const Team& team) {
  // Weights / 2^8 and their products with 8-bit pixels are exact in f32, and OpenCV rounds halves
  // to even: as defined.
  cv::Mat weights;
  view(parameters[0]).convertTo(weights, CV_32F, 1.0 / (1 << vision::Filter7x7::kShift));
  return make([weights, team](const Mats& in, Mats& out) {
    for_bands(*team, in[0].rows, Halo(vision::Filter7x7::kSize / 2), [&](const Band& band) {
      cv::Mat to = out[0].rowRange(band.rows);
      cv::filter2D(band.part(in[0]), to, CV_8U, weights, {-1, -1}, 0.0, cv::BORDER_REFLECT_101);
    });
  });
}

/// Both gradients in one pass over the picture.
std::unique_ptr<Kernel> make_sobel(const Workload&, std::span<const Tensor>, const Team& team) {
  return make([team](const Mats& in, Mats& out) {
    filter_in_bands(*team, in[0], out, Halo(1), [](const cv::Mat& from, Mats& to) {
      cv::spatialGradient(from, to[0], to[1], 3, cv::BORDER_REFLECT_101);
    });
  });
}

std::unique_ptr<Kernel> make_undistort(const Workload& workload, std::span<const Tensor>,
                                       const Team& team) {
  const auto& op = operation_as<vision::Undistort>(workload);
  const auto& c = op.camera;
  const cv::Matx33d matrix(c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
  const cv::Vec4d distortion(c.k1, c.k2, c.p1, c.p2);
  // Fixed-point maps: 1/32 pixel, what the workload is defined in.
  cv::Mat positions, fractions;
  cv::initUndistortRectifyMap(matrix, distortion, cv::noArray(), matrix, {op.width, op.height},
                              CV_16SC2, positions, fractions);
  return make([positions, fractions, team](const Mats& in, Mats& out) {
    for_bands(*team, out[0].rows, Halo::whole_picture(), [&](const Band& band) {
      cv::Mat to = out[0].rowRange(band.rows);
      cv::remap(band.surroundings(in[0]), to, positions.rowRange(band.rows),
                fractions.rowRange(band.rows), cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar());
    });
  });
}

/// cv::goodFeaturesToTrack in bands: OpenCV's own is one thread from the responses on.
class FeatureDetect : public Kernel {
 public:
  FeatureDetect(const vision::FeatureDetect& operation, Team team)
      : operation_(operation),
        team_(std::move(team)),
        response_(operation.height, operation.width, CV_32F),
        largest_(operation.height, operation.width, CV_32F) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    image_ = view(inputs[0]);
    list_ = &outputs[0];
  }

  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) detect();
    return std::nullopt;
  }

 private:
  using Op = vision::FeatureDetect;

  void detect() {
    peak_ = 0;
    candidates_.clear();
    constexpr int kGradient = 1;
    for_bands(*team_, image_.rows, Halo(kGradient + Op::kBlock / 2),
              [&](const Band& band) { respond(image_, band); });
    for_bands(*team_, image_.rows, Halo(1), [&](const Band& band) { collect(band); });
    vision::write_corners(vision::select_corners(candidates_, operation_), *list_);
  }

  /// Responses of the band, and their part of the peak.
  void respond(const cv::Mat& image, const Band& band) {
    cv::Mat response;
    cv::cornerMinEigenVal(band.surroundings(image), response, Op::kBlock, 3);
    cv::Mat own = response_.rowRange(band.rows);
    response.rowRange(band.rows.start - band.around.start, band.rows.end - band.around.start)
        .copyTo(own);
    double peak = 0;
    cv::minMaxLoc(own, nullptr, &peak);
    const std::lock_guard guard(merge_);
    peak_ = std::max(peak_, peak);
  }

  /// Candidates in the band: above the threshold, and no neighbour larger.
  void collect(const Band& band) {
    const cv::Range& rows = band.rows;
    cv::Mat largest = largest_.rowRange(rows);
    cv::dilate(band.part(response_), largest, cv::Mat());
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
    const std::lock_guard guard(merge_);
    candidates_.insert(candidates_.end(), found.begin(), found.end());
  }

  vision::FeatureDetect operation_;
  Team team_;
  cv::Mat image_;
  Tensor* list_ = nullptr;
  cv::Mat response_, largest_;
  double peak_ = 0;
  std::vector<std::uint64_t> candidates_;
  std::mutex merge_;
};

std::unique_ptr<Kernel> make_feature_detect(const Workload& workload, std::span<const Tensor>,
                                            const Team& team) {
  return std::make_unique<FeatureDetect>(operation_as<vision::FeatureDetect>(workload), team);
}

/// Dense Lucas-Kanade: products of derivatives, their window sums by box filters on integers, one
/// 2x2 system a pixel.
class OpticalFlow {
 public:
  OpticalFlow(int width, int height, Team team) : team_(std::move(team)) {
    for (auto& plane : derivatives_) plane.create(height, width, CV_16S);
    for (auto& plane : products_) plane.create(height, width, CV_32S);
    for (auto& plane : sums_) plane.create(height, width, CV_32S);
  }

  void operator()(const Mats& in, Mats& out) {
    const int height = in[0].rows;
    for_bands(*team_, height, Halo(1), [&](const Band& band) { multiply(in, band); });
    for_bands(*team_, height, Halo(vision::OpticalFlow::kWindow / 2), [&](const Band& band) {
      sum(band);
      for (int y = band.rows.start; y < band.rows.end; ++y) solve(y, out[0].ptr<float>(y));
    });
  }

 private:
  enum Derivative : std::uint8_t { kX, kY, kT };
  enum Product : std::uint8_t { kXX, kXY, kYY, kXT, kYT };
  static constexpr std::array<std::pair<Derivative, Derivative>, 5> kFactors = {
      {{kX, kX}, {kX, kY}, {kY, kY}, {kX, kT}, {kY, kT}}};

  void multiply(const Mats& in, const Band& band) {
    const cv::Range& rows = band.rows;
    const cv::Mat previous = band.part(in[0]);
    std::array<cv::Mat, 3> d;
    for (std::size_t i = 0; i < d.size(); ++i) d[i] = derivatives_[i].rowRange(rows);
    // An aperture of 1 is the plain difference [-1 0 1].
    cv::Sobel(previous, d[kX], CV_16S, 1, 0, 1, 1.0, 0.0, cv::BORDER_REPLICATE);
    cv::Sobel(previous, d[kY], CV_16S, 0, 1, 1, 1.0, 0.0, cv::BORDER_REPLICATE);
    cv::subtract(band.part(in[1]), previous, d[kT], cv::noArray(), CV_16S);
    for (std::size_t i = 0; i < kFactors.size(); ++i) {
      cv::Mat product = products_[i].rowRange(rows);
      cv::multiply(d[kFactors[i].first], d[kFactors[i].second], product, 1.0, CV_32S);
    }
  }

  void sum(const Band& band) {
    constexpr int kWindow = vision::OpticalFlow::kWindow;
    for (std::size_t i = 0; i < sums_.size(); ++i) {
      cv::Mat sums = sums_[i].rowRange(band.rows);
      cv::boxFilter(band.part(products_[i]), sums, CV_32S, {kWindow, kWindow},
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

  Team team_;
  std::array<cv::Mat, 3> derivatives_;
  std::array<cv::Mat, 5> products_, sums_;
};

std::unique_ptr<Kernel> make_optical_flow(const Workload& workload, std::span<const Tensor>,
                                          const Team& team) {
  const auto& op = operation_as<vision::OpticalFlow>(workload);
  return make(OpticalFlow(op.width, op.height, team));
}

constexpr std::array kVisionKernels = {
    CpuKernelEntry{"gaussian_blur", make_gaussian_blur},
    CpuKernelEntry{"filter7x7", make_filter7x7},
    CpuKernelEntry{"sobel", make_sobel},
    CpuKernelEntry{"undistort", make_undistort},
    CpuKernelEntry{"feature_detect", make_feature_detect},
    CpuKernelEntry{"optical_flow", make_optical_flow},
    CpuKernelEntry{"extract_features", make_extract_features},
    CpuKernelEntry{"track_features", make_track_features},
    CpuKernelEntry{"background_model", make_background_model},
};

}  // namespace

std::span<const CpuKernelEntry> vision_kernels() { return kVisionKernels; }

}  // namespace pirt::cpu
