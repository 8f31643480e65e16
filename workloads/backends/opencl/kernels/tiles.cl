// Stencils, convolutions and fully connected layers for devices with local memory of their own:
// GPUs. What the items of a work group share is read once, into local memory. Definitions and
// arguments as in gaussian_blur.cl, filter7x7.cl, sobel.cl and dnn.cl, whose kernels do the same for CPUs; integer results are
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

// The tile of a group of conv2d_relu_tile: 32 channels, and pixels for half of its items. An item
// computes 4 x 4 of it. ConvTile of tiles.h has the same figures.
#define TILE_CHANNELS 32
#define TILE_TERMS 8

/// max(least, conv + bias) as a product of matrices whose pixels are gathered on the way. Groups
/// along x are blocks of pixels; global id 1 is the block of TILE_CHANNELS output channels of an image.
/// Items are a multiple of TILE_CHANNELS / 4.
///
/// @param weights     [ceil(out_c/TILE_CHANNELS), terms, TILE_CHANNELS], missing channels 0.
/// @param bias        [ceil(out_c/TILE_CHANNELS), TILE_CHANNELS], alike.
/// @param offsets     [terms]: where a term's pixel is, from the first pixel of an output's window.
/// @param pixel_tile  [TILE_TERMS, items / 2]; weight_tile [TILE_TERMS, TILE_CHANNELS].
__kernel void conv2d_relu_tile(__global const float* restrict input,
                               __global const float* restrict weights,
                               __global const float* restrict bias, __global float* restrict output,
                               __global const int* restrict offsets, int terms, int in_pitch,
                               int stride, int out_c, int out_h, int out_w, int out_plane,
                               int out_pitch, int out_offset, int in_image, int out_image,
                               float least, __local float* pixel_tile, __local float* weight_tile) {
  const int items = (int)get_local_size(0), me = (int)get_local_id(0);
  const int tile_pixels = items / 2;
  const int blocks = (out_c + TILE_CHANNELS - 1) / TILE_CHANNELS;
  const int block = (int)get_global_id(1) % blocks;
  const int image = (int)get_global_id(1) / blocks;
  const int pixels = out_h * out_w;
  const int first = (int)get_group_id(0) * tile_pixels;
  weights += block * terms * TILE_CHANNELS;

  // What this item gathers: one pixel's terms.
  const int gathered = min(first + me % tile_pixels, pixels - 1);
  __global const float* window = input + image * in_image +
                                 gathered / out_w * stride * in_pitch + gathered % out_w * stride;
  // What it computes.
  const int my_pixels = me / (TILE_CHANNELS / 4) * 4, my_channels = me % (TILE_CHANNELS / 4) * 4;
  float4 sum[4];
#pragma unroll
  for (int p = 0; p < 4; ++p) sum[p] = vload4(0, bias + block * TILE_CHANNELS + my_channels);

  for (int term = 0; term < terms; term += TILE_TERMS) {
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int k = me / tile_pixels; k < TILE_TERMS; k += 2) {
      pixel_tile[k * tile_pixels + me % tile_pixels] =
          term + k < terms ? window[offsets[term + k]] : 0.0f;
    }
    for (int i = me; i < TILE_TERMS * TILE_CHANNELS; i += items) {
      const int at = term * TILE_CHANNELS + i;
      weight_tile[i] = at < terms * TILE_CHANNELS ? weights[at] : 0.0f;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
#pragma unroll
    for (int k = 0; k < TILE_TERMS; ++k) {
      const float4 weight = vload4(0, weight_tile + k * TILE_CHANNELS + my_channels);
#pragma unroll
      for (int p = 0; p < 4; ++p) sum[p] += weight * pixel_tile[k * tile_pixels + my_pixels + p];
    }
  }

#pragma unroll
  for (int p = 0; p < 4; ++p) {
    const int pixel = first + my_pixels + p;
    if (pixel >= pixels) continue;
    __global float* to = output + image * out_image + out_offset + pixel / out_w * out_pitch +
                         pixel % out_w;
    float lanes[4];
    vstore4(fmax(sum[p], least), 0, lanes);
    for (int c = 0; c < 4; ++c) {
      const int channel = block * TILE_CHANNELS + my_channels + c;
      if (channel < out_c) to[channel * out_plane] = lanes[c];
    }
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
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int r = me; r < FC_ROWS; r += items) {
    if (first + r >= out) continue;
    float total = bias[first + r];
    for (int i = 0; i < items; ++i) total += partial[r * items + i];
    output[first + r] = total;
  }
}
