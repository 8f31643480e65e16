// sobel: the spec and the reference that defines it.
#include <algorithm>

#include "workloads/vision/image_data.h"

namespace pirt::vision {
namespace {

Tensor to_i16(TensorSpec spec, std::span<const int> values) {
  Tensor tensor(std::move(spec));
  std::ranges::transform(values, tensor.as<std::int16_t>().begin(),
                         [](int value) { return static_cast<std::int16_t>(value); });
  return tensor;
}

}  // namespace

Workload make_sobel(int width, int height) {
  auto op = std::make_shared<Sobel>();
  op->width = width;
  op->height = height;

  Workload w;
  w.name = "sobel";
  w.description = "Sobel 3x3, Gx and Gy, 8-bit grey " + size_text(width, height);
  w.tags = {"vision", "image"};
  w.kernel = "sobel";
  w.operation = op;
  w.inputs = {gray_spec("image", width, height)};
  w.outputs = {{"gx", Element::kI16, {height, width}}, {"gy", Element::kI16, {height, width}}};
  // As the paper counts: two dense 3x3 kernels, although a third of their weights is zero.
  w.ops = std::int64_t{2} * 2 * 9 * width * height;
  w.make_data = [=](const DataRequest& request) { return gray_data(request, width, height); };
  w.reference = [op, specs = w.outputs](const Data& data) {
    const auto gradients =
        sobel_gradients(data.inputs[0].as<std::uint8_t>(), op->width, op->height);
    std::vector<Tensor> outputs;
    outputs.push_back(to_i16(specs[0], gradients.gx));
    outputs.push_back(to_i16(specs[1], gradients.gy));
    return outputs;
  };
  w.verify = verify_exact;
  return w;
}

}  // namespace pirt::vision
