#include <clblast.h>

#include <memory>
#include <stdexcept>
#include <vector>

#include "tests/bench/peers/kernels.h"
#include "workloads/dnn/dnn.h"

namespace pirt::bench {
namespace {

/// Handles of one convolution; they live as long as the process.
struct Convolution {
  cl_context context = nullptr;
  cl_command_queue queue = nullptr;
  cl_mem image = nullptr, weights = nullptr, result = nullptr;
  dnn::ConvShape shape;

  void run() {
    const auto of = [](int value) { return static_cast<std::size_t>(value); };
    const auto& s = shape;
    const auto status = clblast::Convgemm<float>(
        clblast::KernelMode::kCrossCorrelation, of(s.in_c), of(s.in_h), of(s.in_w), of(s.k_h),
        of(s.k_w), of(s.pad), of(s.pad), of(s.stride), of(s.stride), 1, 1, of(s.out_c), 1, image, 0,
        weights, 0, result, 0, &queue);
    if (status != clblast::StatusCode::kSuccess) {
      throw std::runtime_error("CLBlast failed: " + std::to_string(static_cast<int>(status)));
    }
    clFinish(queue);
  }
};

cl_device_id cpu_device() {
  cl_uint count = 0;
  clGetPlatformIDs(0, nullptr, &count);
  std::vector<cl_platform_id> platforms(count);
  clGetPlatformIDs(count, platforms.data(), nullptr);
  for (const auto platform : platforms) {
    cl_device_id device = nullptr;
    if (clGetDeviceIDs(platform, CL_DEVICE_TYPE_CPU, 1, &device, nullptr) == CL_SUCCESS) {
      return device;
    }
  }
  return nullptr;
}

}  // namespace

std::optional<Call> clblast_convolution(const Workload& workload, const Data& data) {
  static const cl_device_id device = cpu_device();
  if (device == nullptr) return std::nullopt;
  static const cl_context context = clCreateContext(nullptr, 1, &device, nullptr, nullptr, nullptr);
  static const cl_command_queue queue = clCreateCommandQueue(context, device, 0, nullptr);
  const auto buffer = [](const Tensor& tensor) {
    return clCreateBuffer(context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR, tensor.bytes().size(),
                          const_cast<std::byte*>(tensor.data()), nullptr);
  };
  auto convolution = std::make_shared<Convolution>();
  convolution->context = context;
  convolution->queue = queue;
  convolution->shape = operation_as<dnn::Conv2dRelu>(workload).shape;
  convolution->image = buffer(data.inputs[0]);
  convolution->weights = buffer(data.parameters[0]);
  convolution->result = buffer(Tensor(workload.outputs[0]));
  return [convolution] { convolution->run(); };
}

}  // namespace pirt::bench
