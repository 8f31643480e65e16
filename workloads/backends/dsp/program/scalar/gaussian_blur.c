/* The scalar twin of ../gaussian_blur.c: the same separable filter in plain C. */
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/program/picture.h"

void pirt_dsp_gaussian_blur(const KernelArguments* arguments) {
  const uint8_t* in = arguments->buffers[0];
  uint8_t* out = arguments->buffers[1];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];
  uint16_t line[kWidest + 4]; /* sums down the columns, from column -2 on */
  for (int y = 0; y < height; ++y) {
    const uint8_t* restrict r0 = in + mirrored(y - 2, height) * stride;
    const uint8_t* restrict r1 = in + mirrored(y - 1, height) * stride;
    const uint8_t* restrict r2 = in + y * stride;
    const uint8_t* restrict r3 = in + mirrored(y + 1, height) * stride;
    const uint8_t* restrict r4 = in + mirrored(y + 2, height) * stride;
    uint16_t* restrict sums = line + 2;
    for (int x = 0; x < width; ++x) {
      sums[x] = (uint16_t)(r0[x] + r4[x] + 4 * (r1[x] + r3[x]) + 6 * r2[x]);
    }
    sums[-1] = sums[1];
    sums[-2] = sums[2];
    sums[width] = sums[width - 2];
    sums[width + 1] = sums[width - 3];
    uint8_t* restrict to = out + y * stride;
    for (int x = 0; x < width; ++x) {
      const int sum = sums[x - 2] + sums[x + 2] + 4 * (sums[x - 1] + sums[x + 1]) + 6 * sums[x];
      to[x] = (uint8_t)((sum + 128) >> 8);
    }
  }
}
