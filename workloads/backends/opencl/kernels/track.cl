// track_features (definition: slam::track_features in workloads/vision/pyramid.h): the levels of the
// pyramids, and one work item a point.

#define LEVELS 4
#define ITERATIONS 12
#define ENOUGH 0.01f
#define MOST_ERROR 14.0f
#define LEAST_CORNER 4.0f
#define BACK 0.8f
#define RADIUS 7
#define WINDOW (2 * RADIUS + 1)
#define BORDERED (WINDOW + 2)  // With what central differences need.
#define COUNT ((float)(WINDOW * WINDOW))
#define MOTIONS 6
#define DEFORMATION 0.02f
#define GREY_NOISE 3.0f
#define MOST_OFF 0.4f

/// Under [1 2 1]^2 / 16, edges repeating, every second pixel of every second row. Global ids are those
/// of the result's pixels.
__kernel void next_level(__global const uchar* restrict below, __global uchar* restrict level,
                         int below_width, int below_height, int width, int height) {
  const int x = (int)get_global_id(0), y = (int)get_global_id(1);
  if (x >= width) return;
  __global const uchar* above = below + max(2 * y - 1, 0) * below_width;
  __global const uchar* here = below + 2 * y * below_width;
  __global const uchar* under = below + min(2 * y + 1, below_height - 1) * below_width;
  int sum = 8;
  for (int i = -1; i <= 1; ++i) {
    const int at = clamp(2 * x + i, 0, below_width - 1);
    sum += (i == 0 ? 2 : 1) * (above[at] + 2 * here[at] + under[at]);
  }
  level[y * width + x] = (uchar)(sum >> 4);
}

typedef struct {
  __global const uchar* pixels;
  int width, height;
} Picture;

/// size x size samples from @p corner, row by row, each from its four pixels. @p room is what the
/// definition leaves on the right and below. False, and nothing, where the window leaves the picture.
bool sample(Picture picture, float2 corner, const int size, float2 room, float* samples) {
  if (!(corner.x >= 0.0f && corner.y >= 0.0f && corner.x < (float)picture.width - room.x &&
        corner.y < (float)picture.height - room.y)) {
    return false;
  }
  const int left = (int)corner.x, top = (int)corner.y;
  const float a = corner.x - (float)left, b = corner.y - (float)top;
  const float w00 = (1.0f - a) * (1.0f - b), w10 = a * (1.0f - b);
  const float w01 = (1.0f - a) * b, w11 = a * b;
  for (int j = 0; j < size; ++j) {
    __global const uchar* upper = picture.pixels + (top + j) * picture.width + left;
    __global const uchar* lower = upper + picture.width;
    for (int i = 0; i < size; ++i) {
      samples[j * size + i] = w00 * (float)upper[i] + w10 * (float)upper[i + 1] +
                              w01 * (float)lower[i] + w11 * (float)lower[i + 1];
    }
  }
  return true;
}

/// A window: its samples with a border, and sums of its differences without their means.
typedef struct {
  float bordered[BORDERED * BORDERED];
  float xx, xy, yy, mean_x, mean_y;
} Wanted;

float2 slope(const Wanted* wanted, int i, int j) {
  const float* at = wanted->bordered + (j + 1) * BORDERED + i + 1;
  return 0.5f * (float2)(at[1] - at[-1], at[BORDERED] - at[-BORDERED]);
}

