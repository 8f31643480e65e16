/* feature_detect: Shi-Tomasi corners, from the picture to the list of them.
 *
 * The smaller eigenvalue of [xx xy; xy yy] is (xx + yy - |(xx - yy, 2 xy)|) / 2; the length comes
 * from a CORDIC, whose shifts and additions keep all bits of the sums. Strengths are integers, 128
 * times the eigenvalue. What follows the local maxima (order, distances) is scalar. */
#include "workloads/backends/dsp/program/corners.h"
#include "workloads/backends/dsp/program/hvx.h"
#include "workloads/backends/dsp/program/kernel.h"

enum {
  kWords = 32, /* a vector's */
  kFractionBits = 6,
  kIterations = 15, /* leave 2^-29 of the length */
  kNoise = 63       /* more than the rounding of a strength that is 0 */
};

/* ------------------------------------------------------------------------------------ strengths */

/* Sums of a row's products over three rows, with room for one column mirrored at each end. */
typedef struct {
  int32_t *xx, *xy, *yy;
} ColumnSums;

INLINE void store_words(int32_t* to, HVX_VectorPair values) {
  const HVX_VectorPair ordered = Q6_W_vshuff_VVR(Q6_V_hi_W(values), Q6_V_lo_W(values), -4);
  store(to, Q6_V_lo_W(ordered));
  store(to + kWords, Q6_V_hi_W(ordered));
}

/* Three rows of gradients, one above the other. */
typedef struct {
  const int16_t *x[3], *y[3];
} GradientRows;

static void sum_columns(const GradientRows* rows, ColumnSums sums, int width) {
  for (int x = 0; x < width; x += 2 * kWords) {
    HVX_Vector gx = load(rows->x[0] + x);
    HVX_Vector gy = load(rows->y[0] + x);
    HVX_VectorPair xx = Q6_Ww_vmpy_VhVh(gx, gx);
    HVX_VectorPair xy = Q6_Ww_vmpy_VhVh(gx, gy);
    HVX_VectorPair yy = Q6_Ww_vmpy_VhVh(gy, gy);
#pragma clang loop unroll(full)
    for (int i = 1; i < 3; ++i) {
      gx = load(rows->x[i] + x);
      gy = load(rows->y[i] + x);
      xx = Q6_Ww_vmpyacc_WwVhVh(xx, gx, gx);
      xy = Q6_Ww_vmpyacc_WwVhVh(xy, gx, gy);
      yy = Q6_Ww_vmpyacc_WwVhVh(yy, gy, gy);
    }
    store_words(sums.xx + x, xx);
    store_words(sums.xy + x, xy);
    store_words(sums.yy + x, yy);
  }
  int32_t* const all[] = {sums.xx, sums.xy, sums.yy};
  for (int i = 0; i < 3; ++i) {
    all[i][-1] = all[i][1];
    all[i][width] = all[i][width - 2];
  }
}

/* Of each word and its two neighbours. */
INLINE HVX_Vector sum_of_three(const int32_t* at) {
  const HVX_Vector here = load(at);
  const HVX_Vector sides = Q6_Vw_vadd_VwVw(Q6_V_vlalign_VVR(here, load(at - kWords), 4),
                                           Q6_V_valign_VVR(load(at + kWords), here, 4));
  return Q6_Vw_vadd_VwVw(here, sides);
}

/* (a * b) >> 31, rounded. */
INLINE HVX_Vector multiply_31(HVX_Vector a, HVX_Vector b) {
  return Q6_Vw_vmpyoacc_VwVwVh_s1_rnd_sat_shift(Q6_Vw_vmpye_VwVuh(a, b), a, b);
}

/* |(a, b)| with kFractionBits more; sums of nine squares up to 1020^2, twice, leave room for them
 * and for the growth of 1.65. */
