/* The scalar twin of ../optical_flow.c: sums down the columns, then along the row, both by
 * difference. */
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/program/picture.h"

enum { kBehind = 26, kAhead = 25, kProducts = 5 };

/* Products of one pixel: xx, xy, yy, xt, yt. */
typedef struct {
  int32_t of[kProducts];
} Products;

typedef struct {
  const uint8_t *previous, *next;
  int width, height, stride;
} Pictures;

static Products products_at(const Pictures* p, const uint8_t* above, const uint8_t* row,
                            const uint8_t* below, const uint8_t* next, int x) {
  const int dx = row[clamped(x + 1, p->width)] - row[clamped(x - 1, p->width)];
  const int dy = below[x] - above[x];
  const int dt = next[x] - row[x];
  const Products all = {{dx * dx, dx * dy, dy * dy, dx * dt, dy * dt}};
  return all;
}

static void add_row(const Pictures* p, int y, int sign, Products* columns) {
  y = clamped(y, p->height);
  const uint8_t* row = p->previous + y * p->stride;
  const uint8_t* above = p->previous + clamped(y - 1, p->height) * p->stride;
  const uint8_t* below = p->previous + clamped(y + 1, p->height) * p->stride;
  const uint8_t* next = p->next + y * p->stride;
  for (int x = 0; x < p->width; ++x) {
    const Products products = products_at(p, above, row, below, next, x);
    for (int i = 0; i < kProducts; ++i) columns[x].of[i] += sign * products.of[i];
  }
}

/* To 2^-24 or so; there is no C library. */
static float inverse(float x) {
  uint32_t bits;
  __builtin_memcpy(&bits, &x, sizeof bits);
  bits = 0x7ef311c7 - bits;
  float r;
  __builtin_memcpy(&r, &bits, sizeof r);
  for (int i = 0; i < 4; ++i) r = r * (2.0F - x * r);
  return r;
}

static void solve(const int32_t s[kProducts], float* flow) {
  const int64_t xx = s[0], xy = s[1], yy = s[2], xt = s[3], yt = s[4];
  const int64_t determinant = xx * yy - xy * xy;
  flow[0] = flow[1] = 0.0F;
  if (determinant == 0) return;
  const float factor = 2.0F * inverse((float)determinant);
  flow[0] = (float)(xy * yt - yy * xt) * factor;
  flow[1] = (float)(xy * xt - xx * yt) * factor;
}

static void flow_of_row(const Products* columns, int width, float* out) {
  int32_t sums[kProducts] = {0, 0, 0, 0, 0};
  for (int x = -kBehind - 1; x < kAhead; ++x) {
    for (int i = 0; i < kProducts; ++i) sums[i] += columns[clamped(x, width)].of[i];
  }
  for (int x = 0; x < width; ++x, out += 2) {
    const int32_t* gained = columns[clamped(x + kAhead, width)].of;
    const int32_t* lost = columns[clamped(x - kBehind - 1, width)].of;
    for (int i = 0; i < kProducts; ++i) sums[i] += gained[i] - lost[i];
    solve(sums, out);
  }
}

void pirt_dsp_optical_flow(const KernelArguments* arguments) {
  const Pictures pictures = {arguments->buffers[0], arguments->buffers[1], arguments->values[0],
                             arguments->values[1], arguments->values[2]};
  float* out = arguments->buffers[2];
  Products columns[kWidest];
  for (int x = 0; x < pictures.width; ++x) {
    for (int i = 0; i < kProducts; ++i) columns[x].of[i] = 0;
  }
  for (int y = -kBehind - 1; y < kAhead; ++y) add_row(&pictures, y, 1, columns);
  for (int y = 0; y < pictures.height; ++y) {
    add_row(&pictures, y + kAhead, 1, columns);
    add_row(&pictures, y - kBehind - 1, -1, columns);
    flow_of_row(columns, pictures.width, out + 2 * y * pictures.stride);
  }
}
