/* undistort: bilinear along a map that is known beforehand.
 *
 * HVX of this generation cannot gather from memory, but it looks up 128 bytes at a time in a table
 * of
 * 32. The host has cut the picture into tiles of 16x8 pixels, each of which comes from a window of
 * 32 columns and at most 16 rows of the source: each row of the window is one such table. The
 * source lies within zeros, so that nothing is outside. */
#include "workloads/backends/dsp/program/hvx.h"
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/undistort_plan.h"

/* Rows of the window whose tables a vector has, and how many make the 8 bits of an index. */
enum { kTables = 4, kHalf = 8 };

/* Four rows' tables: one after the other, then shuffled as vlut32 wants them. Row i is loaded from
 * as far before its begin as its table's place is. */
INLINE HVX_Vector load_tables(const uint8_t* window, int stride) {
  const HVX_Vector row_0 = load_unaligned(window);
  const HVX_Vector row_1 = load_unaligned(window + stride - 32);
  const HVX_Vector row_2 = load_unaligned(window + 2 * stride - 64);
  const HVX_Vector row_3 = load_unaligned(window + 3 * stride - 96);
  const HVX_Vector low = Q6_V_vmux_QVV(Q6_Q_vsetq_R(32), row_0, row_1);
  const HVX_Vector high = Q6_V_vmux_QVV(Q6_Q_vsetq_R(96), row_2, row_3);
  return Q6_Vb_vshuff_Vb(Q6_V_vmux_QVV(Q6_Q_vsetq_R(64), low, high));
}

INLINE HVX_Vector look_up(HVX_Vector index, HVX_Vector tables_0_3, HVX_Vector tables_4_7) {
  HVX_Vector found = Q6_Vb_vlut32_VbVbR(index, tables_0_3, 0);
  found = Q6_Vb_vlut32or_VbVbVbR(found, index, tables_0_3, 1);
  found = Q6_Vb_vlut32or_VbVbVbR(found, index, tables_0_3, 2);
  found = Q6_Vb_vlut32or_VbVbVbR(found, index, tables_0_3, 3);
  found = Q6_Vb_vlut32or_VbVbVbR(found, index, tables_4_7, 4);
  found = Q6_Vb_vlut32or_VbVbVbR(found, index, tables_4_7, 5);
  found = Q6_Vb_vlut32or_VbVbVbR(found, index, tables_4_7, 6);
  return Q6_Vb_vlut32or_VbVbVbR(found, index, tables_4_7, 7);
}

/* The same where only the first four are used. */
INLINE HVX_Vector look_up_few(HVX_Vector index, HVX_Vector tables_0_3) {
  HVX_Vector found = Q6_Vb_vlut32_VbVbR(index, tables_0_3, 0);
  found = Q6_Vb_vlut32or_VbVbVbR(found, index, tables_0_3, 1);
  found = Q6_Vb_vlut32or_VbVbVbR(found, index, tables_0_3, 2);
  return Q6_Vb_vlut32or_VbVbVbR(found, index, tables_0_3, 3);
}

/* The pixel at the map's position and those right, below, and right below of it. */
typedef struct {
  HVX_Vector at[4];
} Neighbours;

INLINE Neighbours indices(HVX_Vector index) {
  const Neighbours next = {{index, Q6_Vb_vadd_VbVb(index, Q6_V_vsplat_R(0x01010101)),
                            Q6_Vb_vadd_VbVb(index, Q6_V_vsplat_R(0x20202020)),
                            Q6_Vb_vadd_VbVb(index, Q6_V_vsplat_R(0x21212121))}};
  return next;
}

INLINE Neighbours fetch(const uint8_t* window, int stride, int rows, HVX_Vector index,
                        HVX_Vector flags) {
  const Neighbours wanted = indices(index);
  const HVX_Vector tables_0_3 = load_tables(window, stride);
  const HVX_Vector tables_4_7 = load_tables(window + kTables * stride, stride);
  Neighbours found;
#pragma clang loop unroll(full)
  for (int i = 0; i < 4; ++i) found.at[i] = look_up(wanted.at[i], tables_0_3, tables_4_7);
  if (rows <= kHalf) return found;
  /* Rows 8 to 15 have the same indices once more; flags say which of the two a pixel means. */
  const HVX_Vector tables_8_11 = load_tables(window + kHalf * stride, stride);
  Neighbours beyond;
  if (rows <= kHalf + kTables) {
#pragma clang loop unroll(full)
    for (int i = 0; i < 4; ++i) beyond.at[i] = look_up_few(wanted.at[i], tables_8_11);
  } else {
    const HVX_Vector tables_12_15 = load_tables(window + (kHalf + kTables) * stride, stride);
#pragma clang loop unroll(full)
    for (int i = 0; i < 4; ++i) beyond.at[i] = look_up(wanted.at[i], tables_8_11, tables_12_15);
  }
  const HVX_VectorPred here = Q6_Q_vand_VR(flags, all_bytes(PIRT_DSP_FLAG_HERE));
  const HVX_VectorPred below = Q6_Q_vand_VR(flags, all_bytes(PIRT_DSP_FLAG_BELOW));
  found.at[0] = Q6_V_vmux_QVV(here, beyond.at[0], found.at[0]);
  found.at[1] = Q6_V_vmux_QVV(here, beyond.at[1], found.at[1]);
  found.at[2] = Q6_V_vmux_QVV(below, beyond.at[2], found.at[2]);
  found.at[3] = Q6_V_vmux_QVV(below, beyond.at[3], found.at[3]);
  return found;
}

