/* gaussian_blur: 5x5 binomial, (sum + 128) >> 8, reflect-101.
 *
 * Along a row by two sliding products, 16 bits; down a column as four sums of neighbours, since
 * [1 4 6 4 1] is [1 1] four times: what a row adds to is kept in registers. */
#include "workloads/backends/dsp/program/hvx.h"
#include "workloads/backends/dsp/program/kernel.h"

/* [1 4 6 4 1] along the row, even columns in the low vector, odd ones in the high. */
INLINE HVX_VectorPair along(RowPart part) {
  const HVX_Vector behind = Q6_V_vlalign_VVR(part.here, part.before, 2);
  const HVX_Vector ahead = Q6_V_valign_VVR(part.after, part.here, 2);
  const HVX_VectorPair sum =
      Q6_Wh_vdmpy_WubRb(Q6_W_vcombine_VV(part.here, behind), bytes4(1, 4, 1, 4));
  return Q6_Wh_vtmpyacc_WhWubRb(sum, Q6_W_vcombine_VV(ahead, part.here), bytes4(6, 4, 6, 4));
}

typedef struct {
  HVX_VectorPair row, two, three, four; /* sums of the last one, two, ... rows' */
} Column;

INLINE HVX_VectorPair step(Column* column, HVX_VectorPair row) {
  const HVX_VectorPair two = Q6_Wh_vadd_WhWh(row, column->row);
  const HVX_VectorPair three = Q6_Wh_vadd_WhWh(two, column->two);
  const HVX_VectorPair four = Q6_Wh_vadd_WhWh(three, column->three);
  const HVX_VectorPair five = Q6_Wh_vadd_WhWh(four, column->four);
  *column = (Column){row, two, three, four};
  return five;
}

/* (sum + 128) >> 8 is the upper byte of 16 bits that hold 255 * 256 + 128. */
INLINE HVX_Vector rounded(HVX_VectorPair sum) {
  const HVX_Vector half = Q6_V_vsplat_R(128 << 16 | 128);
  sum = Q6_Wh_vadd_WhWh(sum, Q6_W_vcombine_VV(half, half));
  return Q6_Vb_vshuffo_VbVb(Q6_V_hi_W(sum), Q6_V_lo_W(sum));
}

/* One row is loaded, the one above it filtered along, and the one above that added to its column at
 * a time: three independent works, whose instructions share packets. The last first, so that each
 * finds what the one before it left in the round before. */
typedef struct {
  Column column;
  HVX_VectorPair filtered;
  RowPart loaded;
} Pipeline;

INLINE HVX_VectorPair advance(Pipeline* pipeline, const uint8_t* row, const Strip* strip) {
  const HVX_VectorPair sum = step(&pipeline->column, pipeline->filtered);
  pipeline->filtered = along(pipeline->loaded);
  pipeline->loaded = load_row_part(row, strip);
  return sum;
}

INLINE void blur_strip(Strip strip, const uint8_t* in, uint8_t* out, int height, int stride) {
  enum { kAhead = 2 + 2 }; /* rows of the filter and of the pipeline */
  Rows rows = {in, -2, height, stride};
  Pipeline pipeline;
  pipeline.loaded = load_row_part(next_row(&rows), &strip);
  pipeline.filtered = along(pipeline.loaded);
  pipeline.loaded = load_row_part(next_row(&rows), &strip);
  pipeline.column = (Column){pipeline.filtered, pipeline.filtered, pipeline.filtered,
                             pipeline.filtered}; /* of no consequence after four rows */
  for (int i = 0; i < 4; ++i) advance(&pipeline, next_row(&rows), &strip);

  const uint8_t* row = in + kAhead * stride;
  uint8_t* to = out + strip.x;
#pragma clang loop unroll(disable)
  for (int y = kAhead; y < height; ++y) {
    store(to, rounded(advance(&pipeline, row, &strip)));
    row += stride;
    to += stride;
  }
  rows.y = height;
#pragma clang loop unroll(disable)
  for (int i = 0; i < kAhead; ++i) {
    store(to, rounded(advance(&pipeline, next_row(&rows), &strip)));
    to += stride;
  }
}

/* buffers: in u8 [height, stride], out alike; values: width >= 8, height >= 8, stride. */
void pirt_dsp_gaussian_blur(const KernelArguments* arguments) {
  const uint8_t* in = arguments->buffers[0];
  uint8_t* out = arguments->buffers[1];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];
  FOR_EACH_STRIP(width, blur_strip, in, out, height, stride);
}
