// extract_features (definition: make_extract_features in workloads/vision/vision.h). Selecting the
// best of each cell is the host's (extract_features.cpp). All sums are exact integers, so that any
// order of work items gives the same features.

#include "lanes.cl"

#define RIM 20
#define SCORE_HALF 3
#define WINDOW_HALF 7
#define REFINE_STEPS 3
#define FARTHEST 4.0f
#define MOST 400

// The first two kernels look at pixels a rim away from the border alone, so that no segment of 16
// has a special case. Their global ids are (segment, row), from FIRST_COLUMN and RIM on.
#define FIRST_COLUMN 16

/// By how much 9 neighbouring pixels of the 16 on the circle are all brighter or all darker than
/// the middle, for 16 middles: 0 where that is not above the threshold.
INLINE uchar16 contrast16(__global const uchar* p, const int width, const short threshold) {
#define PIXELS(dx, dy) convert_short16(LOAD(Bytes16, p + (dy) * width + (dx)))
  const short16 middle = PIXELS(0, 0);
  const short16 up = PIXELS(0, -3) - middle, down = PIXELS(0, 3) - middle;
  const short16 left = PIXELS(-3, 0) - middle, right = PIXELS(3, 0) - middle;
  // Of an arc of 9 at least one of each pair of opposite pixels is part.
  const short16 brighter = min(max(up, down), max(left, right));
  const short16 darker = -max(min(up, down), min(left, right));
  if (!any(max(brighter, darker) > (short16)threshold)) return (uchar16)0;
  const short16 d[16] = {down,
                         PIXELS(1, 3) - middle,
                         PIXELS(2, 2) - middle,
                         PIXELS(3, 1) - middle,
                         right,
                         PIXELS(3, -1) - middle,
                         PIXELS(2, -2) - middle,
                         PIXELS(1, -3) - middle,
                         up,
                         PIXELS(-1, -3) - middle,
                         PIXELS(-2, -2) - middle,
                         PIXELS(-3, -1) - middle,
                         left,
                         PIXELS(-3, 1) - middle,
                         PIXELS(-2, 2) - middle,
                         PIXELS(-1, 3) - middle};
#undef PIXELS
  // Two arcs of 9 have 8 pixels in common.
  short16 most = 0, least = 0;
#pragma unroll
  for (int first = 0; first < 16; first += 2) {
    short16 low = d[first + 1], high = d[first + 1];
#pragma unroll
    for (int i = 2; i < 9; ++i) {
      low = min(low, d[(first + i) & 15]), high = max(high, d[(first + i) & 15]);
    }
    const short16 before = d[first], after = d[(first + 9) & 15];
    most = max(most, min(low, max(before, after)));
    least = min(least, max(high, min(before, after)));
  }
  most = max(most, -least);
  return convert_uchar16(select((short16)0, most, most > (short16)threshold));
}

/// @param contrast  u8 [height,width], of the pixels a rim away from the border and beside them.
__kernel void fast_contrast(__global const uchar* restrict image, __global uchar* restrict contrast,
                            int width, int height, int threshold) {
  const int x = FIRST_COLUMN + 16 * (int)get_global_id(0);
  const int y = RIM - 1 + (int)get_global_id(1);
  if (x > width - RIM || y > height - RIM) return;
  const int at = y * width + x;
  STORE(Bytes16, contrast + at, contrast16(image + at, width, (short)threshold));
}

INLINE int sum8(const int8 v) {
  const int4 four = v.lo + v.hi;
  const int2 two = four.lo + four.hi;
  return two.x + two.y;
}
INLINE int sum16(const int16 v) { return sum8(v.lo + v.hi); }

/// Pixels that contrast more than each neighbour, RIM away from the border.
/// @param count       [0] becomes their number; zeroed beforehand.
/// @param candidates  Pixel index and the sums xx, xy, yy of the gradients' products, in no
///                    particular order; room for all pixels.
__kernel void fast_candidates(__global const uchar* restrict image,
                              __global const uchar* restrict contrast,
                              volatile __global int* count, __global int4* restrict candidates,
                              int width, int height) {
  const int x0 = FIRST_COLUMN + 16 * (int)get_global_id(0), y = RIM + (int)get_global_id(1);
  if (x0 >= width - RIM || y >= height - RIM) return;
  __global const uchar* c = contrast + y * width + x0;
  const uchar16 here = LOAD(Bytes16, c);
#define ABOVE(dx, dy) (here > LOAD(Bytes16, c + (dy) * width + (dx)))
  if (!any(here > (uchar16)0)) return;
  const char16 largest = ABOVE(-1, 0) & ABOVE(1, 0) & ABOVE(-1, -1) & ABOVE(0, -1) & ABOVE(1, -1) &
                         ABOVE(-1, 1) & ABOVE(0, 1) & ABOVE(1, 1);
#undef ABOVE
  if (!any(largest)) return;
  char lanes[16];
  vstore16(largest, 0, lanes);
  for (int x = max(x0, RIM); x < min(x0 + 16, width - RIM); ++x) {
    if (!lanes[x - x0]) continue;
    int8 xx = 0, xy = 0, yy = 0;
    for (int dy = -SCORE_HALF; dy <= SCORE_HALF; ++dy) {
      __global const uchar* p = image + (y + dy) * width + x - SCORE_HALF;
#define PIXELS(at) convert_int8(LOAD(Bytes8, p + (at)))
      const int8 gx = PIXELS(1) - PIXELS(-1), gy = PIXELS(width) - PIXELS(-width);
#undef PIXELS
      xx += gx * gx, xy += gx * gy, yy += gy * gy;
    }
    xx.s7 = xy.s7 = yy.s7 = 0;  // The window has 7 columns.
    candidates[atomic_inc(count)] = (int4)(y * width + x, sum8(xx), sum8(xy), sum8(yy));
  }
}