/* Weights of 5 bits: along x in 16 bits, then along y in 32, (sum + 512) >> 10. */
INLINE HVX_Vector interpolate(Neighbours p, HVX_Vector fx, HVX_Vector fy) {
  const HVX_Vector one = Q6_V_vsplat_R(0x20202020);
  const HVX_Vector rest_x = Q6_Vb_vsub_VbVb(one, fx);
  const HVX_VectorPair above =
      Q6_Wuh_vmpyacc_WuhVubVub(Q6_Wuh_vmpy_VubVub(p.at[0], rest_x), p.at[1], fx);
  const HVX_VectorPair below =
      Q6_Wuh_vmpyacc_WuhVubVub(Q6_Wuh_vmpy_VubVub(p.at[2], rest_x), p.at[3], fx);
  const HVX_VectorPair wide_y = Q6_Wuh_vzxt_Vub(fy);
  const HVX_VectorPair rest_y = Q6_Wuh_vzxt_Vub(Q6_Vb_vsub_VbVb(one, fy));
  HVX_Vector halves[2];
#pragma clang loop unroll(full)
  for (int i = 0; i < 2; ++i) {
    const HVX_Vector a = i == 0 ? Q6_V_lo_W(above) : Q6_V_hi_W(above);
    const HVX_Vector b = i == 0 ? Q6_V_lo_W(below) : Q6_V_hi_W(below);
    const HVX_Vector weight = i == 0 ? Q6_V_lo_W(wide_y) : Q6_V_hi_W(wide_y);
    const HVX_Vector rest = i == 0 ? Q6_V_lo_W(rest_y) : Q6_V_hi_W(rest_y);
    const HVX_VectorPair sum = Q6_Ww_vmpyacc_WwVhVh(Q6_Ww_vmpy_VhVh(a, rest), b, weight);
    halves[i] = Q6_Vh_vasr_VwVwR_rnd_sat(Q6_V_hi_W(sum), Q6_V_lo_W(sum), 10);
  }
  return Q6_Vb_vshuffe_VbVb(halves[1], halves[0]);
}

/* Exchanges blocks of `bytes` between two vectors: the second ones of the first with the first ones
 * of the second. */
INLINE void exchange(HVX_Vector* a, HVX_Vector* b, int bytes) {
  const HVX_VectorPair both = Q6_W_vshuff_VVR(*b, *a, bytes);
  *a = Q6_V_lo_W(both);
  *b = Q6_V_hi_W(both);
}

/* From eight tiles, 16 columns each, to eight rows. */
INLINE void tiles_to_rows(HVX_Vector v[8]) {
#pragma clang loop unroll(full)
  for (int i = 0; i < 4; ++i) exchange(&v[i], &v[i + 4], 64);
#pragma clang loop unroll(full)
  for (int i = 0; i < 8; ++i) {
    if ((i & 2) == 0) exchange(&v[i], &v[i + 2], 32);
  }
#pragma clang loop unroll(full)
  for (int i = 0; i < 8; i += 2) exchange(&v[i], &v[i + 1], 16);
}

/* buffers: source u8 [.., source stride] with what is outside as zeros, out u8 [height, stride],
 * PirtDspTile [tiles], tiles' vectors (index, fx, fy with flags) u8 [tiles, 3, 128]; tiles eight in
 * a row, rows of them from top to bottom; values: height, stride, source stride. */
void pirt_dsp_undistort(const KernelArguments* arguments) {
  const uint8_t* source = arguments->buffers[0];
  uint8_t* out = arguments->buffers[1];
  const PirtDspTile* tile = arguments->buffers[2];
  const uint8_t* vectors = arguments->buffers[3];
  const int height = arguments->values[0];
  const int stride = arguments->values[1];
  const int source_stride = arguments->values[2];
  for (int y = 0; y < height; y += PIRT_DSP_TILE_HEIGHT) {
    for (int x = 0; x < stride; x += kVector) {
      HVX_Vector results[8];
#pragma clang loop unroll(disable)
      for (int i = 0; i < 8; ++i, ++tile, vectors += 3 * kVector) {
        const HVX_Vector flags = load(vectors + 2 * kVector);
        const Neighbours found =
            fetch(source + tile->window, source_stride, tile->rows, load(vectors), flags);
        results[i] = interpolate(found, load(vectors + kVector),
                                 Q6_V_vand_VV(flags, Q6_V_vsplat_R(0x1f1f1f1f)));
      }
      tiles_to_rows(results);
      uint8_t* to = out + y * stride + x;
      const int rows = height - y < PIRT_DSP_TILE_HEIGHT ? height - y : PIRT_DSP_TILE_HEIGHT;
      for (int i = 0; i < rows; ++i, to += stride) store(to, results[i]);
    }
  }
}
