// optical_flow: the spec and the reference that defines it.
#include <fmt/core.h>

#include <cmath>
#include <limits>

#include "workloads/vision/image_data.h"

namespace pirt::vision {
namespace {

constexpr int kBehind = OpticalFlow::kWindow / 2;  // the window begins at y-26

using Plane = std::vector<std::int64_t>;

/// dx, dy and dt of each pixel, row-major.
struct Derivatives {
  Plane dx, dy, dt;
};

Derivatives derivatives(const OpticalFlow& op, std::span<const std::uint8_t> previous,
                        std::span<const std::uint8_t> next) {
  const Padded image(previous, op.width, op.height, 1, replicate);
  Derivatives d;
  std::size_t i = 0;
  for (int y = 0; y < op.height; ++y) {
    for (int x = 0; x < op.width; ++x, ++i) {
      d.dx.push_back(image.row(y)[x + 1] - image.row(y)[x - 1]);
      d.dy.push_back(image.row(y + 1)[x] - image.row(y - 1)[x]);
      d.dt.push_back(int{next[i]} - int{previous[i]});
    }
  }
  return d;
}

/// Sum of a[i]*b[i] over the window of each pixel, the products replicated beyond the border; by a
/// summed-area table, whose integers are exact.
Plane window_sums(const OpticalFlow& op, const Plane& a, const Plane& b) {
  const auto width = static_cast<std::size_t>(op.width);
  const std::size_t stride = width + OpticalFlow::kWindow;
  const int rows = op.height + OpticalFlow::kWindow - 1;
  Plane table(stride * static_cast<std::size_t>(rows + 1), 0);
  for (int r = 0; r < rows; ++r) {
    const std::size_t line = static_cast<std::size_t>(replicate(r - kBehind, op.height)) * width;
    const auto* above = &table[static_cast<std::size_t>(r) * stride];
    auto* here = &table[static_cast<std::size_t>(r + 1) * stride];
    std::int64_t row_sum = 0;
    for (std::size_t c = 0; c + 1 < stride; ++c) {
      const std::size_t i =
          line + static_cast<std::size_t>(replicate(static_cast<int>(c) - kBehind, op.width));
      row_sum += a[i] * b[i];
      here[c + 1] = above[c + 1] + row_sum;
    }
  }
  Plane sums;
  sums.reserve(a.size());
  for (int y = 0; y < op.height; ++y) {
    const auto* top = &table[static_cast<std::size_t>(y) * stride];
    const auto* bottom = top + stride * OpticalFlow::kWindow;
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t end = x + OpticalFlow::kWindow;
      sums.push_back(bottom[end] - bottom[x] - top[end] + top[x]);
    }
  }
  return sums;
}

std::vector<Tensor> reference(const OpticalFlow& op, const Data& data) {
  const auto d =
      derivatives(op, data.inputs[0].as<std::uint8_t>(), data.inputs[1].as<std::uint8_t>());
  const Plane sxx = window_sums(op, d.dx, d.dx);
  const Plane sxy = window_sums(op, d.dx, d.dy);
  const Plane syy = window_sums(op, d.dy, d.dy);
  const Plane sxt = window_sums(op, d.dx, d.dt);
  const Plane syt = window_sums(op, d.dy, d.dt);
  Tensor flow({"flow", Element::kF64, {op.height, op.width, 2}});
  auto* out = flow.as<double>().data();
  // |sum| <= 255^2 * 52^2 = 1.8e8, so that 2 * (product - product) stays below 1.3e17 and fits 64
  // bits.
  for (std::size_t i = 0; i < sxx.size(); ++i, out += 2) {
    const std::int64_t det = sxx[i] * syy[i] - sxy[i] * sxy[i];
    if (det == 0) continue;
    out[0] =
        static_cast<double>(2 * (sxy[i] * syt[i] - syy[i] * sxt[i])) / static_cast<double>(det);
    out[1] =
        static_cast<double>(2 * (sxy[i] * sxt[i] - sxx[i] * syt[i])) / static_cast<double>(det);
  }
  return only(std::move(flow));
}

/// Each element on its own: |out - ref| <= 1e-6 |ref|. Numerator and denominator are exact integers
/// by definition; what is left is their conversion to f32 (2^-24 each) and the division (2.5 ulp
/// allowed by OpenCL), together at most 4.2e-7. A backend that divides in double has 2^-24
/// = 6.0e-8. Relative to the peak would not do: near-singular windows give huge flows.
Verdict verify_flow(std::span<const Tensor> outputs, std::span<const Tensor> expected) {
  constexpr double kRelative = 1e-6;
  const auto fail = [](std::string why) {
    return Verdict{false, std::numeric_limits<double>::infinity(), std::move(why)};
  };
  if (outputs.size() != 1 || expected.size() != 1 || outputs[0].spec().element != Element::kF32 ||
      expected[0].spec().element != Element::kF64 ||
      outputs[0].spec().shape != expected[0].spec().shape) {
    return fail("flow: one f32 tensor of the reference's shape is expected");
  }
  const auto got = outputs[0].as<float>();
  const auto want = expected[0].as<double>();
  double worst = 0.0;
  std::size_t worst_at = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    if (!std::isfinite(got[i])) return fail(fmt::format("flow: {} at element {}", got[i], i));
    const double error = std::abs(static_cast<double>(got[i]) - want[i]);
    if (error == 0.0) continue;
    const double relative = error / std::abs(want[i]);  // infinite where 0 is expected
    if (relative > worst) {
      worst = relative;
      worst_at = i;
    }
  }
  return {worst <= kRelative, worst,
          fmt::format("flow: worst relative error {:.3g} at element {} (got {:.7g}, expected "
                      "{:.7g}), bound {:.3g}",
                      worst, worst_at, got[worst_at], want[worst_at], kRelative)};
}

}  // namespace

Workload make_optical_flow(int width, int height) {
  auto op = std::make_shared<OpticalFlow>();
  op->width = width;
  op->height = height;

  Workload w;
  w.name = "optical_flow";
  w.description = "dense Lucas-Kanade, 52x52 window, 8-bit grey " + size_text(width, height);
  w.tags = {"vision", "image"};
  w.kernel = "optical_flow";
  w.operation = op;
  w.inputs = {gray_spec("previous", width, height), gray_spec("image", width, height)};
  w.outputs = {{"flow", Element::kF32, {height, width, 2}}};
  w.make_data = [=](const DataRequest& request) { return gray_pair_data(request, width, height); };
  w.reference = [op](const Data& data) { return reference(*op, data); };
  w.verify = verify_flow;
  return w;
}

}  // namespace pirt::vision
