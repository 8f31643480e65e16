/* optical_flow: dense Lucas-Kanade, window 52x52, exact sums, one division a pixel.
 *
 * Sums of products down the columns are kept and change by one row a row. Vectors hold every fourth
 * column (as products of halved halves come), so that a window of 52 columns is 13 consecutive
 * words of the four columns' sum, and the next three windows differ from it by two words each. */
#include "workloads/backends/dsp/program/hvx.h"
#include "workloads/backends/dsp/program/kernel.h"

enum {
  kWords = 32,
  kBehind = 26,
  kAhead = 25,
  kProducts = 5, /* xx, xy, yy, xt, yt */
  kPhases = 4,   /* column % 4 */
  kBlock = 4 * kWords
};

/* ----------------------------------------------------------------------------------- derivatives
 */

/* Of 128 columns, even ones in a first vector, odd ones in a second; along x, along y, in time. */
typedef struct {
  HVX_Vector half[2][3];
} Derivatives;

enum { kDerivativeBytes = sizeof(Derivatives) };

/* Rows of the picture as this one, above and below. */
INLINE void derive_row(const uint8_t* above, const uint8_t* row, const uint8_t* below,
                       const uint8_t* next, int width, Derivatives* out) {
  for (int x = 0; x < width; x += kBlock, ++out) {
    /* What is beyond the picture's edges is the edge pixel. */
    const HVX_Vector edge = Q6_V_vsplat_R(all_bytes(row[width - 1]));
    const HVX_Vector before = x == 0 ? Q6_V_vsplat_R(all_bytes(row[0])) : load(row + x - kVector);
    const HVX_Vector here = Q6_V_vmux_QVV(first(width - x), load(row + x), edge);
    const HVX_Vector after =
        Q6_V_vmux_QVV(first(width - x - kVector), load(row + x + kVector), edge);
    const HVX_VectorPair along =
        Q6_Wh_vsub_VubVub(Q6_V_valign_VVR(after, here, 1), Q6_V_vlalign_VVR(here, before, 1));
    const HVX_VectorPair down = Q6_Wh_vsub_VubVub(load(below + x), load(above + x));
    const HVX_VectorPair time = Q6_Wh_vsub_VubVub(load(next + x), load(row + x));
    const Derivatives all = {{{Q6_V_lo_W(along), Q6_V_lo_W(down), Q6_V_lo_W(time)},
                              {Q6_V_hi_W(along), Q6_V_hi_W(down), Q6_V_hi_W(time)}}};
    *out = all;
  }
}

/* ---------------------------------------------------------------------------- sums of the columns
 */

/* For each product and phase a line of words with a vector more at either end: word i is column
 * 4 i + phase. Then for each product the sum of its four. */
typedef struct {
  int32_t* first; /* word 0 of product 0, phase 0 */
  int line;       /* words from one line to the next */
  int blocks;
  int width;
} Columns;

INLINE int32_t* line_of(Columns c, int product, int phase) {
  return c.first + (product * kPhases + phase) * c.line;
}
INLINE int32_t* total_of(Columns c, int product) {
  return c.first + (kProducts * kPhases + product) * c.line;
}

/* sum += new products - old ones, of two derivatives each. */
INLINE HVX_VectorPair exchange_products(HVX_VectorPair sum, HVX_Vector new_a, HVX_Vector new_b,
                                        HVX_Vector minus_old_a, HVX_Vector old_b) {
  return Q6_Ww_vmpyacc_WwVhVh(Q6_Ww_vmpyacc_WwVhVh(sum, new_a, new_b), minus_old_a, old_b);
}

