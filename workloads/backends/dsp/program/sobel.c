/* sobel: Gx and Gy of 3x3, exact, reflect-101.
 *
 * Along a row [-1 0 1] and [1 2 1] by sliding products; down a column [1 2 1] as two sums of
 * neighbours, [-1 0 1] as a difference. */
#include "workloads/backends/dsp/program/hvx.h"
#include "workloads/backends/dsp/program/kernel.h"

/* Even columns in the low vector, odd ones in the high. */
typedef struct {
  HVX_VectorPair slope; /* [-1 0 1] along the row */
  HVX_VectorPair mean;  /* [1 2 1] */
} Filtered;

INLINE Filtered along(RowPart part) {
  const HVX_Vector behind = Q6_V_vlalign_VVR(part.here, part.before, 1);
  const HVX_Vector ahead = Q6_V_valign_VVR(part.after, part.here, 1);
  const HVX_VectorPair both = Q6_W_vcombine_VV(ahead, behind);
  const Filtered filtered = {Q6_Wh_vtmpy_WubRb(both, bytes4(-1, 0, -1, 0)),
                             Q6_Wh_vtmpy_WubRb(both, bytes4(1, 2, 1, 2))};
  return filtered;
}

typedef struct {
  Filtered row;          /* the last one */
  HVX_VectorPair slopes; /* of the last two */
  HVX_VectorPair mean;   /* of the one before the last */
  Filtered filtered;     /* what is added next; see gaussian_blur.c */
  RowPart loaded;
} Pipeline;

typedef struct {
  HVX_VectorPair x, y;
} Gradients;

INLINE Gradients advance(Pipeline* pipeline, const uint8_t* row, const Strip* strip) {
  const Filtered now = pipeline->filtered;
  const HVX_VectorPair slopes = Q6_Wh_vadd_WhWh(now.slope, pipeline->row.slope);
  const Gradients gradients = {Q6_Wh_vadd_WhWh(slopes, pipeline->slopes),
                               Q6_Wh_vsub_WhWh(now.mean, pipeline->mean)};
  pipeline->slopes = slopes;
  pipeline->mean = pipeline->row.mean;
  pipeline->row = now;
  pipeline->filtered = along(pipeline->loaded);
  pipeline->loaded = load_row_part(row, strip);
  return gradients;
}

/* 128 columns in their order. */
INLINE void store_row(int16_t* to, HVX_VectorPair values) {
  const HVX_VectorPair ordered = Q6_W_vshuff_VVR(Q6_V_hi_W(values), Q6_V_lo_W(values), -2);
  store(to, Q6_V_lo_W(ordered));
  store(to + 64, Q6_V_hi_W(ordered));
}

INLINE void sobel_strip(Strip strip, const uint8_t* in, int16_t* out_x, int16_t* out_y, int height,
                        int stride) {
  enum { kAhead = 1 + 2 }; /* rows of the filter and of the pipeline */
  Rows rows = {in, -1, height, stride};
  Pipeline pipeline;
  pipeline.loaded = load_row_part(next_row(&rows), &strip);
  pipeline.filtered = along(pipeline.loaded);
  pipeline.loaded = load_row_part(next_row(&rows), &strip);
  pipeline.row = pipeline.filtered; /* of no consequence after two rows */
  pipeline.slopes = pipeline.mean = pipeline.filtered.slope;
  for (int i = 0; i < 2; ++i) advance(&pipeline, next_row(&rows), &strip);

  const uint8_t* row = in + kAhead * stride;
  int16_t* to_x = out_x + strip.x;
  int16_t* to_y = out_y + strip.x;
#pragma clang loop unroll(disable)
  for (int y = 0; y < height; ++y) {
    const Gradients gradients = advance(&pipeline, row, &strip);
    store_row(to_x, gradients.x);
    store_row(to_y, gradients.y);
    to_x += stride;
    to_y += stride;
    row += stride;
    if (y >= height - 1 - kAhead) row = in + mirrored(y + 1 + kAhead, height) * stride;
  }
}

/* buffers: in u8 [height, stride], gx and gy i16 alike; values: width >= 8, height >= 8, stride. */
void pirt_dsp_sobel(const KernelArguments* arguments) {
  const uint8_t* in = arguments->buffers[0];
  int16_t* out_x = arguments->buffers[1];
  int16_t* out_y = arguments->buffers[2];
  const int width = arguments->values[0];
  const int height = arguments->values[1];
  const int stride = arguments->values[2];
  FOR_EACH_STRIP(width, sobel_strip, in, out_x, out_y, height, stride);
}
