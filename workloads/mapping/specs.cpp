#include "workloads/mapping/specs.h"

#include "workloads/mapping/bal.h"

namespace pirt::mapping {

std::vector<Workload> specs() {
  std::vector<Workload> all;
  Workload& w = all.emplace_back();
  w.name = w.kernel = "bundle_adjust";
  w.description = "cameras and points of up to 100 images to the least reprojection error";
  w.tags = {"mapping"};
  w.inputs = {{"seen_by", Element::kI32, {kRoomForObservations, 2}, true},
              {"pixels", Element::kF64, {kRoomForObservations, 2}, true},
              {"cameras", Element::kF64, {kRoomForImages, kCameraSize}, true},
              {"points", Element::kF64, {kRoomForPoints, kPointSize}, true},
              {"fixed", Element::kU8, {kRoomForImages}, true},
              {"priors", Element::kF64, {kRoomForImages, kPriorSize}, true},
              {"pairs", Element::kI32, {kRoomForRelative, 2}, true},
              {"relative", Element::kF64, {kRoomForRelative, kRelativeSize}, true}};
  w.outputs = {{"poses", Element::kF64, {kRoomForImages, kPoseSize}, true},
               {"points", Element::kF64, {kRoomForPoints, kPointSize}, true},
               {"costs", Element::kF64, {2}},
               {"noise", Element::kF64, {2}}};
  return all;
}

}  // namespace pirt::mapping
