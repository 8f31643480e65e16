/* filter7x7: correlation with 49 weights of 8 bits, halves to the even neighbour, reflect-101.
 *
 * Sums need 32 bits: products of four bytes at a time, eight columns of weights of which the last
 * is 0. Each output row takes seven rows anew, since neither their 21 vectors nor the sums of the
 * seven output rows that an input row goes into would stay in registers. */
#include "workloads/backends/dsp/program/hvx.h"
#include "workloads/backends/dsp/program/kernel.h"

enum { kSize = 7, kRadius = 3 };

/* Sums of 128 columns, less 2^15: 4i and 4i + 2 in the first pair, 4i + 1 and 4i + 3 in the other.
 */
typedef struct {
  HVX_VectorPair even, odd;
} Sums;

/* A row from columns x - 3, x + 1 and x + 5 on. */
typedef struct {
  HVX_Vector at_0, at_4, at_8;
} Shifted;

INLINE Shifted load_shifted(const uint8_t* at) {
  const HVX_Vector here = load(at);
  const HVX_Vector after = load(at + kVector);
  const Shifted row = {Q6_V_vlalign_VVR(here, load(at - kVector), kRadius),
                       Q6_V_valign_VVR(after, here, 4 - kRadius),
                       Q6_V_valign_VVR(after, here, 8 - kRadius)};
  return row;
}

INLINE Sums add_row(Sums sums, Shifted row, int32_t weights_0_3, int32_t weights_4_7) {
  const HVX_VectorPair near = Q6_W_vcombine_VV(row.at_4, row.at_0);
  const HVX_VectorPair far = Q6_W_vcombine_VV(row.at_8, row.at_4);
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

/* The picture with kRadius rows above and below and a vector at each side, what is mirrored there
 * included: the loop that multiplies knows no borders. */
static void make_bordered(const uint8_t* in, uint8_t* to, int width, int height, int stride) {
  for (int y = -kRadius; y < height + kRadius; ++y) {
    const uint8_t* row = in + mirrored(y, height) * stride;
    store(to, reversed(load_unaligned(row + 1)));
    to += kVector;
    int x = 0;
    for (; x + kVector <= width; x += kVector, to += kVector) store(to, load(row + x));
    if (x < width) {
      const Strip last = make_strip(x, width, (StripEdges){0, 1});
      const RowPart part = load_row_part(row, &last);
      store(to, part.here);
      to += kVector;
      store(to, part.after);
    } else {
      store(to, reversed(load_unaligned(row + 2 * (width - 1) - x - (kVector - 1))));
    }
    to += kVector;
  }
}

/* 128 columns of a row from the seven around it. The first of them was loaded in the row before, so
 * that there is something to multiply at once; the next one's is left in its place. */
INLINE HVX_VectorPair filter(const uint8_t* at, int stride, const int32_t* weights,
                             Shifted* first_row) {
  const HVX_Vector offset = Q6_V_vsplat_R(-32768);
  const HVX_VectorPair offsets = Q6_W_vcombine_VV(offset, offset);
  Sums sums = {offsets, offsets};
  sums = add_row(sums, *first_row, weights[0], weights[1]);
  *first_row = load_shifted(at + stride);
  sums = add_row(sums, *first_row, weights[2], weights[3]);
#pragma clang loop unroll(full)
  for (int j = 2; j < kSize; ++j) {
    sums = add_row(sums, load_shifted(at + j * stride), weights[2 * j], weights[2 * j + 1]);
  }
  return narrowed(sums);
}

static void filter_strip(const uint8_t* at, int stride, uint8_t* to, int to_stride, int height,
                         const int32_t* packed) {
  int32_t weights[2 * kSize];
#pragma clang loop unroll(full)
  for (int i = 0; i < 2 * kSize; ++i) weights[i] = packed[i];
  Shifted first_row = load_shifted(at);
  HVX_VectorPair sums = filter(at, stride, weights, &first_row);
  /* A row is rounded while the next one is summed up. */
#pragma clang loop unroll(disable)
  for (int y = 1; y < height; ++y) {
    at += stride;
    const HVX_VectorPair next = filter(at, stride, weights, &first_row);
    store(to, rounded(sums));
    to += to_stride;
    sums = next;
  }
  store(to, rounded(sums));
}

/* buffers: in u8 [height, stride], out alike, bordered u8 [height + 6, stride + 256]; values: width
 * >= 8, height >= 8, stride, then the weights row by row: bytes 0 to 3 and 4 to 6 of each, the 8th
 * byte 0. */
void pirt_dsp_filter7x7(const KernelArguments* arguments) {
  uint8_t* out = arguments->buffers[1];
  uint8_t* bordered = arguments->buffers[2];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];
  const int bordered_stride = stride + 2 * kVector;
  make_bordered(arguments->buffers[0], bordered, width, height, stride);
  for (int x = 0; x < width; x += kVector) {
    filter_strip(bordered + kVector + x, bordered_stride, out + x, stride, height,
                 arguments->values + 3);
  }
}
