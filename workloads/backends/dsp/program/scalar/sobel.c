/* The scalar twin of ../sobel.c. */
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/program/picture.h"

void pirt_dsp_sobel(const KernelArguments* arguments) {
  const uint8_t* in = arguments->buffers[0];
  int16_t* out_x = arguments->buffers[1];
  int16_t* out_y = arguments->buffers[2];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];
  int16_t sum_line[kWidest + 2],
      difference_line[kWidest + 2]; /* down the columns, from column -1 on */
  for (int y = 0; y < height; ++y) {
    const uint8_t* restrict above = in + mirrored(y - 1, height) * stride;
    const uint8_t* restrict here = in + y * stride;
    const uint8_t* restrict below = in + mirrored(y + 1, height) * stride;
    int16_t* restrict sums = sum_line + 1;
    int16_t* restrict differences = difference_line + 1;
    for (int x = 0; x < width; ++x) {
      sums[x] = (int16_t)(above[x] + 2 * here[x] + below[x]);
      differences[x] = (int16_t)(below[x] - above[x]);
    }
    sums[-1] = sums[1];
    sums[width] = sums[width - 2];
    differences[-1] = differences[1];
    differences[width] = differences[width - 2];
    int16_t* restrict to_x = out_x + y * stride;
    int16_t* restrict to_y = out_y + y * stride;
    for (int x = 0; x < width; ++x) {
      to_x[x] = (int16_t)(sums[x + 1] - sums[x - 1]);
      to_y[x] = (int16_t)(differences[x - 1] + 2 * differences[x] + differences[x + 1]);
    }
  }
}
