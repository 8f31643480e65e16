// extract_features (definition: make_extract_features in workloads/vision/vision.h). Selecting the
// best of each cell is the host's (extract_features.cpp). All sums are exact integers, so that any
// order of work items gives the same features.

#define RIM 20
#define SCORE_HALF 3
#define WINDOW_HALF 7
#define REFINE_STEPS 3
#define FARTHEST 4.0f

/// By how much 9 neighbouring pixels of the 16 on the circle are all brighter or all darker than
/// the middle: u8 [height,width], 0 where that is not above @p threshold.
__kernel void fast_contrast(__global const uchar* restrict image, __global uchar* restrict contrast,
                            int width, int height, int threshold) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1);
  if (x >= width) return;
  int most = 0;
  if (x >= 3 && y >= 3 && x < width - 3 && y < height - 3) {
    __global const uchar* p = image + y * width + x;
    const int middle = p[0];
    // Of an arc of 9 at least one of each pair of opposite pixels is part.
    const int up = p[-3 * width] - middle, down = p[3 * width] - middle;
    const int left = p[-3] - middle, right = p[3] - middle;
    const int brighter = min(max(up, down), max(left, right));
    const int darker = -max(min(up, down), min(left, right));
    if (max(brighter, darker) > threshold) {
      const int d[16] = {down,
                         p[3 * width + 1] - middle,
                         p[2 * width + 2] - middle,
                         p[width + 3] - middle,
                         right,
                         p[-width + 3] - middle,
                         p[-2 * width + 2] - middle,
                         p[-3 * width + 1] - middle,
                         up,
                         p[-3 * width - 1] - middle,
                         p[-2 * width - 2] - middle,
                         p[-width - 3] - middle,
                         left,
                         p[width - 3] - middle,
                         p[2 * width - 2] - middle,
                         p[3 * width - 1] - middle};
      for (int first = 0; first < 16; ++first) {
        int low = d[first], high = d[first];
        for (int i = 1; i < 9; ++i) {
          const int value = d[(first + i) & 15];
          low = min(low, value), high = max(high, value);
        }
        most = max(most, max(low, -high));
      }
    }
  }
  contrast[y * width + x] = (uchar)(most > threshold ? most : 0);
}

/// Pixels that contrast more than each neighbour, RIM away from the border.
/// @param count       [0] becomes their number; zeroed beforehand.
/// @param candidates  Pixel index and the sums xx, xy, yy of the gradients' products, in no
///                    particular order; room for all pixels.
__kernel void fast_candidates(__global const uchar* restrict image,
                              __global const uchar* restrict contrast,
                              volatile __global int* count, __global int4* restrict candidates,
                              int width, int height) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1);
  if (x < RIM || y < RIM || x >= width - RIM || y >= height - RIM) return;
  __global const uchar* c = contrast + y * width + x;
  const uchar here = c[0];
  if (here == 0 || c[-1] >= here || c[1] >= here) return;
  for (int dx = -1; dx <= 1; ++dx) {
    if (c[dx - width] >= here || c[dx + width] >= here) return;
  }
  int xx = 0, xy = 0, yy = 0;
  for (int dy = -SCORE_HALF; dy <= SCORE_HALF; ++dy) {
    __global const uchar* p = image + (y + dy) * width + x;
    for (int dx = -SCORE_HALF; dx <= SCORE_HALF; ++dx) {
      const int gx = p[dx + 1] - p[dx - 1], gy = p[dx + width] - p[dx - width];
      xx += gx * gx, xy += gx * gy, yy += gy * gy;
    }
  }
  candidates[atomic_inc(count)] = (int4)(y * width + x, xx, xy, yy);
}

/// The picture under the blur's rows, u16, 2^8 times it; 3 pixels at each end are left out.
__kernel void blur_rows(__global const uchar* restrict image, __global ushort* restrict rows,
                        __constant int* weights, int width) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1);
  if (x < 3 || x >= width - 3) return;
  __global const uchar* p = image + y * width + x;
  int sum = 0;
  for (int i = 0; i < 7; ++i) sum += weights[i] * p[i - 3];
  rows[y * width + x] = (ushort)sum;
}

int blurred_at(__global const ushort* rows, __constant int* weights, int width, int x, int y) {
  __global const ushort* p = rows + y * width + x;
  int sum = 1 << 15;
  for (int i = 0; i < 7; ++i) sum += weights[i] * p[(i - 3) * width];
  return sum >> 16;
}

/// An item has a corner.
/// @param corners  Pixel indices, RIM away from the border; [count].
/// @param pattern  ax, ay, bx, by of each bit.
/// @param pixels   f32 [capacity,2]: the centre of the gradients' energy around each.
/// @param bits     u8 [capacity,32].
__kernel void describe_corners(__global const uchar* restrict image,
                               __global const ushort* restrict rows,
                               __global const int* restrict corners,
                               __global const int* restrict count, __constant char4* pattern,
                               __constant int* weights, __global float* restrict pixels,
                               __global uchar* restrict bits, int width) {
  const int item = (int)get_global_id(0);
  if (item >= count[0]) return;
  const int x = corners[item] % width, y = corners[item] / width;
  float centre_x = (float)x, centre_y = (float)y;
  for (int step = 0; step < REFINE_STEPS; ++step) {
    // Not negative: halves up is away from zero, as the definition rounds.
    const int cx = (int)floor(centre_x + 0.5f), cy = (int)floor(centre_y + 0.5f);
    int weight = 0, sum_x = 0, sum_y = 0;
    for (int dy = -WINDOW_HALF; dy <= WINDOW_HALF; ++dy) {
      __global const uchar* p = image + (cy + dy) * width + cx;
      for (int dx = -WINDOW_HALF; dx <= WINDOW_HALF; ++dx) {
        const int gx = p[dx + 1] - p[dx - 1], gy = p[dx + width] - p[dx - width];
        const int energy = gx * gx + gy * gy;
        weight += energy, sum_x += energy * dx, sum_y += energy * dy;
      }
    }
    if (weight == 0) break;
    const float nx = (float)cx + (float)sum_x / (float)weight;
    const float ny = (float)cy + (float)sum_y / (float)weight;
    const float dx = nx - (float)x, dy = ny - (float)y;
    if (sqrt(dx * dx + dy * dy) > FARTHEST) break;
    centre_x = nx, centre_y = ny;
  }
  pixels[2 * item] = centre_x;
  pixels[2 * item + 1] = centre_y;
  for (int byte = 0; byte < 32; ++byte) {
    uchar value = 0;
    for (int bit = 0; bit < 8; ++bit) {
      const char4 p = pattern[8 * byte + bit];
      const int a = blurred_at(rows, weights, width, x + p.x, y + p.y);
      const int b = blurred_at(rows, weights, width, x + p.z, y + p.w);
      if (a < b) value |= (uchar)(1 << bit);
    }
    bits[32 * item + byte] = value;
  }
}