static void exchange_rows(Columns c, const Derivatives* added, const Derivatives* removed) {
  static const uint8_t factors[kProducts][2] = {{0, 0}, {0, 1}, {1, 1}, {0, 2}, {1, 2}};
  for (int block = 0; block < c.blocks; ++block) {
#pragma clang loop unroll(full)
    for (int half = 0; half < 2; ++half) {
      const HVX_Vector* in = added[block].half[half];
      const HVX_Vector* out = removed[block].half[half];
      const HVX_Vector minus[2] = {Q6_Vh_vsub_VhVh(Q6_V_vzero(), out[0]),
                                   Q6_Vh_vsub_VhVh(Q6_V_vzero(), out[1])};
#pragma clang loop unroll(full)
      for (int p = 0; p < kProducts; ++p) {
        int32_t* even = line_of(c, p, half) + block * kWords;
        int32_t* odd = line_of(c, p, half + 2) + block * kWords;
        const int a = factors[p][0];
        const int b = factors[p][1];
        const HVX_VectorPair sum = exchange_products(Q6_W_vcombine_VV(load(odd), load(even)), in[a],
                                                     in[b], minus[a], out[b]);
        store(even, Q6_V_lo_W(sum));
        store(odd, Q6_V_hi_W(sum));
      }
    }
  }
}

/* Beyond the edges are the edge columns' sums; then the totals. */
static void finish_columns(Columns c) {
  const int last = c.width - 1;
  for (int p = 0; p < kProducts; ++p) {
    const HVX_Vector left = Q6_V_vsplat_R(line_of(c, p, 0)[0]);
    const HVX_Vector right = Q6_V_vsplat_R(line_of(c, p, last & 3)[last >> 2]);
    for (int phase = 0; phase < kPhases; ++phase) {
      int32_t* line = line_of(c, p, phase);
      int32_t* end = line + (c.blocks - 1) * kWords;
      /* Words whose column there is: (width - phase + 3) / 4. */
      const int words = (c.width - phase + 3) / 4 - (c.blocks - 1) * kWords;
      store(line - kWords, left);
      store(end, Q6_V_vmux_QVV(first(4 * words), load(end), right));
      store(end + kWords, right);
    }
    const int32_t* line = line_of(c, p, 0);
    int32_t* total = total_of(c, p);
    for (int i = -kWords; i <= c.blocks * kWords; i += kWords) {
      const HVX_Vector even = Q6_Vw_vadd_VwVw(load(line + i), load(line + 2 * c.line + i));
      const HVX_Vector odd = Q6_Vw_vadd_VwVw(load(line + c.line + i), load(line + 3 * c.line + i));
      store(total + i, Q6_Vw_vadd_VwVw(even, odd));
    }
  }
}

/* ---------------------------------------------------------------------------- sums of the windows
 */

/* Sum of words i to i + 12, by doubling. */
INLINE HVX_Vector sum_of_13(HVX_Vector low, HVX_Vector high) {
  const HVX_Vector two_low = Q6_Vw_vadd_VwVw(low, Q6_V_valign_VVR(high, low, 4));
  const HVX_Vector two_high = Q6_Vw_vadd_VwVw(high, Q6_V_vror_VR(high, 4));
  const HVX_Vector four_low = Q6_Vw_vadd_VwVw(two_low, Q6_V_valign_VVR(two_high, two_low, 8));
  const HVX_Vector four_high = Q6_Vw_vadd_VwVw(two_high, Q6_V_vror_VR(two_high, 8));
  const HVX_Vector eight = Q6_Vw_vadd_VwVw(four_low, Q6_V_valign_VVR(four_high, four_low, 16));
  return Q6_Vw_vadd_VwVw(eight, Q6_Vw_vadd_VwVw(Q6_V_valign_VVR(four_high, four_low, 32),
                                                Q6_V_valign_VVR(high, low, 48)));
}

/* Of word i of one block, by phase. */
typedef struct {
  HVX_Vector sum[kPhases][kProducts];
} Windows;

/* sum + words at `gained` - words at `lost` */
INLINE HVX_Vector moved(HVX_Vector sum, const int32_t* gained, const int32_t* lost) {
  return Q6_Vw_vadd_VwVw(sum, Q6_Vw_vsub_VwVw(load_unaligned(gained), load_unaligned(lost)));
}

/* That of column 4 i + 2 has the columns from 4 i - 24 to 4 i + 27: words i - 6 to i + 6 of all.
 * Its neighbours' lie one or two columns aside. */
