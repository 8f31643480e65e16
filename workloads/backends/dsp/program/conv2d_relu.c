/* conv2d_relu in 8 bits, without padding and with a stride of whole words (conv1: 11x11, stride 4).
 *
 * A vector has 32 output channels; four input bytes of a row go to all of them. Four pixels share
 * the weights that are loaded. */
#include "workloads/backends/dsp/program/int8.h"
#include "workloads/backends/dsp/program/kernel.h"

enum { kGroups = 3, kPixels = 4 }; /* 96 channels at a time, as many sums as registers */

typedef struct {
  int in_c, in_h, pitch; /* a row's bytes; f32 rows have four times that */
  int out_c, out_h, out_w;
  int k_h, words;   /* of a row's weights */
  int stride, step; /* in rows, in words of a row */
} Shape;

/* Sums of four bytes over the rows below one output row: words[i] of bytes 4 i to 4 i + 3. */
static void sum_inputs(const int8_t* in, const Shape* s, int y, int32_t* sums) {
  const HVX_Vector ones = Q6_V_vsplat_R(0x01010101);
  for (int x = 0; x < s->pitch; x += kVector) {
    HVX_Vector sum = Q6_V_vzero();
    for (int c = 0; c < s->in_c; ++c) {
      const int8_t* row = in + (c * s->in_h + y * s->stride) * s->pitch + x;
      for (int j = 0; j < s->k_h; ++j, row += s->pitch) {
        sum = Q6_Vw_vrmpyacc_VwVbVb(sum, load(row), ones);
      }
    }
    store(sums + x / 4, sum);
  }
}

/* Sums of kPixels pixels from column x on, 3 * 32 channels each. */
typedef struct {
  HVX_Vector of[kPixels][kGroups];
} Sums;

INLINE Sums multiply(const int8_t* in, const uint8_t* weights, const Shape* s, int x, int y,
                     int words, int step) {
  Sums sums;
  for (int p = 0; p < kPixels; ++p) {
    for (int g = 0; g < kGroups; ++g) sums.of[p][g] = Q6_V_vzero();
  }
  for (int c = 0; c < s->in_c; ++c) {
    const int8_t* row = in + (c * s->in_h + y * s->stride) * s->pitch + 4 * step * x;
    for (int j = 0; j < s->k_h; ++j, row += s->pitch) {
      const int32_t* word = (const int32_t*)row;
      for (int k = 0; k < words; ++k, ++word, weights += kGroups * kVector) {
#pragma clang loop unroll(full)
        for (int g = 0; g < kGroups; ++g) {
          const HVX_Vector w = load(weights + g * kVector);
#pragma clang loop unroll(full)
          for (int p = 0; p < kPixels; ++p) {
            sums.of[p][g] = Q6_Vw_vrmpyacc_VwVubRb(sums.of[p][g], w, word[p * step]);
          }
        }
      }
    }
  }
  return sums;
}

/* One pixel's channels as f32. */
INLINE void finish(const HVX_Vector sums[kGroups], int32_t inputs, ChannelScales scales,
                   int channel, float* out) {
  const HVX_Vector excess = Q6_V_vsplat_R(kOffset * inputs);
#pragma clang loop unroll(full)
  for (int g = 0; g < kGroups; ++g) {
    const int c = channel + g * kWords;
    const HVX_Vector sum = Q6_Vw_vadd_VwVw(Q6_Vw_vsub_VwVw(sums[g], excess), load(scales.bias + c));
    store(out + c, to_float(Q6_Vw_vmax_VwVw(sum, Q6_V_vzero()), factor_at(scales, c)));
  }
}

static void convolve_row(const int8_t* in, const uint8_t* weights, const Shape* s, int y,
                         const int32_t* input_sums, ChannelScales scales, int channel, int channels,
                         float* out) {
  for (int begin = 0; begin < s->out_w; begin += kPixels) {
    /* The last ones overlap those before. */
    const int x = begin + kPixels <= s->out_w ? begin : s->out_w - kPixels;
    /* conv1's numbers as constants: three words are too few for a loop. */
    const Sums sums = s->words == 3 && s->step == 1
                          ? multiply(in, weights, s, x, y, 3, 1)
                          : multiply(in, weights, s, x, y, s->words, s->step);
    for (int p = 0; p < kPixels; ++p) {
      int32_t inputs = 0;
      for (int k = 0; k < s->words; ++k) inputs += input_sums[(x + p) * s->step + k];
      finish(sums.of[p], inputs, scales, channel, out + (x + p) * channels);
    }
  }
}

/* 32x32 words: exchanges ever smaller blocks between rows as far apart as these are wide. */
static void transpose(HVX_Vector v[kWords]) {
  for (int distance = kWords / 2; distance > 0; distance /= 2) {
    for (int i = 0; i < kWords; ++i) {
      if ((i & distance) != 0) continue;
      const HVX_VectorPair both = Q6_W_vshuff_VVR(v[i + distance], v[i], 4 * distance);
      v[i] = Q6_V_lo_W(both);
      v[i + distance] = Q6_V_hi_W(both);
    }
  }
}

/* From [pixels, channels] to [out_c, pixels]. */
static void to_planes(const float* in, int channels, float* out, int out_c, int pixels) {
  for (int begin = 0; begin < pixels; begin += kWords) {
    const int pixel = begin + kWords <= pixels ? begin : pixels - kWords;
    for (int channel = 0; channel < out_c; channel += kWords) {
      HVX_Vector block[kWords];
      for (int i = 0; i < kWords; ++i) block[i] = load(in + (pixel + i) * channels + channel);
      transpose(block);
      const int there = out_c - channel < kWords ? out_c - channel : kWords;
      for (int i = 0; i < there; ++i) {
        *(HVX_Unaligned*)(out + (channel + i) * pixels + pixel) = (HVX_Unaligned)block[i];
      }
    }
  }
}

/* buffers: in f32 [in_c * in_h, pitch], out f32 [out_c, out_h, out_w], weights u8 [sets of 96
 * channels, in_c, k_h, words, 3, 32, 4] with 128 added, ChannelScales of all sets' channels, in i8
 * as in, f32 [out_h * out_w, channels], sums i32 [pitch / 4]; values: Shape (out_w >= 4, out_h *
 * out_w >= 32), then the input's factor. */
void pirt_dsp_conv2d_relu(const KernelArguments* arguments) {
  const float* in = arguments->buffers[0];
  const uint8_t* weights = arguments->buffers[2];
  int8_t* bytes = arguments->buffers[4];
  float* pixels = arguments->buffers[5];
  int32_t* input_sums = arguments->buffers[6];
  const int32_t* v = arguments->values;
  const Shape s = {v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9]};
  const Factor factor = factor_of(v[10], v[11]);
  for (int i = 0; i < s.in_c * s.in_h * s.pitch; i += kVector) {
    store(bytes + i, quantized_128(in + i, factor));
  }
  const int set = kGroups * kWords;
  const int channels = (s.out_c + set - 1) / set * set;
  const ChannelScales scales = scales_at(arguments->buffers[3], channels);
  const int set_bytes = s.in_c * s.k_h * s.words * kGroups * kVector;
  for (int y = 0; y < s.out_h; ++y) {
    sum_inputs(bytes, &s, y, input_sums);
    const uint8_t* w = weights;
    for (int channel = 0; channel < channels; channel += set, w += set_bytes) {
      convolve_row(bytes, w, &s, y, input_sums, scales, channel, channels,
                   pixels + y * s.out_w * channels);
    }
  }
  to_planes(pixels, channels, arguments->buffers[1], s.out_c, s.out_h * s.out_w);
}
