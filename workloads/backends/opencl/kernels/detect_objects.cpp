// detect_objects: the convolutions of the generated detector on the device. The picture comes to
// the network's size on the host within upload(); what the last layer's numbers mean, and which
// boxes remain, is the host's within execute().
#include <fmt/core.h>

#include <utility>
#include <vector>

#include "workloads/backends/opencl/kernels/convolution.h"
#include "workloads/backends/opencl/plan/kernel_table.h"
#include "workloads/backends/opencl/plan/plan_kernel.h"
#include "workloads/recognition/generated_network.h"
#include "workloads/recognition/workloads.h"

namespace pirt::opencl {
namespace {

class DetectObjectsKernel final : public LaunchingKernel {
 public:
  DetectObjectsKernel(DeviceSession session, std::string workload, Plan plan)
      : LaunchingKernel(std::move(session), std::move(workload), plan.size_bytes),
        plan_(std::move(plan)),
        transfers_(this->session()),
        input_(plan_.inputs[0].spec),
        head_(plan_.outputs[0].spec) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    picture_ = &inputs[0];
    outputs_ = outputs;
  }

  void upload() override {
    translated(fmt::format("uploading the picture of {}", workload()), [&] {
      const auto numbers =
          recognition::network_input(*picture_, detector_.width, detector_.height,
                                     recognition::Fit::kStretch, recognition::Preprocess::kUnit);
      std::ranges::copy(numbers, input_.as<float>().begin());
      transfers_.write(plan_.inputs, std::span(&input_, 1));
    });
  }

 private:
  void compute(Launches& launches) override {
    enqueue(session(), plan_, launches);
    transfers_.read({{plan_.outputs, std::span(&head_, 1)}});
    found_ =
        recognition::candidates_of_head(detector_, head_.as<float>(), recognition::least_score());
    recognition::write_objects(found_, outputs_);
  }

  Plan plan_;
  Transfers transfers_;
  recognition::GeneratedNetwork detector_ = recognition::generated_detector();
  Tensor input_, head_;  ///< The network's own.
  const Tensor* picture_ = nullptr;
  std::span<Tensor> outputs_;
  std::vector<recognition::Candidate> found_;
};

dnn::ConvShape shape_of(const recognition::NetworkLayer& layer, int height, int width) {
  return {.in_c = layer.inputs,
          .in_h = height,
          .in_w = width,
          .out_c = layer.outputs,
          .k_h = layer.size,
          .k_w = layer.size,
          .stride = layer.stride,
          .pad = layer.size / 2};
}

TensorSpec maps(int channels, int height, int width) {
  return {"maps", Element::kF32, {channels, height, width}};
}

}  // namespace

std::unique_ptr<Kernel> make_detect_objects(const DeviceSession& session, const Workload& workload,
                                            std::span<const Tensor> parameters) {
  const auto detector = recognition::generated_detector();
  const auto layers = recognition::layers_of(detector);
  PlanBuilder builder(session);
  const DeviceTensor picture =
      builder.resident(maps(layers[0].inputs, detector.height, detector.width), layers[0].size / 2);
  auto weights = parameters[0].as<float>();
  DeviceTensor in = picture;
  int height = detector.height, width = detector.width;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const bool is_last = i + 1 == layers.size();
    const dnn::ConvShape shape = shape_of(layers[i], height, width);
    height = shape.out_h(), width = shape.out_w();
    const DeviceTensor out =
        builder.resident(maps(shape.out_c, height, width), is_last ? 0 : layers[i + 1].size / 2);
    const auto all = weights.first(recognition::weight_count(layers[i]));
    weights = weights.subspan(all.size());
    const auto outputs = static_cast<std::size_t>(shape.out_c);  // The biases come first.
    append_convolution(builder,
                       {.shape = shape,
                        .weights = all.subspan(outputs),
                        .bias = all.first(outputs),
                        .relu = !is_last},
                       in, out);
    in = out;
  }
  return std::make_unique<DetectObjectsKernel>(session, workload.name,
                                               builder.finish({picture}, {in}));
}

}  // namespace pirt::opencl