INLINE void sum_windows(Columns c, int block, Windows* windows) {
  for (int p = 0; p < kProducts; ++p) {
    const int32_t* total = total_of(c, p) + block * kWords - 6;
    const int32_t* phase_0 = line_of(c, p, 0) + block * kWords;
    const int32_t* phase_2 = line_of(c, p, 2) + block * kWords;
    const int32_t* phase_3 = line_of(c, p, 3) + block * kWords;
    const HVX_Vector two = sum_of_13(load_unaligned(total), load_unaligned(total + kWords));
    const HVX_Vector one = moved(two, phase_3 - 7, phase_3 + 6);
    windows->sum[0][p] = moved(one, phase_2 - 7, phase_2 + 6);
    windows->sum[1][p] = one;
    windows->sum[2][p] = two;
    windows->sum[3][p] = moved(two, phase_0 + 7, phase_0 - 6);
  }
}

/* ---------------------------------------------------------------------------------- the equations
 */

/* (a * b) >> 31, rounded. */
INLINE HVX_Vector multiply_31(HVX_Vector a, HVX_Vector b) {
  return Q6_Vw_vmpyoacc_VwVwVh_s1_rnd_sat_shift(Q6_Vw_vmpye_VwVuh(a, b), a, b);
}

/* A sum (29 bits with sign) as halves high * 2^14 + low. */
INLINE HVX_Vector split(HVX_Vector sum) {
  const HVX_VectorPred upper = Q6_Q_vand_VR(Q6_V_vsplat_R((int32_t)0xffff0000), 0x01010101);
  return Q6_V_vmux_QVV(upper, Q6_Vw_vasl_VwR(sum, 2), Q6_V_vand_VV(sum, Q6_V_vsplat_R(0x3fff)));
}
INLINE HVX_Vector minus(HVX_Vector halves) { return Q6_Vh_vsub_VhVh(Q6_V_vzero(), halves); }
INLINE HVX_Vector swapped(HVX_Vector halves) {
  return Q6_V_vdelta_VV(halves, Q6_V_vsplat_R(0x02020202));
}

/* mantissa * 2^(25 - exponent), 31 bits and sign, the first of them 1 where the value is not 0. */
typedef struct {
  HVX_Vector mantissa, exponent;
} Scaled;

/* a * b + c * d of split numbers, of which b and d are given swapped, too; exact before the
 * scaling. */
INLINE Scaled sum_of_products(HVX_Vector a, HVX_Vector b, HVX_Vector b_swapped, HVX_Vector c,
                              HVX_Vector d, HVX_Vector d_swapped) {
  const HVX_Vector part = Q6_V_vsplat_R(0x3fff);
  const HVX_VectorPair outer = Q6_Ww_vmpyacc_WwVhVh(Q6_Ww_vmpy_VhVh(a, b), c, d);
  HVX_Vector middle = Q6_Vw_vdmpyacc_VwVhVh_sat(Q6_Vw_vdmpy_VhVh_sat(a, b_swapped), c, d_swapped);
  const HVX_Vector low = Q6_V_lo_W(outer);
  middle = Q6_Vw_vadd_VwVw(middle, Q6_Vw_vasr_VwR(low, 14));
  const HVX_Vector high = Q6_Vw_vadd_VwVw(Q6_V_hi_W(outer), Q6_Vw_vasr_VwR(middle, 14));
  /* high * 2^28 + rest, as 32 bits with sign and 31 below them */
  const HVX_Vector rest =
      Q6_V_vor_VV(Q6_Vw_vasl_VwR(Q6_V_vand_VV(middle, part), 14), Q6_V_vand_VV(low, part));
  const HVX_Vector top = Q6_V_vor_VV(Q6_Vw_vasl_VwR(high, 3), Q6_Vuw_vlsr_VuwR(rest, 25));
  const HVX_Vector bottom = Q6_V_vand_VV(Q6_Vw_vasl_VwR(rest, 6), Q6_V_vsplat_R(0x7fffffff));
  /* Twice, since a small value begins in the lower part. */
  const HVX_Vector once = Q6_Vw_vnormamt_Vw(top);
  const HVX_Vector value =
      Q6_V_vor_VV(Q6_Vw_vasl_VwVw(top, once),
                  Q6_Vw_vlsr_VwVw(bottom, Q6_Vw_vsub_VwVw(Q6_V_vsplat_R(31), once)));
  const HVX_Vector again = Q6_Vw_vnormamt_Vw(value);
  const Scaled scaled = {Q6_Vw_vasl_VwVw(value, again), Q6_Vw_vadd_VwVw(once, again)};
  return scaled;
}