// The blur leaves out 3 pixels at each border. Segments begin at column 3; the last one is moved
// back to end where they do, and writes some pixels again, with the same values.
#define FOR_BLURRED(width, at, line)                                  \
  if (3 + 16 * (int)get_global_id(0) >= (width)-3) return;             \
  const int at = (line) * (width) + min(3 + 16 * (int)get_global_id(0), (width)-19)

/// The picture under the blur's rows, u16, 2^8 times it.
__kernel void blur_rows(__global const uchar* restrict image, __global ushort* restrict rows,
                        __constant int* weights, int width) {
  FOR_BLURRED(width, at, (int)get_global_id(1));
  ushort16 sum = 0;
#pragma unroll
  for (int i = 0; i < 7; ++i) {
    sum += (ushort16)(ushort)weights[i] * convert_ushort16(LOAD(Bytes16, image + at + i - 3));
  }
  STORE(Ushorts16, rows + at, sum);
}

/// @param blurred  u8.
__kernel void blur_columns(__global const ushort* restrict rows, __global uchar* restrict blurred,
                           __constant int* weights, int width) {
  FOR_BLURRED(width, at, 3 + (int)get_global_id(1));
  uint16 sum = (uint16)(1u << 15);
#pragma unroll
  for (int i = 0; i < 7; ++i) {
    sum +=
        (uint16)(uint)weights[i] * convert_uint16(LOAD(Ushorts16, rows + at + (i - 3) * width));
  }
  STORE(Bytes16, blurred + at, convert_uchar16(sum >> (uint16)16));
}

/// An item has a corner.
/// @param chosen   i32: how many corners, their pixel indices, RIM away from the border, [MOST], and
///                 the bits of their scores, [MOST].
/// @param pattern  Where the two pixels of each bit are, from the corner's.
/// @param pixels   f32 [capacity,2]: the centre of the gradients' energy around each.
/// @param bits     u8 [capacity,32].
__kernel void describe_corners(__global const uchar* restrict image,
                               __global const uchar* restrict blurred,
                               __global const int* restrict chosen, __constant int2* pattern,
                               __global float* restrict pixels, __global int* restrict pixel_rows,
                               __global float* restrict scores, __global int* restrict score_rows,
                               __global uchar* restrict bits, __global int* restrict bit_rows,
                               int width) {
  const int item = (int)get_global_id(0);
  if (item == 0) pixel_rows[0] = score_rows[0] = bit_rows[0] = chosen[0];
  if (item >= chosen[0]) return;
  __global const int* corners = chosen + 1;
  scores[item] = as_float(corners[MOST + item]);
  const int x = corners[item] % width, y = corners[item] / width;
  const int16 column = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 0) - WINDOW_HALF;
  float centre_x = (float)x, centre_y = (float)y;
  for (int step = 0; step < REFINE_STEPS; ++step) {
    // Not negative: halves up is away from zero, as the definition rounds.
    const int cx = (int)floor(centre_x + 0.5f), cy = (int)floor(centre_y + 0.5f);
    int16 energies = 0, moments = 0;
    for (int dy = -WINDOW_HALF; dy <= WINDOW_HALF; ++dy) {
      __global const uchar* p = image + (cy + dy) * width + cx - WINDOW_HALF;
#define PIXELS(at) convert_int16(LOAD(Bytes16, p + (at)))
      const int16 gx = PIXELS(1) - PIXELS(-1), gy = PIXELS(width) - PIXELS(-width);
#undef PIXELS
      const int16 energy = gx * gx + gy * gy;
      energies += energy, moments += energy * dy;
    }
    energies.sf = moments.sf = 0;  // The window has 15 columns.
    const int weight = sum16(energies);
    if (weight == 0) break;
    const float nx = (float)cx + (float)sum16(energies * column) / (float)weight;
    const float ny = (float)cy + (float)sum16(moments) / (float)weight;
    const float dx = nx - (float)x, dy = ny - (float)y;
    if (sqrt(dx * dx + dy * dy) > FARTHEST) break;
    centre_x = nx, centre_y = ny;
  }
  pixels[2 * item] = centre_x;
  pixels[2 * item + 1] = centre_y;
  __global const uchar* middle = blurred + corners[item];
  for (int byte = 0; byte < 32; ++byte) {
    uchar value = 0;
    for (int bit = 0; bit < 8; ++bit) {
      const int2 pair = pattern[8 * byte + bit];
      value |= (uchar)((middle[pair.x] < middle[pair.y]) << bit);
    }
    bits[32 * item + byte] = value;
  }
}
