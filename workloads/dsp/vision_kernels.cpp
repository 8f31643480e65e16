// The vision workloads: pictures in rows that begin at multiples of a vector.
#include <fmt/format.h>

#include <array>

#include "workloads/dsp/kernels.h"
#include "workloads/vision/vision.h"

namespace pirt::dsp {
namespace {

/// Kernels mirror a picture once at each edge.
std::string smaller_than(const Workload& workload, int width, int height) {
  const auto& op = operation_as<vision::ImageOperation>(workload);
  if (op.width >= width && op.height >= height) return "";
  return fmt::format("backend dsp computes pictures of at least {}x{} pixels", width, height);
}

/// A call whose buffers are its inputs and outputs and whose values are width, height and pitch.
Call picture_call(Session& session, const Workload& workload, std::uint32_t kernel) {
  const auto& op = operation_as<vision::ImageOperation>(workload);
  Call call;
  call.kernel = kernel;
  call.name = workload.name;
  for (const TensorSpec& spec : workload.inputs) {
    call.inputs.push_back(make_resident(session, spec));
    call.buffers.push_back(call.inputs.back().buffer);
  }
  for (const TensorSpec& spec : workload.outputs) {
    call.outputs.push_back(make_resident(session, spec));
    call.buffers.push_back(call.outputs.back().buffer);
  }
  call.values = {op.width, op.height, static_cast<std::int32_t>(call.inputs[0].pitch_bytes)};
  return call;
}

Call make_gaussian_blur(Session& session, const Workload& workload, std::span<const Tensor>) {
  return picture_call(session, workload, PIRT_DSP_gaussian_blur);
}

constexpr std::array kKernels = {
    KernelEntry{"gaussian_blur", [](const Workload& w) { return smaller_than(w, 3, 3); },
                make_gaussian_blur},
};

}  // namespace

std::span<const KernelEntry> vision_kernels() { return kKernels; }

}  // namespace pirt::dsp