/* 2^60 / d of d from 2^30 to 2^31, by Newton from 48/17 - 32/17 d, which is off by 1/17 at most. */
INLINE HVX_Vector reciprocal(HVX_Vector d) {
  const HVX_Vector one = Q6_V_vsplat_R(1 << 29);
  HVX_Vector r =
      Q6_Vw_vsub_VwVw(Q6_V_vsplat_R(1515870810), multiply_31(d, Q6_V_vsplat_R(1010580540)));
#pragma clang loop unroll(full)
  for (int i = 0; i < 3; ++i) {
    const HVX_Vector error = Q6_Vw_vsub_VwVw(one, multiply_31(d, r));
    r = Q6_Vw_vadd_VwVw(r, multiply_31(r, Q6_Vw_vasl_VwR(error, 2)));
  }
  return r;
}

/* 2 * numerator / denominator as f32; 0 where the denominator is. */
INLINE HVX_Vector twice_quotient(Scaled numerator, Scaled denominator, HVX_Vector inverse) {
  const HVX_Vector quotient = multiply_31(numerator.mantissa, inverse); /* 2^28 to 2^30, signed */
  const HVX_Vector size = Q6_Vw_vabs_Vw_sat(quotient);
  const HVX_Vector shift = Q6_Vw_vnormamt_Vw(size);
  const HVX_Vector mantissa =
      Q6_Vuw_vlsr_VuwR(Q6_Vw_vadd_VwVw(Q6_Vw_vasl_VwVw(size, shift), Q6_V_vsplat_R(64)), 7);
  const HVX_Vector exponent =
      Q6_Vw_vsub_VwVw(Q6_Vw_vadd_VwVw(denominator.exponent, Q6_V_vsplat_R(128)),
                      Q6_Vw_vadd_VwVw(numerator.exponent, shift));
  const HVX_Vector sign = Q6_V_vand_VV(quotient, Q6_V_vsplat_R((int32_t)0x80000000));
  /* The mantissa's first bit adds 1 to the exponent. */
  const HVX_Vector value =
      Q6_V_vor_VV(sign, Q6_Vw_vadd_VwVw(Q6_Vw_vasl_VwR(exponent, 23), mantissa));
  const HVX_VectorPred none = Q6_Q_or_QQ(Q6_Q_vcmp_eq_VwVw(quotient, Q6_V_vzero()),
                                         Q6_Q_vcmp_eq_VwVw(denominator.mantissa, Q6_V_vzero()));
  return Q6_V_vmux_QVV(none, Q6_V_vzero(), value);
}

typedef struct {
  HVX_Vector u, v;
} Flow;

INLINE Flow solve(const HVX_Vector sums[kProducts]) {
  const HVX_Vector xx = split(sums[0]);
  const HVX_Vector xy = split(sums[1]);
  const HVX_Vector yy = split(sums[2]);
  const HVX_Vector xt = split(sums[3]);
  const HVX_Vector yt = split(sums[4]);
  const HVX_Vector xy_swapped = swapped(xy);
  const HVX_Vector xt_swapped = swapped(xt);
  const HVX_Vector yt_swapped = swapped(yt);
  const Scaled determinant = sum_of_products(xx, yy, swapped(yy), minus(xy), xy, xy_swapped);
  const Scaled u = sum_of_products(xy, yt, yt_swapped, minus(yy), xt, xt_swapped);
  const Scaled v = sum_of_products(xy, xt, xt_swapped, minus(xx), yt, yt_swapped);
  const HVX_Vector inverse = reciprocal(determinant.mantissa);
  const Flow flow = {twice_quotient(u, determinant, inverse),
                     twice_quotient(v, determinant, inverse)};
  return flow;
}