INLINE HVX_Vector length(HVX_Vector a, HVX_Vector b) {
  const HVX_Vector unscale = Q6_V_vsplat_R(1304065748); /* 0.6072529350 * 2^31 */
  HVX_Vector x = Q6_Vw_vasl_VwR(Q6_Vw_vabs_Vw(a), kFractionBits);
  HVX_Vector y = Q6_Vw_vasl_VwR(Q6_Vw_vabs_Vw(b), kFractionBits);
#pragma clang loop unroll(full)
  for (int i = 0; i < kIterations; ++i) {
    /* One by the shifter, the other by the multiplier: there is one shift in a packet. */
    const HVX_Vector turn_x = i == 0 ? y : Q6_Vw_vmpye_VwVuh(y, Q6_V_vsplat_R(1 << (16 - i)));
    const HVX_Vector turn_y = i == 0 ? x : Q6_Vw_vasr_VwR(x, i);
    x = Q6_Vw_vadd_VwVw(x, turn_x);
    y = Q6_Vw_vabs_Vw(Q6_Vw_vsub_VwVw(y, turn_y));
  }
  return multiply_31(x, unscale);
}

INLINE HVX_Vector strength(ColumnSums sums, int x) {
  const HVX_Vector xx = sum_of_three(sums.xx + x);
  const HVX_Vector xy = sum_of_three(sums.xy + x);
  const HVX_Vector yy = sum_of_three(sums.yy + x);
  const HVX_Vector trace = Q6_Vw_vasl_VwR(Q6_Vw_vadd_VwVw(xx, yy), kFractionBits);
  const HVX_Vector off =
      Q6_Vw_vsub_VwVw(trace, length(Q6_Vw_vsub_VwVw(xx, yy), Q6_Vw_vadd_VwVw(xy, xy)));
  return Q6_Vw_vmax_VwVw(off, Q6_V_vzero());
}

/* One row; returns the largest of each lane so far. Two blocks at a time, since each is one long
 * dependence. */
static HVX_Vector strengths_of_row(ColumnSums sums, int32_t* out, int width, HVX_Vector largest) {
  for (int x = 0; x < width; x += 2 * kWords) {
    const HVX_VectorPred here = first(4 * (width - x));
    const HVX_VectorPred behind = first(4 * (width - x - kWords));
    const HVX_Vector a = Q6_V_vmux_QVV(here, strength(sums, x), Q6_V_vzero());
    const HVX_Vector b = Q6_V_vmux_QVV(behind, strength(sums, x + kWords), Q6_V_vzero());
    store(out + x, a);
    store(out + x + kWords, b);
    largest = Q6_Vw_vmax_VwVw(largest, Q6_Vw_vmax_VwVw(a, b));
  }
  return largest;
}

static int32_t largest_word(HVX_Vector v) {
#pragma clang loop unroll(full)
  for (int bytes = 4; bytes < kVector; bytes *= 2) {
    v = Q6_Vw_vmax_VwVw(v, Q6_V_vror_VR(v, bytes));
  }
  int32_t words[kWords] __attribute__((aligned(128)));
  store(words, v);
  return words[0];
}

/* --------------------------------------------------------------------------------- local maxima */

/* Bit k of word i is set where column 32 k + i is no less than its neighbours and above the
 * threshold. */
INLINE HVX_Vector maxima(const int32_t* row, int stride, int blocks, HVX_Vector threshold) {
  HVX_Vector found = Q6_V_vzero();
  HVX_Vector before = Q6_V_vzero(); /* no matter: the first column is none */
  HVX_Vector here =
      Q6_Vw_vmax_VwVw(load(row), Q6_Vw_vmax_VwVw(load(row - stride), load(row + stride)));
  for (int k = 0; k < blocks; ++k, row += kWords) {
    const int32_t* next = row + kWords;
    const HVX_Vector after =
        Q6_Vw_vmax_VwVw(load(next), Q6_Vw_vmax_VwVw(load(next - stride), load(next + stride)));
    const HVX_Vector around = Q6_Vw_vmax_VwVw(
        here, Q6_Vw_vmax_VwVw(Q6_V_vlalign_VVR(here, before, 4), Q6_V_valign_VVR(after, here, 4)));
    const HVX_Vector value = load(row);
    const HVX_VectorPred is_maximum =
        Q6_Q_and_QQn(Q6_Q_vcmp_gt_VwVw(value, threshold), Q6_Q_vcmp_gt_VwVw(around, value));
    found = Q6_V_vandor_VQR(found, is_maximum, 1 << k);
    before = here;
    here = after;
  }
  return found;
}

