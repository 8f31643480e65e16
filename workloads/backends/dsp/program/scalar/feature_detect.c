/* The scalar twin of ../feature_detect.c, with the eigenvalues in f32. */
#include "workloads/backends/dsp/program/corners.h"
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/program/picture.h"

static float from_bits(uint32_t bits) {
  float value;
  __builtin_memcpy(&value, &bits, sizeof value);
  return value;
}
static uint32_t bits_of(float value) {
  uint32_t bits;
  __builtin_memcpy(&bits, &value, sizeof bits);
  return bits;
}

/* By Newton's iteration for 1 / sqrt(x); there is no C library. */
static float square_root(float x) {
  float r = from_bits(0x5f3759df - (bits_of(x) >> 1));
  for (int i = 0; i < 3; ++i) r = r * (1.5F - 0.5F * x * r * r);
  return x * r;
}

typedef struct {
  int32_t xx, xy, yy;
} Products;

static void sum_columns(const int16_t* const gx[3], const int16_t* const gy[3], Products* sums,
                        int width) {
  for (int x = 0; x < width; ++x) {
    Products sum = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
      sum.xx += gx[i][x] * gx[i][x];
      sum.xy += gx[i][x] * gy[i][x];
      sum.yy += gy[i][x] * gy[i][x];
    }
    sums[x] = sum;
  }
  sums[-1] = sums[1];
  sums[width] = sums[width - 2];
}

static float strength(const Products* sums) {
  const float xx = (float)(sums[-1].xx + sums[0].xx + sums[1].xx);
  const float xy = (float)(sums[-1].xy + sums[0].xy + sums[1].xy);
  const float yy = (float)(sums[-1].yy + sums[0].yy + sums[1].yy);
  const float value = xx + yy - square_root((xx - yy) * (xx - yy) + 4.0F * xy * xy);
  return value > 0.0F ? value : 0.0F;
}

/* Floats that are not negative are ordered as their bits are. */
static int find_maxima(const float* strengths, int width, int height, int stride, float threshold,
                       uint64_t* candidates) {
  int found = 0;
  for (int y = 1; y < height - 1; ++y) {
    for (int x = 1; x < width - 1; ++x) {
      const float* at = strengths + y * stride + x;
      if (*at <= threshold) continue;
      int is_maximum = 1;
      for (int j = -1; j <= 1 && is_maximum; ++j) {
        const float* row = at + j * stride;
        is_maximum = *at >= row[-1] && *at >= row[0] && *at >= row[1];
      }
      if (is_maximum) candidates[found++] = key_of((int32_t)bits_of(*at), x, y);
    }
  }
  return found;
}

void pirt_dsp_feature_detect(const KernelArguments* arguments) {
  float* corners = arguments->buffers[1];
  int32_t* count = arguments->buffers[2];
  int16_t* gx = arguments->buffers[3];
  int16_t* gy = arguments->buffers[4];
  float* strengths = arguments->buffers[5];
  uint32_t* occupied = arguments->buffers[6];
  uint64_t* candidates = arguments->buffers[7];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];

  const KernelArguments sobel = {{arguments->buffers[0], gx, gy}, arguments->values};
  pirt_dsp_sobel(&sobel);
  Products sums[kWidest + 2];
  float largest = 0.0F;
  for (int y = 0; y < height; ++y) {
    const int16_t *rows_x[3], *rows_y[3];
    for (int i = 0; i < 3; ++i) {
      rows_x[i] = gx + mirrored(y + i - 1, height) * stride;
      rows_y[i] = gy + mirrored(y + i - 1, height) * stride;
    }
    sum_columns(rows_x, rows_y, sums + 1, width);
    for (int x = 0; x < width; ++x) {
      const float value = strength(sums + 1 + x);
      strengths[y * stride + x] = value;
      if (value > largest) largest = value;
    }
  }
  const int found = find_maxima(strengths, width, height, stride, 0.01F * largest, candidates);

  const int words = stride / 32 + 2;
  const int rows = height + 2 * kDistance;
  for (int i = 0; i < rows * words; ++i) occupied[i] = 0;
  for (int i = 0; i < 2 * kMostCorners; ++i) corners[i] = 0.0F;
  const Occupied map = {occupied + kDistance * words + 1, words};
  *count = choose(candidates, found, map, corners);
}
