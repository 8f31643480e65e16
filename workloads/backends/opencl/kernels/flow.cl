// Dense Lucas-Kanade (definition: make_optical_flow in workloads/vision/vision.h), in two passes of
// sliding sums: along the rows, then down the columns with the solution of the 2x2 system. All sums
// are exact: a product is at most 255^2, a window of 52x52 of them stays below 2^28.
//
// `run` is how far one work item slides. Longer runs waste less on filling the window, shorter ones
// give more work items; the host chooses.

#ifndef WINDOW
#define WINDOW 52
#endif
#define BEFORE (WINDOW / 2)     // The window spans i - BEFORE
#define AFTER (WINDOW / 2 - 1)  // to i + AFTER.

typedef struct {
  int xx, xy, yy, xt, yt;
} Products;

typedef struct {
  __global const uchar *above, *here, *below, *next;
} Rows;

/// Gradient products in column x, replicated beyond the border, times `sign` and added to `sums`.
void add_products(Products* sums, Rows rows, int x, int width, int sign) {
  x = clamp(x, 0, width - 1);
  const int dx = rows.here[min(x + 1, width - 1)] - rows.here[max(x - 1, 0)];
  const int dy = rows.below[x] - rows.above[x];
  const int dt = rows.next[x] - rows.here[x];
  sums->xx += sign * dx * dx;
  sums->xy += sign * dx * dy;
  sums->yy += sign * dy * dy;
  sums->xt += sign * dx * dt;
  sums->yt += sign * dy * dt;
}

/// Sums along the rows. Global ids (run, row).
/// @param sums   i32 [5,height,pitch]: xx, xy, yy, xt, yt.
/// @param pitch  Width rounded up to 8; columns beyond the width become 0.
__kernel void flow_row_sums(__global const uchar* restrict previous,
                            __global const uchar* restrict next, __global int* restrict sums,
                            int width, int height, int pitch, int run) {
  const int first = (int)get_global_id(0) * run;
  const int end = min(first + run, width);
  const int y = (int)get_global_id(1);
  if (first >= width) return;
  Rows rows;
  rows.above = previous + max(y - 1, 0) * width;
  rows.here = previous + y * width;
  rows.below = previous + min(y + 1, height - 1) * width;
  rows.next = next + y * width;

  Products window = {0, 0, 0, 0, 0};
  for (int i = first - BEFORE; i <= first + AFTER; ++i) add_products(&window, rows, i, width, 1);
  const int plane = height * pitch;
  __global int* out = sums + y * pitch;
  for (int x = first; x < end; ++x) {
    out[x] = window.xx;
    out[x + plane] = window.xy;
    out[x + 2 * plane] = window.yy;
    out[x + 3 * plane] = window.xt;
    out[x + 4 * plane] = window.yt;
    add_products(&window, rows, x + 1 + AFTER, width, 1);
    add_products(&window, rows, x - BEFORE, width, -1);
  }
  if (end < width) return;
  for (int x = width; x < pitch; ++x) {
    for (int i = 0; i < 5; ++i) out[x + i * plane] = 0;
  }
}

typedef struct {
  int8 xx, xy, yy, xt, yt;
} Products8;

void add_row(Products8* window, __global const int* sums, int row, int plane, int pitch,
             int height) {
  __global const int* p = sums + clamp(row, 0, height - 1) * pitch;
  window->xx += vload8(0, p);
  window->xy += vload8(0, p + plane);
  window->yy += vload8(0, p + 2 * plane);
  window->xt += vload8(0, p + 3 * plane);
  window->yt += vload8(0, p + 4 * plane);
}

void subtract_row(Products8* window, __global const int* sums, int row, int plane, int pitch,
                  int height) {
  __global const int* p = sums + clamp(row, 0, height - 1) * pitch;
  window->xx -= vload8(0, p);
  window->xy -= vload8(0, p + plane);
  window->yy -= vload8(0, p + 2 * plane);
  window->xt -= vload8(0, p + 3 * plane);
  window->yt -= vload8(0, p + 4 * plane);
}

/// Flow of 8 pixels as u0 v0 u1 v1 ...; 0 where the determinant, an exact integer, is 0.
float16 solve(Products8 window) {
  const long8 xx = convert_long8(window.xx), xy = convert_long8(window.xy);
  const long8 yy = convert_long8(window.yy);
  const long8 xt = convert_long8(window.xt), yt = convert_long8(window.yt);
  const long8 det = xx * yy - xy * xy;
  const float8 scale = select((float8)0.0f, 2.0f / convert_float8(det), convert_int8(det != 0));
  const float8 u = convert_float8(xy * yt - yy * xt) * scale;
  const float8 v = convert_float8(xy * xt - xx * yt) * scale;
  return (float16)(u.s0, v.s0, u.s1, v.s1, u.s2, v.s2, u.s3, v.s3, u.s4, v.s4, u.s5, v.s5, u.s6,
                   v.s6, u.s7, v.s7);
}

/// Sums down the columns, and the flow. A work item has 8 columns; global ids (columns, run).
/// @param flow  f32 [height,width,2].
__kernel void flow_solve(__global const int* restrict sums, __global float* restrict flow,
                         int width, int height, int pitch, int run) {
  const int x = (int)get_global_id(0) * 8;
  const int first = (int)get_global_id(1) * run;
  const int end = min(first + run, height);
  if (x >= width) return;
  const int plane = height * pitch;
  __global const int* columns = sums + x;

  Products8 window = {0, 0, 0, 0, 0};
  for (int i = first - BEFORE; i <= first + AFTER; ++i)
    add_row(&window, columns, i, plane, pitch, height);
  for (int y = first; y < end; ++y) {
    const float16 result = solve(window);
    __global float* out = flow + 2 * (y * width + x);
    if (x + 8 <= width) {
      vstore16(result, 0, out);
    } else {
      float lanes[16];
      vstore16(result, 0, lanes);
      for (int i = 0; i < 2 * (width - x); ++i) out[i] = lanes[i];
    }
    add_row(&window, columns, y + 1 + AFTER, plane, pitch, height);
    subtract_row(&window, columns, y - BEFORE, plane, pitch, height);
  }
}