/* Appends the row's; columns at the picture's edges are none. */
static int append_maxima(const int32_t* row, int stride, int y, int width, int32_t threshold,
                         uint64_t* candidates, int count) {
  uint32_t bits[kWords] __attribute__((aligned(128)));
  for (int x0 = 0; x0 < width; x0 += kWords * kWords) {
    const int left = (width - x0 + kWords - 1) / kWords;
    store(bits, maxima(row + x0, stride, left < kWords ? left : kWords, Q6_V_vsplat_R(threshold)));
    for (int i = 0; i < kWords; ++i) {
      for (uint32_t rest = bits[i]; rest != 0; rest &= rest - 1) {
        const int x = x0 + kWords * __builtin_ctz(rest) + i;
        if (x >= 1 && x < width - 1) candidates[count++] = key_of(row[x], x, y);
      }
    }
  }
  return count;
}

static void clear(void* to, int bytes) {
  for (int i = 0; i < bytes; i += kVector) store((uint8_t*)to + i, Q6_V_vzero());
}

/* -------------------------------------------------------------------------------------- the call
 */

static int32_t all_strengths(const int16_t* gx, const int16_t* gy, ColumnSums sums, int32_t* out,
                             int width, int height, int stride) {
  HVX_Vector largest = Q6_V_vzero();
  for (int y = 0; y < height; ++y) {
    GradientRows rows;
    for (int i = 0; i < 3; ++i) {
      const int row = mirrored(y + i - 1, height) * stride;
      rows.x[i] = gx + row;
      rows.y[i] = gy + row;
    }
    sum_columns(&rows, sums, width);
    largest = strengths_of_row(sums, out + y * stride, width, largest);
  }
  return largest_word(largest);
}

/* buffers: in u8 [height, stride], corners f32 [500, 2], count i32 [1], gx and gy i16 [height,
 * stride], strengths i32 [height, stride] and a vector, scratch (three rows of i32 with a vector at
 * each end, then the map of Occupied), candidates u64 [height * width]; values: width >= 8, height
 * >= 8 (both below 2^16), stride. */
void pirt_dsp_feature_detect(const KernelArguments* arguments) {
  float* corners = arguments->buffers[1];
  int32_t* count = arguments->buffers[2];
  int16_t* gx = arguments->buffers[3];
  int16_t* gy = arguments->buffers[4];
  int32_t* strengths = arguments->buffers[5];
  int32_t* scratch = arguments->buffers[6];
  uint64_t* candidates = arguments->buffers[7];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];

  const KernelArguments sobel = {{arguments->buffers[0], gx, gy}, arguments->values};
  pirt_dsp_sobel(&sobel);
  const int sums_row = stride + 2 * kWords;
  const ColumnSums sums = {scratch + kWords, scratch + sums_row + kWords,
                           scratch + 2 * sums_row + kWords};
  const int32_t largest = all_strengths(gx, gy, sums, strengths, width, height, stride);
  const int32_t threshold = largest / 100 > kNoise ? largest / 100 : kNoise;
  int found = 0;
  for (int y = 1; y < height - 1; ++y) {
    found = append_maxima(strengths + y * stride, stride, y, width, threshold, candidates, found);
  }

  uint32_t* occupied = (uint32_t*)(scratch + 3 * sums_row);
  const int words = stride / 32 + 2;
  const int rows = height + 2 * kDistance;
  clear(occupied, rows * words * 4);
  clear(corners, kMostCorners * 8);
  const Occupied map = {occupied + kDistance * words + 1, words};
  *count = choose(candidates, found, map, corners);
}
