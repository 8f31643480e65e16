// The vision workloads by plain calls of OpenCV, on Mat and on UMat.
#include <stdlib.h>

#include <memory>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/ocl.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "tests/bench/peers/kernels.h"
#include "workloads/base/error.h"
#include "workloads/vision/vision.h"

namespace pirt::bench {
namespace {

cv::Mat view(const Tensor& tensor) {
  const auto& shape = tensor.spec().shape;
  const int depth = tensor.spec().element == Element::kU8 ? CV_8U : CV_16S;
  return {static_cast<int>(shape[0]), static_cast<int>(shape[1]), depth,
          const_cast<std::byte*>(tensor.data())};
}

/// What a workload needs on the way; Image is Mat or UMat.
template <typename Image>
struct State {
  std::vector<Image> inputs;
  std::vector<Image> between = std::vector<Image>(16);
  std::vector<Image> outputs = std::vector<Image>(2);
  Image map, fractions;
  cv::Mat weights;
  std::vector<cv::Point2f> corners;
};

/// Dense Lucas-Kanade in single precision, composed of OpenCV's calls.
template <typename Image>
void flow(State<Image>& s) {
  constexpr int kWindow = vision::OpticalFlow::kWindow;
  auto& b = s.between;
  const Image &previous = s.inputs[0], &next = s.inputs[1];
  cv::Sobel(previous, b[0], CV_32F, 1, 0, 1, 1.0, 0.0, cv::BORDER_REPLICATE);
  cv::Sobel(previous, b[1], CV_32F, 0, 1, 1, 1.0, 0.0, cv::BORDER_REPLICATE);
  cv::subtract(next, previous, b[2], cv::noArray(), CV_32F);
  const int factors[5][2] = {{0, 0}, {0, 1}, {1, 1}, {0, 2}, {1, 2}};
  for (int i = 0; i < 5; ++i) {
    const auto at = static_cast<std::size_t>(3 + i);
    cv::multiply(b[static_cast<std::size_t>(factors[i][0])],
                 b[static_cast<std::size_t>(factors[i][1])], b[at]);
    cv::boxFilter(b[at], b[at], CV_32F, {kWindow, kWindow}, {kWindow / 2, kWindow / 2}, false,
                  cv::BORDER_REPLICATE);
  }
  const Image &xx = b[3], &xy = b[4], &yy = b[5], &xt = b[6], &yt = b[7];
  const auto determinant = [&](const Image& p, const Image& q, const Image& r, const Image& t,
                               Image& result) {  // p * q - r * t
    cv::multiply(p, q, b[8]);
    cv::multiply(r, t, b[9]);
    cv::subtract(b[8], b[9], result);
  };
  determinant(xx, yy, xy, xy, b[10]);
  determinant(xy, yt, yy, xt, b[11]);
  determinant(xy, xt, xx, yt, b[12]);
  cv::divide(b[11], b[10], s.outputs[0], 2.0);
  cv::divide(b[12], b[10], s.outputs[1], 2.0);
}

template <typename Image>
std::function<void(State<Image>&)> function_of(const Workload& workload) {
  constexpr auto kReflect = cv::BORDER_REFLECT_101;
  if (workload.kernel == "gaussian_blur") {
    return [](State<Image>& s) {
      cv::GaussianBlur(s.inputs[0], s.outputs[0], {5, 5}, 0.0, 0.0, kReflect);
    };
  }
  if (workload.kernel == "filter7x7") {
    return [](State<Image>& s) {
      cv::filter2D(s.inputs[0], s.outputs[0], CV_8U, s.weights, {-1, -1}, 0.0, kReflect);
    };
  }
  if (workload.kernel == "sobel") {
    return [](State<Image>& s) {
      cv::Sobel(s.inputs[0], s.outputs[0], CV_16S, 1, 0, 3, 1.0, 0.0, kReflect);
      cv::Sobel(s.inputs[0], s.outputs[1], CV_16S, 0, 1, 3, 1.0, 0.0, kReflect);
    };
  }
  if (workload.kernel == "undistort") {
    return [](State<Image>& s) {
      cv::remap(s.inputs[0], s.outputs[0], s.map, s.fractions, cv::INTER_LINEAR,
                cv::BORDER_CONSTANT);
    };
  }
  if (workload.kernel == "feature_detect") {
    using Op = vision::FeatureDetect;
    return [](State<Image>& s) {
      cv::goodFeaturesToTrack(s.inputs[0], s.corners, Op::kMaxCorners, Op::kQuality,
                              Op::kMinDistance, cv::noArray(), Op::kBlock);
    };
  }
  if (workload.kernel == "optical_flow") return flow<Image>;
  throw_bad_input("no peer for " + workload.name);
}

template <typename Image>
std::shared_ptr<State<Image>> state_of(const Workload& workload, const Data& data) {
  auto state = std::make_shared<State<Image>>();
  for (const Tensor& tensor : data.inputs) {
    state->inputs.emplace_back();
    view(tensor).copyTo(state->inputs.back());
  }
  if (workload.kernel == "filter7x7") {
    view(data.parameters[0])
        .convertTo(state->weights, CV_32F, 1.0 / (1 << vision::Filter7x7::kShift));
  }
  if (workload.kernel == "undistort") {
    const auto& op = operation_as<vision::Undistort>(workload);
    const auto& c = op.camera;
    const cv::Matx33d matrix(c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
    cv::Mat map, fractions;
    cv::initUndistortRectifyMap(matrix, cv::Vec4d(c.k1, c.k2, c.p1, c.p2), cv::noArray(), matrix,
                                {op.width, op.height}, CV_16SC2, map, fractions);
    map.copyTo(state->map);
    fractions.copyTo(state->fractions);
  }
  return state;
}

}  // namespace

Call opencv_plain(const Workload& workload, const Data& data) {
  const auto state = state_of<cv::Mat>(workload, data);
  return [state, run = function_of<cv::Mat>(workload)] {
    // Backend cpu keeps OpenCV to the calling thread.
    if (cv::getNumThreads() == 1) cv::setNumThreads(cv::getNumberOfCPUs());
    run(*state);
  };
}

std::optional<Call> opencv_opencl(const Workload& workload, const Data& data) {
  ::setenv("OPENCV_OPENCL_DEVICE", ":CPU:", 0);  // it takes GPUs only by itself
  if (!cv::ocl::haveOpenCL()) return std::nullopt;
  cv::ocl::setUseOpenCL(true);
  if (!cv::ocl::useOpenCL()) return std::nullopt;
  const auto state = state_of<cv::UMat>(workload, data);
  return [state, run = function_of<cv::UMat>(workload)] {
    run(*state);
    cv::ocl::finish();
  };
}

std::string opencv_opencl_device() {
  return cv::ocl::useOpenCL() ? std::string(cv::ocl::Device::getDefault().name()) : "none";
}

}  // namespace pirt::bench