bool take(Picture picture, float2 p, float least_corner, Wanted* wanted) {
  const float2 room = (float2)(21.0f, 18.0f);
  if (!sample(picture, p - (float)(RADIUS + 1), BORDERED, room, wanted->bordered)) return false;
  float xx = 0.0f, xy = 0.0f, yy = 0.0f, mean_x = 0.0f, mean_y = 0.0f;
  for (int j = 0; j < WINDOW; ++j) {
    for (int i = 0; i < WINDOW; ++i) {
      const float2 g = slope(wanted, i, j);
      xx += g.x * g.x, xy += g.x * g.y, yy += g.y * g.y;
      mean_x += g.x, mean_y += g.y;
    }
  }
  mean_x /= COUNT, mean_y /= COUNT;
  xx -= COUNT * mean_x * mean_x, xy -= COUNT * mean_x * mean_y, yy -= COUNT * mean_y * mean_y;
  wanted->xx = xx, wanted->xy = xy, wanted->yy = yy;
  wanted->mean_x = mean_x, wanted->mean_y = mean_y;
  const float least = 0.5f * (xx + yy) - sqrt(0.25f * (xx - yy) * (xx - yy) + xy * xy);
  return least >= least_corner * COUNT;
}

/// x of m x = b; m symmetric and positive definite, of which the lower triangle is read and lost.
void solve(float m[MOTIONS][MOTIONS], float b[MOTIONS]) {
  for (int c = 0; c < MOTIONS; ++c) {
    for (int k = 0; k < c; ++k) m[c][c] -= m[c][k] * m[c][k];
    m[c][c] = sqrt(m[c][c]);
    for (int r = c + 1; r < MOTIONS; ++r) {
      for (int k = 0; k < c; ++k) m[r][c] -= m[r][k] * m[c][k];
      m[r][c] /= m[c][c];
    }
  }
  for (int r = 0; r < MOTIONS; ++r) {
    for (int k = 0; k < r; ++k) b[r] -= m[r][k] * b[k];
    b[r] /= m[r][r];
  }
  for (int r = MOTIONS - 1; r >= 0; --r) {
    for (int k = r + 1; k < MOTIONS; ++k) b[r] -= m[k][r] * b[k];
    b[r] /= m[r][r];
  }
}

/// By how much the window's middle lies beside where it was found, since it deforms on the way.
float2 middle_off(const Wanted* wanted, const float* seen, float mean) {
  float m[MOTIONS][MOTIONS], b[MOTIONS], sums[MOTIONS];
  for (int i = 0; i < MOTIONS; ++i) {
    b[i] = sums[i] = 0.0f;
    for (int j = 0; j < MOTIONS; ++j) m[i][j] = 0.0f;
  }
  for (int row = 0; row < WINDOW; ++row) {
    for (int column = 0; column < WINDOW; ++column) {
      const float2 g = slope(wanted, column, row);
      const float u = (float)(column - RADIUS), v = (float)(row - RADIUS);
      const float motion[MOTIONS] = {g.x, g.y, g.x * u, g.x * v, g.y * u, g.y * v};
      const float difference =
          seen[row * WINDOW + column] - wanted->bordered[(row + 1) * BORDERED + column + 1];
      for (int i = 0; i < MOTIONS; ++i) {
        for (int j = 0; j <= i; ++j) m[i][j] += motion[i] * motion[j];
        sums[i] += motion[i];
        b[i] += motion[i] * difference;
      }
    }
  }
  for (int i = 0; i < MOTIONS; ++i) {
    b[i] -= mean * sums[i];
    for (int j = 0; j <= i; ++j) m[i][j] -= sums[i] * sums[j] / COUNT;
    if (i >= 2) m[i][i] += (GREY_NOISE / DEFORMATION) * (GREY_NOISE / DEFORMATION);
  }
  solve(m, b);
  return (float2)(b[0], b[1]);
}

