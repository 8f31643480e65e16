#include "workloads/mapping/specs.h"

#include "workloads/mapping/bal.h"
#include "workloads/model/host_function.h"

namespace pirt::mapping {

std::vector<Workload> specs() {
  std::vector<Workload> all;
  Workload& w = all.emplace_back();
  w.name = w.kernel = "bundle_adjust";
  w.description = "cameras and points of up to 100 images to the least reprojection error";
  w.tags = {"mapping"};
  // After its first look at the problem and between its iterations: of the sample 32, some of which
  // try a step more than once.
  w.operation = host_function(std::vector<double>(33, 1.0 / 33));
  // Whatever its unit is: squares of products of such numbers are numbers. Indices are judged by
  // what there is.
  constexpr Range kAny{-1e12, 1e12};
  w.inputs = {{"seen_by", Element::kI32, {kRoomForObservations, 2}, true},
              {"pixels", Element::kF64, {kRoomForObservations, 2}, true, {kAny}},
              {"cameras", Element::kF64, {kRoomForImages, kCameraSize}, true, {kAny}},
              {"points", Element::kF64, {kRoomForPoints, kPointSize}, true, {kAny}},
              {"fixed", Element::kU8, {kRoomForImages}, true},
              {"priors", Element::kF64, {kRoomForImages, kPriorSize}, true, {kAny}},
              {"pairs", Element::kI32, {kRoomForRelative, 2}, true},
              {"relative", Element::kF64, {kRoomForRelative, kRelativeSize}, true, {kAny}}};
  w.outputs = {{"poses", Element::kF64, {kRoomForImages, kPoseSize}, true},
               {"points", Element::kF64, {kRoomForPoints, kPointSize}, true},
               {"costs", Element::kF64, {2}},
               {"noise", Element::kF64, {2}}};
  return all;
}

}  // namespace pirt::mapping
