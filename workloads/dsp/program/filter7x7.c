/* filter7x7: correlation with 49 weights of 8 bits, halves to the even neighbour, reflect-101.
 *
 * Sums need 32 bits: products of four bytes at a time, eight columns of weights of which the last
 * is 0. Each output row takes seven rows anew, since neither their 21 vectors nor the sums of the
 * seven output rows that an input row goes into would stay in registers. */
#include "workloads/dsp/program/hvx.h"
#include "workloads/dsp/program/kernel.h"

enum { kSize = 7, kRadius = 3 };

/* Sums of 128 columns, less 2^15: 4i and 4i + 2 in the first pair, 4i + 1 and 4i + 3 in the other.
 */
typedef struct {
  HVX_VectorPair even, odd;
} Sums;

INLINE Sums add_row(Sums sums, RowPart part, int32_t weights_0_3, int32_t weights_4_7) {
  const HVX_Vector at_0 = Q6_V_vlalign_VVR(part.here, part.before, kRadius);
  const HVX_Vector at_4 = Q6_V_valign_VVR(part.after, part.here, 4 - kRadius);
  const HVX_Vector at_8 = Q6_V_valign_VVR(part.after, part.here, 8 - kRadius);
  const HVX_VectorPair near = Q6_W_vcombine_VV(at_4, at_0);
  const HVX_VectorPair far = Q6_W_vcombine_VV(at_8, at_4);
  sums.even = Q6_Ww_vrmpyacc_WwWubRbI(sums.even, near, weights_0_3, 0);
  sums.odd = Q6_Ww_vrmpyacc_WwWubRbI(sums.odd, near, weights_0_3, 1);
  sums.even = Q6_Ww_vrmpyacc_WwWubRbI(sums.even, far, weights_4_7, 0);
  sums.odd = Q6_Ww_vrmpyacc_WwWubRbI(sums.odd, far, weights_4_7, 1);
  return sums;
}

/* 16 bits hold what is left of 2^15 after a saturation that changes no result: what is cut off
 * gives 0 or 255 either way. */
INLINE HVX_VectorPair narrowed(Sums sums) {
  return Q6_W_vcombine_VV(Q6_Vh_vsat_VwVw(Q6_V_hi_W(sums.odd), Q6_V_lo_W(sums.odd)),
                          Q6_Vh_vsat_VwVw(Q6_V_hi_W(sums.even), Q6_V_lo_W(sums.even)));
}

/* A sum s rounds to (s + 127 + bit 8 of s) >> 8, which is a half up where the result would be odd.
 */
INLINE HVX_Vector half_even(HVX_Vector sums) {
  const HVX_Vector odd = Q6_Vuh_vlsr_VuhR(Q6_V_vand_VV(sums, Q6_V_vsplat_R(0x01000100)), 8);
  return Q6_Vh_vadd_VhVh_sat(sums, Q6_Vh_vadd_VhVh(odd, Q6_V_vsplat_R(0x007f007f)));
}

INLINE HVX_Vector rounded(HVX_VectorPair sums) {
  const HVX_Vector bytes =
      Q6_Vb_vshuffo_VbVb(half_even(Q6_V_hi_W(sums)), half_even(Q6_V_lo_W(sums)));
  return Q6_V_vxor_VV(bytes, Q6_V_vsplat_R((int32_t)0x80808080)); /* the 2^15 again */
}

INLINE HVX_VectorPair filter(const uint8_t* const rows[kSize], const Strip* strip,
                             const int32_t* weights) {
  const HVX_Vector offset = Q6_V_vsplat_R(-32768);
  const HVX_VectorPair offsets = Q6_W_vcombine_VV(offset, offset);
  Sums sums = {offsets, offsets};
#pragma clang loop unroll(full)
  for (int j = 0; j < kSize; ++j) {
    sums = add_row(sums, load_row_part(rows[j], strip), weights[2 * j], weights[2 * j + 1]);
  }
  return narrowed(sums);
}

INLINE void filter_strip(Strip strip, const uint8_t* in, uint8_t* out, const int32_t* weights,
                         int height, int stride) {
  const uint8_t* rows[kSize];
  Rows all = {in, -kRadius, height, stride};
#pragma clang loop unroll(full)
  for (int j = 0; j < kSize; ++j) rows[j] = next_row(&all);
  HVX_VectorPair sums = filter(rows, &strip, weights);
  uint8_t* to = out + strip.x;
  /* A row is rounded while the next one is summed up; the last round sums for nothing. */
#pragma clang loop unroll(disable)
  for (int y = 0; y < height; ++y) {
#pragma clang loop unroll(full)
    for (int j = 0; j + 1 < kSize; ++j) rows[j] = rows[j + 1];
    rows[kSize - 1] = next_row(&all);
    store(to, rounded(sums));
    to += stride;
    sums = filter(rows, &strip, weights);
  }
}

/* buffers: in u8 [height, stride], out alike; values: width >= 8, height >= 8, stride, then the
 * weights row by row: bytes 0 to 3 and 4 to 6 of each, the 8th byte 0. */
void pirt_dsp_filter7x7(const KernelArguments* arguments) {
  const uint8_t* in = arguments->buffers[0];
  uint8_t* out = arguments->buffers[1];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];
  int32_t weights[2 * kSize];
  for (int i = 0; i < 2 * kSize; ++i) weights[i] = arguments->values[3 + i];
  FOR_EACH_STRIP(width, filter_strip, in, out, weights, height, stride);
}
