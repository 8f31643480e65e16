// gaussian_blur: the spec and the reference that defines it.
#include <array>

#include "workloads/vision/image_data.h"

namespace pirt::vision {
namespace {

std::vector<Tensor> reference(const GaussianBlur& op, const Data& data) {
  constexpr std::array kBinomial = {1, 4, 6, 4, 1};
  const Padded image(data.inputs[0].as<std::uint8_t>(), op.width, op.height, 2, reflect101);
  Tensor blurred(gray_spec("image", op.width, op.height));
  auto* out = blurred.as<std::uint8_t>().data();
  for (int y = 0; y < op.height; ++y) {
    for (int x = 0; x < op.width; ++x) {
      int sum = 0;
      for (int j = 0; j < 5; ++j) {
        for (int i = 0; i < 5; ++i) {
          sum += kBinomial[static_cast<std::size_t>(j)] * kBinomial[static_cast<std::size_t>(i)] *
                 image.row(y + j - 2)[x + i - 2];
        }
      }
      *out++ = static_cast<std::uint8_t>((sum + 128) >> 8);
    }
  }
  return only(std::move(blurred));
}

}  // namespace

Workload make_gaussian_blur(int width, int height) {
  auto op = std::make_shared<GaussianBlur>();
  op->width = width;
  op->height = height;

  Workload w;
  w.name = "gaussian_blur";
  w.description = "Gaussian blur 5x5, 8-bit grey " + size_text(width, height);
  w.tags = {"vision", "image"};
  w.kernel = "gaussian_blur";
  w.operation = op;
  w.inputs = {gray_spec("image", width, height)};
  w.outputs = {gray_spec("image", width, height)};
  w.ops = std::int64_t{2} * 5 * 5 * width * height;
  w.make_data = [=](const DataRequest& request) { return gray_data(request, width, height); };
  w.reference = [op](const Data& data) { return reference(*op, data); };
  w.verify = verify_exact;
  return w;
}

}  // namespace pirt::vision
