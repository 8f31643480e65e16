// An own Sobel filter: horizontal and vertical gradient of a grey picture.
#include <pirt/module.hpp>
using namespace pirt::module;

void sobel(const Call& call) {
  const auto image = call.input<uint8_t>(0);
  const auto gx = call.output<int16_t>(0), gy = call.output<int16_t>(1);
  const auto reflected = [](int64_t p, int64_t end) {
    return p < 0 ? -p : p < end ? p : 2 * end - 2 - p;
  };
  for (int64_t y = 0; y < image.height(); ++y) {
    const uint8_t* rows[3];
    for (int i = 0; i < 3; ++i) rows[i] = &image(reflected(y + i - 1, image.height()), 0);
    for (int64_t x = 0; x < image.width(); ++x) {
      const int64_t l = reflected(x - 1, image.width()), r = reflected(x + 1, image.width());
      gx(y, x) = int16_t(rows[0][r] - rows[0][l] + 2 * (rows[1][r] - rows[1][l]) + rows[2][r] -
                         rows[2][l]);
      gy(y, x) = int16_t(rows[2][l] + 2 * rows[2][x] + rows[2][r] - rows[0][l] - 2 * rows[0][x] -
                         rows[0][r]);
    }
  }
}

PIRT_MODULE(Workload("mine.sobel")
                .size(1920, 1080)
                .input<uint8_t>("image", {kHeight, kWidth})
                .output<int16_t>("gx", {kHeight, kWidth})
                .output<int16_t>("gy", {kHeight, kWidth})
                .cpu<sobel>())
