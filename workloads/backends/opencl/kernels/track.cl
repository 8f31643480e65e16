// track_features (definition: make_track_features in workloads/vision/vision.h): the levels of the
// pyramids, and one work item a point.

#define LEVELS 3
#define ITERATIONS 8
#define RADIUS 7
#define WINDOW (2 * RADIUS + 1)
#define LEAST_EIGENVALUE 1.0f
#define BORDERED (WINDOW + 2)  // With what central differences need.
#define PIXELS (BORDERED + 1)  // Around as many samples.

#include "border.cl"

/// Blurs by [1 4 6 4 1]^2 / 256, border reflect-101, and takes every second pixel of every second
/// row. Global ids are those of the result's pixels.
__kernel void next_level(__global const uchar* restrict below, __global uchar* restrict level,
                         int below_width, int below_height, int width, int height) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1);
  if (x >= width) return;
  const int weights[5] = {1, 4, 6, 4, 1};
  const int centre = 2 * x;
  int sum = 128;
  for (int j = 0; j < 5; ++j) {
    __global const uchar* row = below + reflect(2 * y + j - 2, below_height) * below_width;
    int across;
    if (centre >= 2 && centre + 2 < below_width) {
      __global const uchar* p = row + centre;
      across = p[-2] + p[2] + 4 * (p[-1] + p[1]) + 6 * p[0];
    } else {
      across = 0;
      for (int i = 0; i < 5; ++i) across += weights[i] * row[reflect(centre + i - 2, below_width)];
    }
    sum += weights[j] * across;
  }
  level[y * width + x] = (uchar)(sum >> 8);
}

typedef struct {
  __global const uchar* pixels;
  int width, height;
} Picture;

bool is_inside(Picture picture, float2 p, float margin) {
  return p.x >= -margin && p.x <= (float)(picture.width - 1) + margin && p.y >= -margin &&
         p.y <= (float)(picture.height - 1) + margin;
}

/// size x size samples around p, row by row, each from its four pixels; those beyond the border
/// repeat it.
void sample(Picture picture, float2 p, const int size, float* samples) {
  const float2 base = floor(p);
  const float a = p.x - base.x, b = p.y - base.y;
  const float w00 = (1.0f - a) * (1.0f - b), w10 = a * (1.0f - b);
  const float w01 = (1.0f - a) * b, w11 = a * b;
  const int left = (int)base.x - size / 2, top = (int)base.y - size / 2;
  const bool whole =
      left >= 0 && left + size < picture.width && top >= 0 && top + size < picture.height;
  for (int j = 0; j < size; ++j) {
    if (whole) {
      __global const uchar* upper = picture.pixels + (top + j) * picture.width + left;
      __global const uchar* lower = upper + picture.width;
      for (int i = 0; i < size; ++i) {
        samples[j * size + i] = w00 * (float)upper[i] + w10 * (float)upper[i + 1] +
                                w01 * (float)lower[i] + w11 * (float)lower[i + 1];
      }
    } else {
      __global const uchar* upper =
          picture.pixels + clamp(top + j, 0, picture.height - 1) * picture.width;
      __global const uchar* lower =
          picture.pixels + clamp(top + j + 1, 0, picture.height - 1) * picture.width;
      for (int i = 0; i < size; ++i) {
        const int x0 = clamp(left + i, 0, picture.width - 1);
        const int x1 = clamp(left + i + 1, 0, picture.width - 1);
        samples[j * size + i] = w00 * (float)upper[x0] + w10 * (float)upper[x1] +
                                w01 * (float)lower[x0] + w11 * (float)lower[x1];
      }
    }
  }
}

/// Iterates on one level. 1 = q is found, 0 = the level says too little, -1 = the point is lost.
int track_level(Picture previous, Picture next, float2 p, float2* q) {
  const float share = 1.0f / (float)(WINDOW * WINDOW);
  float bordered[BORDERED * BORDERED];
  sample(previous, p, BORDERED, bordered);
  float xx = 0.0f, xy = 0.0f, yy = 0.0f;
  for (int j = 0; j < WINDOW; ++j) {
    for (int i = 0; i < WINDOW; ++i) {
      const float* at = bordered + (j + 1) * BORDERED + i + 1;
      const float ix = (at[1] - at[-1]) * 0.5f;
      const float iy = (at[BORDERED] - at[-BORDERED]) * 0.5f;
      xx += ix * ix, xy += ix * iy, yy += iy * iy;
    }
  }
  xx *= share, xy *= share, yy *= share;
  const float difference = xx - yy;
  const float root = sqrt(difference * difference + 4.0f * xy * xy);
  if (!((xx + yy - root) * 0.5f >= LEAST_EIGENVALUE)) return 0;
  const float det = xx * yy - xy * xy;
  float moved[WINDOW * WINDOW];
  for (int k = 0; k < ITERATIONS; ++k) {
    if (!is_inside(next, *q, 1.0f)) return -1;
    sample(next, *q, WINDOW, moved);
    float ex = 0.0f, ey = 0.0f;
    for (int j = 0; j < WINDOW; ++j) {
      for (int i = 0; i < WINDOW; ++i) {
        const float* at = bordered + (j + 1) * BORDERED + i + 1;
        const float error = at[0] - moved[j * WINDOW + i];
        ex += error * (at[1] - at[-1]);
        ey += error * (at[BORDERED] - at[-BORDERED]);
      }
    }
    ex *= 0.5f * share, ey *= 0.5f * share;
    *q += (float2)(yy * ex - xy * ey, xx * ey - xy * ex) / det;
  }
  return is_inside(next, *q, 1.0f) ? 1 : -1;
}

/// A work item a point.
/// @param points, rows    f32 [<=capacity,2] and how many there are.
/// @param tracks, status  f32 [<=capacity,2] and u8 [<=capacity]; get as many.
__kernel void track_points(__global const uchar* restrict previous0,
                           __global const uchar* restrict previous1,
                           __global const uchar* restrict previous2,
                           __global const uchar* restrict next0,
                           __global const uchar* restrict next1,
                           __global const uchar* restrict next2,
                           __global const float* restrict points, __global const int* restrict rows,
                           __global float* restrict tracks, __global int* restrict tracks_rows,
                           __global uchar* restrict status, __global int* restrict status_rows,
                           int width, int height, int capacity) {
  const int point = (int)get_global_id(0);
  const int count = clamp(rows[0], 0, capacity);
  if (point == 0) tracks_rows[0] = status_rows[0] = count;
  if (point >= count) return;
  Picture previous[LEVELS] = {{previous0, width, height}, {previous1, 0, 0}, {previous2, 0, 0}};
  Picture next[LEVELS] = {{next0, width, height}, {next1, 0, 0}, {next2, 0, 0}};
  for (int level = 1; level < LEVELS; ++level) {
    previous[level].width = next[level].width = (previous[level - 1].width + 1) / 2;
    previous[level].height = next[level].height = (previous[level - 1].height + 1) / 2;
  }
  const float2 p = vload2(point, points);
  float2 q = p / (float)(1 << LEVELS);
  int found = is_inside(previous[0], p, 0.0f) ? 0 : -1;
  for (int level = LEVELS - 1; level >= 0 && found >= 0; --level) {
    q *= 2.0f;
    found = track_level(previous[level], next[level], p / (float)(1 << level), &q);
  }
  const bool is_tracked = found > 0 && is_inside(next[0], q, 0.0f);
  vstore2(is_tracked ? q : p, point, tracks);
  status[point] = is_tracked ? 1 : 0;
}
