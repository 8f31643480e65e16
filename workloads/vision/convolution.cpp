// convolution: the spec and the reference that defines it.
#include <algorithm>
#include <numeric>

#include "workloads/base/math/random.h"
#include "workloads/vision/image_data.h"

namespace pirt::vision {
namespace {

constexpr int kSize = Filter7x7::kSize;
constexpr int kMargin = kSize / 2;

/// Seeded weights whose sum is exactly 2^kShift, so that the brightness of a picture stays.
Tensor make_weights(const TensorSpec& spec, std::uint64_t seed) {
  constexpr int kTarget = 1 << Filter7x7::kShift;
  Tensor weights(spec);
  auto w = weights.as<std::int16_t>();
  Random random(derive_seed(seed, "convolution.weights"));
  for (auto& value : w) value = static_cast<std::int16_t>(static_cast<int>(random.below(101)) - 45);
  // The mean of the draw is 5 and 49 * 5 = 245: what is missing is small and goes round the kernel
  // one by one. From |w| <= 55 and a sum within 49 * 55 of the target, no weight can leave |w| <=
  // 127.
  int missing = kTarget - std::accumulate(w.begin(), w.end(), 0);
  for (std::size_t i = 0; missing != 0; i = (i + 1) % w.size()) {
    const int step = missing > 0 ? 1 : -1;
    w[i] = static_cast<std::int16_t>(w[i] + step);
    missing -= step;
  }
  return weights;
}

/// sum / 2^kShift, halves to the even neighbour, saturated.
std::uint8_t scale(int sum) {
  constexpr int kHalf = 1 << (Filter7x7::kShift - 1);
  const int floor = sum >> Filter7x7::kShift;
  const int rest = sum - (floor << Filter7x7::kShift);
  const bool up = rest > kHalf || (rest == kHalf && (floor & 1) != 0);
  return static_cast<std::uint8_t>(std::clamp(floor + (up ? 1 : 0), 0, 255));
}

std::vector<Tensor> reference(const Filter7x7& op, const Data& data) {
  const Padded image(data.inputs[0].as<std::uint8_t>(), op.width, op.height, kMargin, reflect101);
  const auto weights = data.parameters[0].as<std::int16_t>();
  Tensor filtered(gray_spec("image", op.width, op.height));
  auto* out = filtered.as<std::uint8_t>().data();
  for (int y = 0; y < op.height; ++y) {
    for (int x = 0; x < op.width; ++x) {
      int sum = 0;
      for (int j = 0; j < kSize; ++j) {
        const int* line = image.row(y + j - kMargin) + x - kMargin;
        const auto* row = &weights[static_cast<std::size_t>(j) * kSize];
        for (int i = 0; i < kSize; ++i) sum += row[i] * line[i];
      }
      *out++ = scale(sum);
    }
  }
  return only(std::move(filtered));
}

}  // namespace

Workload make_convolution(int width, int height) {
  auto op = std::make_shared<Filter7x7>();
  op->width = width;
  op->height = height;

  Workload w;
  w.name = "convolution";
  w.description = "general 7x7 convolution, 8-bit grey " + size_text(width, height);
  w.tags = {"vision", "image"};
  w.kernel = "filter7x7";
  w.operation = op;
  w.inputs = {gray_spec("image", width, height)};
  w.parameters = {{"weights", Element::kI16, {kSize, kSize}}};
  w.outputs = {gray_spec("image", width, height)};
  w.ops = std::int64_t{2} * kSize * kSize * width * height;
  w.make_data = [=, spec = w.parameters[0]](const DataRequest& request) {
    Data data = gray_data(request, width, height);
    data.parameters.push_back(make_weights(spec, request.seed));
    return data;
  };
  w.reference = [op](const Data& data) { return reference(*op, data); };
  w.verify = verify_exact;
  return w;
}

}  // namespace pirt::vision
