// Stencils and fully connected layers for devices with local memory of their own: GPUs. What the
// items of a work group share is read once, into local memory. Definitions and arguments as in gaussian_blur.cl, filter7x7.cl, sobel.cl and dnn.cl, whose kernels do the same for CPUs; integer results are
// exact.
//
// Groups have any number of items along x, one along y. Local memory comes as an argument, so that
// sizes are the host's (tiles.h).
//
// Defined by the host (tuning.cpp):
//   FILTER_ROWS  rows that an item of filter7x7_tile computes at once;
//   FC_ROWS      output rows of a work group of fully_connected_group.

#include "border.cl"

/// The group's columns of `rows` rows from (x, y) on, with `reach` pixels around them, into
/// tile [rows + 2 * reach, items + 2 * reach].
void stage(__global const uchar* image, __local uchar* tile, int x, int y, int rows, int reach,
           int width, int height) {
  const int items = (int)get_local_size(0);
  const int columns = items + 2 * reach;
  const int count = columns * (rows + 2 * reach);
  for (int i = (int)get_local_id(0); i < count; i += items) {
    const int row = reflect(y + i / columns - reach, height);
    const int column = reflect(x + i % columns - reach, width);
    tile[i] = image[row * width + column];
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

/// Stages the tile of this group and gives the names that the kernels below share. An item computes
/// column x of rows first to end; its own column of the tile begins at `here`.
#define TILE(reach)                                                                     \
  const int items = (int)get_local_size(0);                                             \
  const int columns = items + 2 * (reach);                                              \
  const int first = (int)get_global_id(1) * rows;                                       \
  const int end = min(first + rows, height);                                            \
  stage(image, tile, (int)get_group_id(0) * items, first, rows, reach, width, height);  \
  const int x = (int)get_global_id(0);                                                  \
  if (x >= width) return;                                                               \
  __local const uchar* here = tile + get_local_id(0)

__kernel void gaussian_blur_tile(__global const uchar* restrict image,
                                 __global uchar* restrict blurred, int width, int height, int rows,
                                 __local uchar* tile) {
  TILE(2);
#define BLUR_ROW(p) ((p)[0] + (p)[4] + 4 * ((p)[1] + (p)[3]) + 6 * (p)[2])
  int a = BLUR_ROW(here), b = BLUR_ROW(here + columns), c = BLUR_ROW(here + 2 * columns),
      d = BLUR_ROW(here + 3 * columns);
  for (int y = first; y < end; ++y) {
    const int e = BLUR_ROW(here + (y - first + 4) * columns);
    blurred[y * width + x] = (uchar)((a + e + 4 * (b + d) + 6 * c + 128) >> 8);
    a = b, b = c, c = d, d = e;
  }
}

__kernel void filter7x7_tile(__global const uchar* restrict image,
                             __global uchar* restrict filtered,
                             __constant const float* restrict weights, int width, int height,
                             int rows, __local uchar* tile) {
  TILE(3);
  for (int y = first; y < end; y += FILTER_ROWS) {
    float sum[FILTER_ROWS];
#pragma unroll
    for (int o = 0; o < FILTER_ROWS; ++o) sum[o] = 0.0f;
#pragma unroll
    for (int r = 0; r < FILTER_ROWS + 6; ++r) {
      // Rows beyond the tile are those of outputs beyond its end.
      __local const uchar* p = here + min(y - first + r, rows + 5) * columns;
#pragma unroll
      for (int dx = 0; dx < 7; ++dx) {
        const float pixel = p[dx];
#pragma unroll
        for (int o = 0; o < FILTER_ROWS; ++o) {
          if (r - o >= 0 && r - o < 7) sum[o] += weights[(r - o) * 7 + dx] * pixel;
        }
      }
    }
#pragma unroll
    for (int o = 0; o < FILTER_ROWS; ++o) {
      if (y + o < end) filtered[(y + o) * width + x] = convert_uchar_sat_rte(sum[o]);
    }
  }
}

__kernel void sobel_tile(__global const uchar* restrict image, __global short* restrict gx,
                         __global short* restrict gy, int width, int height, int rows,
                         __local uchar* tile) {
  TILE(1);
#define DIFFERENCE(p) ((p)[2] - (p)[0])
#define SMOOTH(p) ((p)[0] + 2 * (p)[1] + (p)[2])
  for (int y = first; y < end; ++y) {
    __local const uchar* above = here + (y - first) * columns;
    __local const uchar* middle = above + columns;
    __local const uchar* below = middle + columns;
    gx[y * width + x] =
        (short)(DIFFERENCE(above) + 2 * DIFFERENCE(middle) + DIFFERENCE(below));
    gy[y * width + x] = (short)(SMOOTH(below) - SMOOTH(above));
  }
}

/// FC_ROWS output rows a work group, whose items read neighbouring weights.
/// @param partial  [FC_ROWS, items].
__kernel void fully_connected_group(__global const float* restrict input,
                                    __global const float* restrict weights,
                                    __global const float* restrict bias,
                                    __global float* restrict output, int in, int out,
                                    __local float* partial) {
  const int items = (int)get_local_size(0), me = (int)get_local_id(0);
  const int first = (int)get_group_id(0) * FC_ROWS;
  __global const float* row[FC_ROWS];
  float4 sum[FC_ROWS];
#pragma unroll
  for (int r = 0; r < FC_ROWS; ++r) {
    row[r] = weights + (size_t)min(first + r, out - 1) * in;
    sum[r] = 0.0f;
  }
#pragma unroll 4
  for (int i = 4 * me; i + 4 <= in; i += 4 * items) {
    const float4 x = vload4(0, input + i);
#pragma unroll
    for (int r = 0; r < FC_ROWS; ++r) sum[r] += vload4(0, row[r] + i) * x;
  }
#pragma unroll
  for (int r = 0; r < FC_ROWS; ++r) {
    float total = sum[r].x + sum[r].y + sum[r].z + sum[r].w;
    for (int i = in / 4 * 4 + me; i < in; i += items) total += row[r][i] * input[i];
    partial[r * items + me] = total;
  }
  for (int left = items; left > 1; left = (left + 1) / 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    const int kept = (left + 1) / 2;
    if (me + kept >= left) continue;
#pragma unroll
    for (int r = 0; r < FC_ROWS; ++r) partial[r * items + me] += partial[r * items + me + kept];
  }
  if (me > 0) return;
#pragma unroll
  for (int r = 0; r < FC_ROWS; ++r) {
    if (first + r < out) output[first + r] = bias[first + r] + partial[r * items];
  }
}
