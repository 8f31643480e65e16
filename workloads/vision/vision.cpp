// The six vision workloads of Table I at the paper's sizes.
#include "workloads/vision/vision.h"

namespace pirt::vision {

std::vector<Workload> table1() {
  std::vector<Workload> all = {make_gaussian_blur(640, 480),  make_convolution(640, 480),
                               make_sobel(1920, 1080),        make_undistort(640, 480),
                               make_feature_detect(640, 480), make_optical_flow(640, 480)};
  for (auto& workload : all) workload.tags.insert(workload.tags.begin(), "table1");
  return all;
}

}  // namespace pirt::vision
