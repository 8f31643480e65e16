// gaussian_blur (definition: workloads/vision/vision.h).
#include "strips.cl"

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
