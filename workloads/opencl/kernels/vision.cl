// The vision workloads (workloads/vision/vision.h has the definitions) in plain OpenCL C 1.2.
//
// A work item computes 16 neighbouring pixels of a row: enough work for a CPU driver, which runs
// work items as loop iterations, and one vector load for a GPU. Away from the left and right border
// it loads vectors; the few items at the border go pixel by pixel. Global ids are (segment, row).
// Integer results are exact.

/// Border reflect-101: -1 -> 1, n -> n-2. Loops, since a small image is reflected more than once.
int reflect(int i, int n) {
  if (n == 1) return 0;
  while (i < 0 || i >= n) i = i < 0 ? -i : 2 * n - 2 - i;
  return i;
}

// ---------------------------------------------------------------------------------- gaussian_blur

__constant ushort kBinomial[5] = {1, 4, 6, 4, 1};

ushort16 pixels16(__global const uchar* p) { return convert_ushort16(vload16(0, p)); }

/// The sum of the weights is 256: 255 * 256 + 128 still fits 16 bits.
__kernel void gaussian_blur(__global const uchar* restrict image, __global uchar* restrict blurred,
                            int width, int height) {
  const int x = (int)get_global_id(0) * 16;
  const int y = (int)get_global_id(1);
  if (x >= width) return;
  if (x >= 2 && x + 18 <= width) {
    ushort16 sum = 128;
    for (int dy = -2; dy <= 2; ++dy) {
      __global const uchar* p = image + reflect(y + dy, height) * width + x;
      const ushort16 row = pixels16(p - 2) + pixels16(p + 2) +
                           (ushort16)4 * (pixels16(p - 1) + pixels16(p + 1)) +
                           (ushort16)6 * pixels16(p);
      sum += (ushort16)kBinomial[dy + 2] * row;
    }
    vstore16(convert_uchar16(sum >> (ushort16)8), 0, blurred + y * width + x);
    return;
  }
  for (int i = x; i < min(x + 16, width); ++i) {
    int sum = 128;
    for (int dy = -2; dy <= 2; ++dy) {
      __global const uchar* row = image + reflect(y + dy, height) * width;
      for (int dx = -2; dx <= 2; ++dx)
        sum += kBinomial[dy + 2] * kBinomial[dx + 2] * row[reflect(i + dx, width)];
    }
    blurred[y * width + i] = (uchar)(sum >> 8);
  }
}

// -------------------------------------------------------------------------------------- filter7x7

#ifndef FILTER_SHIFT
#define FILTER_SHIFT 8
#endif

/// sum / 2^FILTER_SHIFT, a half to the even neighbour.
int16 round_shift16(int16 sum) {
  return (sum + (1 << (FILTER_SHIFT - 1)) - 1 + ((sum >> FILTER_SHIFT) & 1)) >> FILTER_SHIFT;
}
int round_shift(int sum) {
  return (sum + (1 << (FILTER_SHIFT - 1)) - 1 + ((sum >> FILTER_SHIFT) & 1)) >> FILTER_SHIFT;
}

__kernel void filter7x7(__global const uchar* restrict image, __global uchar* restrict filtered,
                        __constant short* restrict weights, int width, int height) {
  const int x = (int)get_global_id(0) * 16;
  const int y = (int)get_global_id(1);
  if (x >= width) return;
  if (x >= 3 && x + 19 <= width) {
    int16 sum = 0;
    for (int dy = 0; dy < 7; ++dy) {
      __global const uchar* p = image + reflect(y + dy - 3, height) * width + x - 3;
      for (int dx = 0; dx < 7; ++dx)
        sum += (int)weights[dy * 7 + dx] * convert_int16(vload16(0, p + dx));
    }
    vstore16(convert_uchar16_sat(round_shift16(sum)), 0, filtered + y * width + x);
    return;
  }
  for (int i = x; i < min(x + 16, width); ++i) {
    int sum = 0;
    for (int dy = 0; dy < 7; ++dy) {
      __global const uchar* row = image + reflect(y + dy - 3, height) * width;
      for (int dx = 0; dx < 7; ++dx) sum += weights[dy * 7 + dx] * row[reflect(i + dx - 3, width)];
    }
    filtered[y * width + i] = convert_uchar_sat(round_shift(sum));
  }
}

// ------------------------------------------------------------------------------------------ sobel

short16 gray16(__global const uchar* p) { return convert_short16(vload16(0, p)); }

__kernel void sobel(__global const uchar* restrict image, __global short* restrict gx,
                    __global short* restrict gy, int width, int height) {
  const int x = (int)get_global_id(0) * 16;
  const int y = (int)get_global_id(1);
  if (x >= width) return;
  __global const uchar* above = image + reflect(y - 1, height) * width;
  __global const uchar* here = image + y * width;
  __global const uchar* below = image + reflect(y + 1, height) * width;
  if (x >= 1 && x + 17 <= width) {
    const short16 a = gray16(above + x - 1), b = gray16(above + x), c = gray16(above + x + 1);
    const short16 d = gray16(here + x - 1), f = gray16(here + x + 1);
    const short16 g = gray16(below + x - 1), h = gray16(below + x), i = gray16(below + x + 1);
    vstore16((c - a) + (short16)2 * (f - d) + (i - g), 0, gx + y * width + x);
    vstore16((g - a) + (short16)2 * (h - b) + (i - c), 0, gy + y * width + x);
    return;
  }
  for (int i = x; i < min(x + 16, width); ++i) {
    const int l = reflect(i - 1, width), r = reflect(i + 1, width);
    gx[y * width + i] =
        (short)((above[r] - above[l]) + 2 * (here[r] - here[l]) + (below[r] - below[l]));
    gy[y * width + i] =
        (short)((below[l] - above[l]) + 2 * (below[i] - above[i]) + (below[r] - above[r]));
  }
}

// -------------------------------------------------------------------------------------- undistort

/// A neighbour outside the image counts as 0.
int pixel_or_zero(__global const uchar* image, int x, int y, int width, int height) {
  return x >= 0 && x < width && y >= 0 && y < height ? image[y * width + x] : 0;
}

/// @param map  Source position of each output pixel in 1/32 pixel (MapEntry of vision.h).
__kernel void undistort(__global const uchar* restrict image, __global uchar* restrict straight,
                        __global const int2* restrict map, int width, int height) {
  const int first = (int)get_global_id(0) * 16;
  const int y = (int)get_global_id(1);
  const int end = min(first + 16, width);
  for (int x = first; x < end; ++x) {
    const int2 at = map[y * width + x];
    const int column = at.x >> 5, row = at.y >> 5;
    const int fx = at.x & 31, fy = at.y & 31;
    int p00, p01, p10, p11;
    if (column >= 0 && column + 1 < width && row >= 0 && row + 1 < height) {
      __global const uchar* p = image + row * width + column;
      p00 = p[0], p01 = p[1], p10 = p[width], p11 = p[width + 1];
    } else {
      p00 = pixel_or_zero(image, column, row, width, height);
      p01 = pixel_or_zero(image, column + 1, row, width, height);
      p10 = pixel_or_zero(image, column, row + 1, width, height);
      p11 = pixel_or_zero(image, column + 1, row + 1, width, height);
    }
    const int top = p00 * (32 - fx) + p01 * fx, bottom = p10 * (32 - fx) + p11 * fx;
    straight[y * width + x] = (uchar)((top * (32 - fy) + bottom * fy + 512) >> 10);
  }
}
