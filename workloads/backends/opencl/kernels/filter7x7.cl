// filter7x7 (definition: vision::make_convolution of workloads/vision/vision.h).
//
// Defined by the host (tuning.cpp):
//   FILTER_ROWS  rows that an item computes at once: 4 are 8 of AVX2's 16 registers.
#include "strips.cl"

/// Sums of at most 49 * 127 * 255 are exact in single precision, where a multiply-add is one
/// instruction.
INLINE void filter_strip(__global const uchar* image, __global uchar* filtered,
                         __constant const float* weights, int width, int height, int x, int first,
                         int end, const int side) {
  for (int y = first; y < end; y += FILTER_ROWS) {
    float16 sum[FILTER_ROWS];
#pragma unroll
    for (int o = 0; o < FILTER_ROWS; ++o) sum[o] = 0.0f;
#pragma unroll
    for (int r = 0; r < FILTER_ROWS + 6; ++r) {
      __global const uchar* p = image + reflect(y + r - 3, height) * width + x;
#pragma unroll
      for (int dx = 0; dx < 7; ++dx) {
        const float16 pixels = convert_float16(tap(p, dx - 3, side));
#pragma unroll
        for (int o = 0; o < FILTER_ROWS; ++o) {
          if (r - o >= 0 && r - o < 7) sum[o] += weights[(r - o) * 7 + dx] * pixels;
        }
      }
    }
#pragma unroll
    for (int o = 0; o < FILTER_ROWS; ++o) {
      if (y + o >= end) break;
      STORE(Bytes16, filtered + (y + o) * width + x, convert_uchar16_sat_rte(sum[o]));
    }
  }
}

uchar filter_pixel(__global const uchar* image, __constant const float* weights, int x, int y,
                   int width, int height) {
  float sum = 0.0f;
  for (int dy = 0; dy < 7; ++dy) {
    __global const uchar* row = image + reflect(y + dy - 3, height) * width;
    for (int dx = 0; dx < 7; ++dx) sum += weights[dy * 7 + dx] * row[reflect(x + dx - 3, width)];
  }
  return convert_uchar_sat_rte(sum);
}

/// @param weights  Over 2^8 already: exact, so that rounding halves to even is as defined.
__kernel void filter7x7(__global const uchar* restrict image, __global uchar* restrict filtered,
                        __constant const float* restrict weights, int width, int height, int rows) {
#define STRIP(x, side) filter_strip(image, filtered, weights, width, height, x, first, end, side)
#define PIXEL(x, y) filtered[(y) * width + (x)] = filter_pixel(image, weights, x, y, width, height)
  FOR_SEGMENT(3, STRIP, PIXEL)
#undef STRIP
#undef PIXEL
}
