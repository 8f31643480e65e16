// An own Sobel filter: horizontal and vertical gradient of a grey picture.
#include <pirt/module.hpp>
using namespace pirt::module;

void sobel(const Call& call) {
  const auto image = call.input<uint8_t>(0);
  const auto gx = call.output<int16_t>(0), gy = call.output<int16_t>(1);
  const auto at = [](int64_t p, int64_t n) { return p < 0 ? -p : p < n ? p : 2 * n - 2 - p; };
  const auto row = [&](int64_t y) { return &image(at(y, image.height()), 0); };
  for (int64_t y = 0; y < image.height(); ++y) {
    const uint8_t *a = row(y - 1), *b = row(y), *c = row(y + 1);
    for (int64_t x = 0; x < image.width(); ++x) {
      const int64_t l = at(x - 1, image.width()), r = at(x + 1, image.width());
      gx(y, x) = int16_t(a[r] - a[l] + 2 * (b[r] - b[l]) + c[r] - c[l]);
      gy(y, x) = int16_t(c[l] + 2 * c[x] + c[r] - a[l] - 2 * a[x] - a[r]);
    }
  }
}

PIRT_MODULE(Workload("mine.sobel")
                .size(1920, 1080)
                .input<uint8_t>("image", {kHeight, kWidth})
                .output<int16_t>("gx", {kHeight, kWidth})
                .output<int16_t>("gy", {kHeight, kWidth})
                .cpu<sobel>())
