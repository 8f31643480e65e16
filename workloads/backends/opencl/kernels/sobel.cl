// sobel (definition: workloads/vision/vision.h).
#include "strips.cl"

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