/* ---------------------------------------------------------------------------------------- the call
 */

/* Four vectors of u and of v, of every fourth column, as (u, v) column by column. */
INLINE void store_flow(float* to, const Flow flow[kPhases]) {
  HVX_VectorPair columns[kPhases]; /* (u, v) of word i */
#pragma clang loop unroll(full)
  for (int i = 0; i < kPhases; ++i) columns[i] = Q6_W_vshuff_VVR(flow[i].v, flow[i].u, -4);
#pragma clang loop unroll(full)
  for (int half = 0; half < 2; ++half) {
    HVX_Vector v[kPhases];
    for (int i = 0; i < kPhases; ++i) {
      v[i] = half == 0 ? Q6_V_lo_W(columns[i]) : Q6_V_hi_W(columns[i]);
    }
    const HVX_VectorPair first_two = Q6_W_vshuff_VVR(v[1], v[0], -8);
    const HVX_VectorPair last_two = Q6_W_vshuff_VVR(v[3], v[2], -8);
    const HVX_VectorPair low = Q6_W_vshuff_VVR(Q6_V_lo_W(last_two), Q6_V_lo_W(first_two), -16);
    const HVX_VectorPair high = Q6_W_vshuff_VVR(Q6_V_hi_W(last_two), Q6_V_hi_W(first_two), -16);
    store(to, Q6_V_lo_W(low));
    store(to + kWords, Q6_V_hi_W(low));
    store(to + 2 * kWords, Q6_V_lo_W(high));
    store(to + 3 * kWords, Q6_V_hi_W(high));
    to += kBlock;
  }
}

static void flow_of_row(Columns c, float* out) {
  Windows windows;
  Flow flow[kPhases];
  for (int block = 0; block < c.blocks; ++block, out += 2 * kBlock) {
    sum_windows(c, block, &windows);
    for (int i = 0; i < kPhases; ++i) flow[i] = solve(windows.sum[i]);
    store_flow(out, flow);
  }
}

static void clear(void* to, int bytes) {
  for (int i = 0; i < bytes; i += kVector) store((uint8_t*)to + i, Q6_V_vzero());
}

/* buffers: previous u8 [height, stride], next alike, flow f32 [height, stride, 2], derivatives of
 * height + 1 rows, sums of the columns (25 lines of stride / 4 words and a vector at each end);
 * values: width >= 8, height >= 8, stride. */
void pirt_dsp_optical_flow(const KernelArguments* arguments) {
  const uint8_t* previous = arguments->buffers[0];
  const uint8_t* next = arguments->buffers[1];
  float* out = arguments->buffers[2];
  Derivatives* derivatives = arguments->buffers[3];
  int32_t* sums = arguments->buffers[4];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];
  const int blocks = stride / kBlock;

  for (int y = 0; y < height; ++y) {
    derive_row(previous + clamped(y - 1, height) * stride, previous + y * stride,
               previous + clamped(y + 1, height) * stride, next + y * stride, width,
               derivatives + y * blocks);
  }
  const Derivatives* nothing = derivatives + height * blocks;
  clear(derivatives + height * blocks, blocks * kDerivativeBytes);

  const int line = stride / 4 + 2 * kWords;
  const Columns columns = {sums + kWords, line, blocks, width};
  clear(sums, (kProducts * kPhases + kProducts) * line * 4);
  for (int y = -kBehind - 1; y < kAhead; ++y) {
    exchange_rows(columns, derivatives + clamped(y, height) * blocks, nothing);
  }
  for (int y = 0; y < height; ++y) {
    exchange_rows(columns, derivatives + clamped(y + kAhead, height) * blocks,
                  derivatives + clamped(y - kBehind - 1, height) * blocks);
    finish_columns(columns);
    flow_of_row(columns, out + 2 * y * stride);
  }
}
