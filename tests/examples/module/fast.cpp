// The same Sobel filter by OpenCV, as pirt's own is on backend cpu:
// pirt regress --as fast.sobel=sobel@640x480 --workloads ./libfast.so --units cpu
#include <opencv2/imgproc.hpp>
#include <pirt/module.hpp>
using namespace pirt::module;

template <typename T>
cv::Mat picture(const View<T>& view, int type) {
  auto* const data = const_cast<std::remove_const_t<T>*>(view.data());
  return cv::Mat(int(view.height()), int(view.width()), type, data);
}

void sobel(const Call& call) {
  if (cv::getNumThreads() != call.threads())
    cv::setNumThreads(call.threads());  // the first takes 2 ms
  cv::Mat gx = picture(call.output<int16_t>(0), CV_16S),
          gy = picture(call.output<int16_t>(1), CV_16S);
  cv::spatialGradient(picture(call.input<uint8_t>(0), CV_8U), gx, gy, 3, cv::BORDER_REFLECT_101);
}

PIRT_MODULE(Workload("fast.sobel")
                .size(640, 480)
                .input<uint8_t>("image", {kHeight, kWidth})
                .output<int16_t>("gx", {kHeight, kWidth})
                .output<int16_t>("gy", {kHeight, kWidth})
                .cpu<sobel>())
