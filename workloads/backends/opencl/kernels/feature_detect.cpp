// feature_detect: responses, threshold and local maxima on the device, which puts them in order too
// unless it is the host's cores; the distance rule, which is sequential, on the host within
// execute(). The result lies on the host, as the workload has it.
#include <cstring>

#include "workloads/backends/opencl/kernels/gradients.h"
#include "workloads/backends/opencl/kernels/packing.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/backends/opencl/plan/plan_kernel.h"
#include "workloads/vision/corners.h"

namespace pirt::opencl {
namespace {

/// Buffers that the host part resets and reads.
struct CandidateBuffers {
  cl::Buffer state;       ///< u32: bits of the peak response, number of candidates.
  cl::Buffer candidates;  ///< u64, see select_corners; room for each pixel.
};

class FeatureDetectKernel final : public PlanKernel {
 public:
  FeatureDetectKernel(DeviceSession session, const Workload& workload, Plan plan,
                      CandidateBuffers buffers)
      : PlanKernel(std::move(session), workload.name, std::move(plan)),
        operation_(operation_as<vision::FeatureDetect>(workload)),
        buffers_(std::move(buffers)) {}

  /// Hands over what execute() left on the host.
  void download() override {
    if (!host_outputs().empty()) vision::write_corners(corners_, host_outputs()[0]);
  }

 private:
  void compute(Launches& launches) override {
    session().queue.enqueueFillBuffer(buffers_.state, cl_uint{0}, 0, 2 * sizeof(cl_uint), nullptr,
                                      launches.next());
    enqueue(session(), plan(), launches);
    const auto found = transfers().read({.count = buffers_.state,
                                         .index = 1,
                                         .list = buffers_.candidates,
                                         .entry_bytes = sizeof(cl_ulong),
                                         .most = std::int64_t{operation_.width} * operation_.height,
                                         .of = "candidates"});
    found_.resize(found.size() / sizeof(cl_ulong));
    std::memcpy(found_.data(), found.data(), found.size());
    corners_ = vision::select_corners(found_, operation_);
  }

  vision::FeatureDetect operation_;
  CandidateBuffers buffers_;
  std::vector<std::uint64_t> found_;
  std::vector<vision::Corner> corners_;
};

}  // namespace

std::unique_ptr<Kernel> make_feature_detect(const DeviceSession& session, const Workload& workload,
                                            std::span<const Tensor> /*parameters*/) {
  using vision::FeatureDetect;
  static_assert(FeatureDetect::kBlock == 3, "features.cl sums 3x3 blocks");
  const auto& op = operation_as<FeatureDetect>(workload);
  const std::int64_t area = std::int64_t{op.width} * op.height;
  PlanBuilder builder(session);
  const DeviceTensor image = builder.resident(workload.inputs[0]);
  const cl::Buffer gx = builder.scratch(area * std::int64_t{sizeof(cl_short)});
  const cl::Buffer gy = builder.scratch(area * std::int64_t{sizeof(cl_short)});
  const cl::Buffer response = builder.scratch(area * std::int64_t{sizeof(cl_float)});
  const CandidateBuffers buffers{
      .state = builder.scratch(2 * std::int64_t{sizeof(cl_uint)}),
      .candidates = builder.scratch(area * std::int64_t{sizeof(cl_ulong)})};
  const int pixels = session.value(Parameter::kFeaturePixels);
  const Extent segments{blocks(op.width, pixels), op.height};
  append_gradients(builder, "features.cl", op, image, gx, gy);
  builder.step("features.cl", "corner_response", segments, gx, gy, response, buffers.state,
               op.width, op.height, pixels);
  // Sorting is quick on one core of the host's, and quicker on a thousand of a GPU's.
  const cl::Buffer found =
      session.is_cpu ? buffers.candidates : builder.scratch(area * std::int64_t{sizeof(cl_ulong)});
  builder.step("features.cl", "corner_candidates", segments, response, buffers.state, found,
               static_cast<float>(FeatureDetect::kQuality), op.width, op.height, pixels);
  if (!session.is_cpu) {
    builder.step("features.cl", "order_candidates", {.x = area}, buffers.state, found,
                 buffers.candidates);
  }
  return std::make_unique<FeatureDetectKernel>(session, workload, builder.finish({image}, {}),
                                               buffers);
}

}  // namespace pirt::opencl
