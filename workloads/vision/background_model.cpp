// background_model: the spec and the step that defines it.
#include <algorithm>
#include <cmath>

#include "workloads/vision/image_data.h"

namespace pirt::vision {
namespace {

constexpr int kFrames = 8;

std::vector<Tensor> step(const TensorSpec& mask_spec, std::span<Tensor> state, const Data& data) {
  const auto image = data.inputs[0].as<std::uint8_t>();
  const auto background = state[0].as<float>();
  int& frames = state[1].as<std::int32_t>()[0];
  Tensor mask(mask_spec);
  const auto out = mask.as<std::uint8_t>();
  for (std::size_t i = 0; i < image.size(); ++i) {
    const float difference = static_cast<float>(image[i]) - background[i];
    const bool differs = std::abs(difference) > BackgroundModel::kThreshold;
    out[i] = frames > 0 && differs ? 255 : 0;
    background[i] += std::ldexp(difference, -frames);
  }
  frames = std::min(frames + 1, BackgroundModel::kMaxShift);
  return only(std::move(mask));
}

}  // namespace

Workload make_background_model(int width, int height) {
  auto op = std::make_shared<BackgroundModel>();
  op->width = width;
  op->height = height;

  Workload w;
  w.name = "background_model";
  w.description = "exponential background and what differs, 8-bit grey " + size_text(width, height);
  w.tags = {"vision", "image"};
  w.kernel = "background_model";
  w.operation = op;
  w.inputs = {gray_spec("image", width, height)};
  w.outputs = {gray_spec("mask", width, height)};
  w.state = StateSpec{
      .name = "background",
      .tensors = {{"background", Element::kF32, {height, width}}, {"frames", Element::kI32, {1}}}};
  w.frames = kFrames;
  // A subtraction, a comparison, a multiply-add.
  w.ops = std::int64_t{4} * width * height;
  w.make_data = [=](const DataRequest& request) { return gray_frame_data(request, width, height); };
  w.make_state = [specs = w.state->tensors] { return make_tensors(specs); };
  w.step = [mask = w.outputs[0]](std::span<Tensor> state, const Data& data) {
    return step(mask, state, data);
  };
  w.verify = verify_exact;
  return w;
}

}  // namespace pirt::vision
