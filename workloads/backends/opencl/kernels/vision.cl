// The vision workloads (workloads/vision/vision.h has the definitions) in plain OpenCL C 1.2.
//
// A work item of blur, filter and gradients computes 16 columns of `rows` rows, top to bottom, and
// keeps what neighbouring rows share in registers. Segments begin at columns 0, 16, 32, ...; the
// last one is moved back to end with the row, the one before it where it would look beyond the row,
// and they write some pixels again, with the same values. Where a segment touches the left or right
// border, the columns beyond it are shuffled out of its own. Pictures too narrow for that go pixel
// by pixel. Global ids are (segment, strip of rows). Integer results are exact.
//
// Defined by the host (tuning.cpp):
//   FILTER_ROWS  rows that an item of filter7x7 computes at once: 4 are 8 of AVX2's 16 registers.

#include "border.cl"
#include "lanes.cl"

#define MIDDLE 0
#define LEFT 1
#define RIGHT 2

/// 16 pixels beginning at p + dx, -3 <= dx <= 3, reflected at the side that p's segment touches.
/// dx and side are constants where this is inlined.
INLINE uchar16 tap(__global const uchar* p, const int dx, const int side) {
  if (dx < 0 && side == LEFT) {
    const uchar16 v = LOAD(Bytes16, p);
    if (dx == -1) return v.s10123456789abcde;
    if (dx == -2) return v.s210123456789abcd;
    return v.s3210123456789abc;
  }
  if (dx > 0 && side == RIGHT) {
    const uchar16 v = LOAD(Bytes16, p);
    if (dx == 1) return v.s123456789abcdefe;
    if (dx == 2) return v.s23456789abcdefed;
    return v.s3456789abcdefedc;
  }
  return LOAD(Bytes16, p + dx);
}

/// Calls STRIP(x, side) for this item's segment, or PIXEL(x, y) for all pixels of its strip where
/// the picture is narrower than 16 + `reach` columns.
#define FOR_SEGMENT(reach, STRIP, PIXEL)                                    \
  const int segment = (int)get_global_id(0) * 16;                           \
  const int first = (int)get_global_id(1) * rows;                           \
  const int end = min(first + rows, height);                                \
  if (segment >= width) return;                                             \
  if (width < 16 + (reach)) {                                               \
    for (int y = first; y < end; ++y)                                       \
      for (int x = segment; x < min(segment + 16, width); ++x) PIXEL(x, y); \
  } else if (segment == 0) {                                                \
    STRIP(0, LEFT);                                                         \
  } else if (segment + 16 >= width) {                                       \
    STRIP(width - 16, RIGHT);                                               \
  } else {                                                                  \
    STRIP(min(segment, width - 16 - (reach)), MIDDLE);                      \
  }

// ---------------------------------------------------------------------------------- gaussian_blur

__constant ushort kBinomial[5] = {1, 4, 6, 4, 1};

/// The five columns' part of the sum. The weights' sum is 256: 255 * 256 + 128 fits 16 bits.
INLINE ushort16 blur_row(__global const uchar* p, const int side) {
  const ushort16 outer = convert_ushort16(tap(p, -2, side)) + convert_ushort16(tap(p, 2, side));
  const ushort16 inner = convert_ushort16(tap(p, -1, side)) + convert_ushort16(tap(p, 1, side));
  return outer + (inner << (ushort16)2) + (ushort16)6 * convert_ushort16(LOAD(Bytes16, p));
}

INLINE void blur_strip(__global const uchar* image, __global uchar* blurred, int width, int height,
                       int x, int first, int end, const int side) {
#define BLUR_ROW(y) blur_row(image + reflect(y, height) * width + x, side)
  ushort16 a = BLUR_ROW(first - 2), b = BLUR_ROW(first - 1), c = BLUR_ROW(first),
           d = BLUR_ROW(first + 1);
  for (int y = first; y < end; ++y) {
    const ushort16 e = BLUR_ROW(y + 2);
    const ushort16 sum = a + e + ((b + d) << (ushort16)2) + (ushort16)6 * c + (ushort16)128;
    STORE(Bytes16, blurred + y * width + x, convert_uchar16(sum >> (ushort16)8));
    a = b, b = c, c = d, d = e;
  }
}

uchar blur_pixel(__global const uchar* image, int x, int y, int width, int height) {
  int sum = 128;
  for (int dy = -2; dy <= 2; ++dy) {
    __global const uchar* row = image + reflect(y + dy, height) * width;
    for (int dx = -2; dx <= 2; ++dx)
      sum += kBinomial[dy + 2] * kBinomial[dx + 2] * row[reflect(x + dx, width)];
  }
  return (uchar)(sum >> 8);
}

__kernel void gaussian_blur(__global const uchar* restrict image, __global uchar* restrict blurred,
                            int width, int height, int rows) {
#define STRIP(x, side) blur_strip(image, blurred, width, height, x, first, end, side)
#define PIXEL(x, y) blurred[(y) * width + (x)] = blur_pixel(image, x, y, width, height)
  FOR_SEGMENT(2, STRIP, PIXEL)
#undef STRIP
#undef PIXEL
}

// -------------------------------------------------------------------------------------- filter7x7

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

// ------------------------------------------------------------------------------------------ sobel

typedef struct {
  short16 difference;  ///< right - left
  short16 smooth;      ///< left + 2 * here + right
} GradientRow;

INLINE GradientRow gradient_row(__global const uchar* p, const int side) {
  const short16 left = convert_short16(tap(p, -1, side)), right = convert_short16(tap(p, 1, side));
  GradientRow row;
  row.difference = right - left;
  row.smooth = left + right + (convert_short16(LOAD(Bytes16, p)) << (short16)1);
  return row;
}

INLINE void sobel_strip(__global const uchar* image, __global short* gx, __global short* gy,
                        int width, int height, int x, int first, int end, const int side) {
#define GRADIENT_ROW(y) gradient_row(image + reflect(y, height) * width + x, side)
  GradientRow above = GRADIENT_ROW(first - 1), here = GRADIENT_ROW(first);
  for (int y = first; y < end; ++y) {
    const GradientRow below = GRADIENT_ROW(y + 1);
    STORE(Shorts16, gx + y * width + x,
          above.difference + (here.difference << (short16)1) + below.difference);
    STORE(Shorts16, gy + y * width + x, below.smooth - above.smooth);
    above = here, here = below;
  }
}

void sobel_pixel(__global const uchar* image, __global short* gx, __global short* gy, int x, int y,
                 int width, int height) {
  __global const uchar* above = image + reflect(y - 1, height) * width;
  __global const uchar* here = image + y * width;
  __global const uchar* below = image + reflect(y + 1, height) * width;
  const int l = reflect(x - 1, width), r = reflect(x + 1, width);
  gx[y * width + x] =
      (short)((above[r] - above[l]) + 2 * (here[r] - here[l]) + (below[r] - below[l]));
  gy[y * width + x] =
      (short)((below[l] - above[l]) + 2 * (below[x] - above[x]) + (below[r] - above[r]));
}

__kernel void sobel(__global const uchar* restrict image, __global short* restrict gx,
                    __global short* restrict gy, int width, int height, int rows) {
#define STRIP(x, side) sobel_strip(image, gx, gy, width, height, x, first, end, side)
#define PIXEL(x, y) sobel_pixel(image, gx, gy, x, y, width, height)
  FOR_SEGMENT(1, STRIP, PIXEL)
#undef STRIP
#undef PIXEL
}
