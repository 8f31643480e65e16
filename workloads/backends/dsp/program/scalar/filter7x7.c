/* The scalar twin of ../filter7x7.c: 49 products a pixel, in rows that have their borders with
 * them. */
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/program/picture.h"

enum { kSize = 7, kRadius = 3 };

static uint8_t rounded(int sum) {
  const int value = (sum + 127 + (sum >> 8 & 1)) >> 8;
  return (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
}

static void load_row(const uint8_t* restrict from, uint8_t* restrict to, int width) {
  for (int x = 0; x < width; ++x) to[x + kRadius] = from[x];
  for (int i = 1; i <= kRadius; ++i) {
    to[kRadius - i] = from[i];
    to[width - 1 + kRadius + i] = from[width - 1 - i];
  }
}

void pirt_dsp_filter7x7(const KernelArguments* arguments) {
  const uint8_t* in = arguments->buffers[0];
  uint8_t* out = arguments->buffers[1];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];
  const int8_t* packed = (const int8_t*)(arguments->values + 3);
  int32_t weights[kSize][kSize];
  for (int j = 0; j < kSize; ++j) {
    for (int i = 0; i < kSize; ++i) weights[j][i] = packed[8 * j + i];
  }
  uint8_t rows[kSize][kWidest + 2 * kRadius];
  for (int j = 0; j + 1 < kSize; ++j) {
    load_row(in + mirrored(j - kRadius, height) * stride, rows[j], width);
  }
  for (int y = 0; y < height; ++y) {
    load_row(in + mirrored(y + kRadius, height) * stride, rows[(y + kSize - 1) % kSize], width);
    int32_t sums[kWidest];
    for (int x = 0; x < width; ++x) sums[x] = 0;
    for (int j = 0; j < kSize; ++j) {
      const uint8_t* restrict row = rows[(y + j) % kSize];
      const int32_t* w = weights[j];
      for (int x = 0; x < width; ++x) {
        sums[x] += w[0] * row[x] + w[1] * row[x + 1] + w[2] * row[x + 2] + w[3] * row[x + 3] +
                   w[4] * row[x + 4] + w[5] * row[x + 5] + w[6] * row[x + 6];
      }
    }
    for (int x = 0; x < width; ++x) out[y * stride + x] = rounded(sums[x]);
  }
}
