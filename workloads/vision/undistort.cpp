// undistort: the spec, its camera, and the map and reference that define it.
#include <algorithm>
#include <cmath>

#include "workloads/base/math/pixel_index.h"
#include "workloads/vision/image_data.h"

namespace pirt::vision {
namespace {

/// The lens of EuRoC's left camera (752x480, f = 458 px; Burri et al., The EuRoC micro aerial
/// vehicle datasets, IJRR 2016) with its coefficients rounded, scaled to the picture. The longer
/// side sets the focal length, so that the field of view, and with it the polynomial's reach, stays
/// that of a real lens for every aspect.
Camera make_camera(int width, int height) {
  const double scale = std::max(width, height) / 752.0;
  Camera camera;
  camera.fx = 458.654 * scale;
  camera.fy = 457.296 * scale;
  camera.cx = 367.215 / 752.0 * width;
  camera.cy = 248.375 / 480.0 * height;
  camera.k1 = -0.28;
  camera.k2 = 0.07;
  camera.p1 = 2e-4;
  camera.p2 = 2e-5;
  return camera;
}

std::vector<Tensor> reference(const Undistort& op, const Data& data) {
  Tensor out(gray_spec("image", op.width, op.height));
  std::ranges::copy(undistorted(op, data.inputs[0].as<std::uint8_t>()),
                    out.as<std::uint8_t>().begin());
  return only(std::move(out));
}

}  // namespace

std::vector<MapEntry> undistort_map(const Undistort& operation) {
  const Camera& c = operation.camera;
  // lrint rounds halves to even in the default rounding mode.
  const auto fixed = [](double u) { return static_cast<std::int32_t>(std::lrint(32.0 * u)); };
  std::vector<MapEntry> map;
  map.reserve(static_cast<std::size_t>(operation.width) *
              static_cast<std::size_t>(operation.height));
  for (int row = 0; row < operation.height; ++row) {
    for (int column = 0; column < operation.width; ++column) {
      const double x = (column - c.cx) / c.fx;
      const double y = (row - c.cy) / c.fy;
      const double r2 = x * x + y * y;
      const double radial = 1.0 + r2 * (c.k1 + r2 * c.k2);
      const double xd = x * radial + 2.0 * c.p1 * x * y + c.p2 * (r2 + 2.0 * x * x);
      const double yd = y * radial + c.p1 * (r2 + 2.0 * y * y) + 2.0 * c.p2 * x * y;
      map.push_back({fixed(c.fx * xd + c.cx), fixed(c.fy * yd + c.cy)});
    }
  }
  return map;
}

std::vector<std::uint8_t> undistorted(const Undistort& op, std::span<const std::uint8_t> image) {
  const auto pixel = [&](int x, int y) -> int {
    if (x < 0 || y < 0 || x >= op.width || y >= op.height) return 0;
    return image[pixel_index(x, y, op.width)];
  };
  std::vector<std::uint8_t> out;
  out.reserve(image.size());
  for (const MapEntry& entry : undistort_map(op)) {
    const int x = entry.x >> 5;
    const int y = entry.y >> 5;
    const int fx = entry.x & 31;
    const int fy = entry.y & 31;
    const int sum = (32 - fx) * (32 - fy) * pixel(x, y) + fx * (32 - fy) * pixel(x + 1, y) +
                    (32 - fx) * fy * pixel(x, y + 1) + fx * fy * pixel(x + 1, y + 1);
    out.push_back(static_cast<std::uint8_t>((sum + 512) >> 10));
  }
  return out;
}

Workload make_undistort(int width, int height) {
  auto op = std::make_shared<Undistort>();
  op->width = width;
  op->height = height;
  op->camera = make_camera(width, height);

  Workload w;
  w.name = "undistort";
  w.description = "undistortion k1 k2 p1 p2, bilinear, 8-bit grey " + size_text(width, height);
  w.tags = {"vision", "image"};
  w.kernel = "undistort";
  w.operation = op;
  w.inputs = {gray_spec("image", width, height)};
  w.outputs = {gray_spec("image", width, height)};
  w.make_data = [=](const DataRequest& request) { return gray_data(request, width, height); };
  w.reference = [op](const Data& data) { return reference(*op, data); };
  w.verify = verify_exact;
  return w;
}

}  // namespace pirt::vision