/// Moves @p q to where the picture looks like the window, as it has deformed if it @p deforms. False
/// where it leaves the picture or goes too far. @param error  Mean difference of what was found.
bool align(const Wanted* wanted, Picture picture, bool deforms, float2* q, float* error) {
  const float2 room = (float2)(21.0f, 18.0f);
  const float det = wanted->xx * wanted->yy - wanted->xy * wanted->xy;
  const float2 start = *q;
  float seen[WINDOW * WINDOW];
  for (int k = 0; k < ITERATIONS; ++k) {
    if (!sample(picture, *q - (float)RADIUS, WINDOW, room, seen)) return false;
    float x = 0.0f, y = 0.0f, sum = 0.0f;
    for (int j = 0; j < WINDOW; ++j) {
      for (int i = 0; i < WINDOW; ++i) {
        const float difference =
            seen[j * WINDOW + i] - wanted->bordered[(j + 1) * BORDERED + i + 1];
        const float2 g = slope(wanted, i, j);
        x += difference * g.x, y += difference * g.y;
        sum += difference;
      }
    }
    x -= sum * wanted->mean_x, y -= sum * wanted->mean_y;
    const float2 move =
        (float2)(wanted->yy * x - wanted->xy * y, wanted->xx * y - wanted->xy * x) / det;
    *q -= move;
    if (!(length(*q - start) < 2.0f * WINDOW)) return false;
    if (dot(move, move) > ENOUGH * ENOUGH && k + 1 < ITERATIONS) continue;
    float difference = 0.0f;
    for (int j = 0; j < WINDOW; ++j) {
      for (int i = 0; i < WINDOW; ++i) {
        difference += fabs(seen[j * WINDOW + i] -
                           wanted->bordered[(j + 1) * BORDERED + i + 1] - sum / COUNT);
      }
    }
    *error = difference / COUNT;
    if (deforms) {
      const float2 off = middle_off(wanted, seen, sum / COUNT) - move;
      if (dot(off, off) < MOST_OFF * MOST_OFF) *q -= off;
    }
    break;
  }
  return true;
}

/// Whether @p p is found again; then @p q is where.
bool track(const Picture* previous, const Picture* next, float2 p, float2* q) {
  Wanted wanted;
  float error = 0.0f;
  *q = p;
  for (int level = LEVELS - 1; level >= 0; --level) {
    const float scale = (float)(1 << level);
    float2 at = *q / scale;
    // Coarse levels help where they can; the finest one must succeed.
    const bool found =
        take(previous[level], p / scale, level == 0 ? LEAST_CORNER : LEAST_CORNER / 4.0f,
             &wanted) &&
        align(&wanted, next[level], level == 0, &at, &error);
    if (found) *q = at * scale;
    if (level == 0 && !(found && error <= MOST_ERROR)) return false;
  }
  float2 back = p;
  return take(next[0], *q, 0.0f, &wanted) && align(&wanted, previous[0], false, &back, &error) &&
         length(back - p) <= BACK;
}

/// A work item a point.
/// @param points, rows    f32 [<=capacity,2] and how many there are.
/// @param tracks, status  f32 [<=capacity,2] and u8 [<=capacity]; get as many.
__kernel void track_points(
    __global const uchar* restrict previous0, __global const uchar* restrict previous1,
    __global const uchar* restrict previous2, __global const uchar* restrict previous3,
    __global const uchar* restrict next0, __global const uchar* restrict next1,
    __global const uchar* restrict next2, __global const uchar* restrict next3,
    __global const float* restrict points, __global const int* restrict rows,
    __global float* restrict tracks, __global int* restrict tracks_rows,
    __global uchar* restrict status, __global int* restrict status_rows, int width, int height,
    int capacity) {
  const int point = (int)get_global_id(0);
  const int count = clamp(rows[0], 0, capacity);
  if (point == 0) tracks_rows[0] = status_rows[0] = count;
  if (point >= count) return;
  Picture previous[LEVELS] = {
      {previous0, width, height}, {previous1, 0, 0}, {previous2, 0, 0}, {previous3, 0, 0}};
  Picture next[LEVELS] = {{next0, width, height}, {next1, 0, 0}, {next2, 0, 0}, {next3, 0, 0}};
  for (int level = 1; level < LEVELS; ++level) {
    previous[level].width = next[level].width = (previous[level - 1].width + 1) / 2;
    previous[level].height = next[level].height = (previous[level - 1].height + 1) / 2;
  }
  const float2 p = vload2(point, points);
  float2 q = p;
  const bool found = track(previous, next, p, &q);
  vstore2(found ? q : p, point, tracks);
  status[point] = found ? 1 : 0;
}
