/* fully_connected in 8 bits: each weight is loaded once, which is what it takes. */
#include "workloads/backends/dsp/program/int8.h"
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/program/softmax.h"

static int32_t sum_of(const int8_t* bytes, int count) {
  HVX_Vector sums = Q6_V_vzero();
  for (int i = 0; i < count; i += kVector) {
    sums = Q6_Vw_vrmpyacc_VwVbVb(sums, load(bytes + i), Q6_V_vsplat_R(0x01010101));
  }
  int32_t words[kWords] __attribute__((aligned(128)));
  store(words, sums);
  int32_t sum = 0;
  for (int i = 0; i < kWords; ++i) sum += words[i];
  return sum;
}

/* buffers: in f32 [in], out f32 [out] and as many more as make 32, weights u8 [out / 32, in / 4,
 * 32, 4] with 128 added, ChannelScales, in i8 [in]; values: in (with zeros, a multiple of 128),
 * out, whether there is a softmax, the input's factor. */
void pirt_dsp_fully_connected(const KernelArguments* arguments) {
  const float* in = arguments->buffers[0];
  float* out = arguments->buffers[1];
  const uint8_t* weights = arguments->buffers[2];
  int8_t* bytes = arguments->buffers[4];
  const int in_count = arguments->values[0];
  const int out_count = arguments->values[1];
  const Factor factor = factor_of(arguments->values[3], arguments->values[4]);
  for (int i = 0; i < in_count; i += kVector) store(bytes + i, quantized_128(in + i, factor));
  const HVX_Vector excess = Q6_V_vsplat_R(kOffset * sum_of(bytes, in_count));
  const int channels = (out_count + kWords - 1) / kWords * kWords;
  const ChannelScales scales = scales_at(arguments->buffers[3], channels);
  for (int channel = 0; channel < channels; channel += kWords) {
    const int32_t* word = (const int32_t*)bytes;
    HVX_Vector sum = load(scales.bias + channel);
#pragma clang loop unroll_count(8)
    for (int i = 0; i < in_count / 4; ++i, weights += kVector) {
      sum = Q6_Vw_vrmpyacc_VwVubRb(sum, load(weights), word[i]);
    }
    store(out + channel, to_float(Q6_Vw_vsub_VwVw(sum, excess), factor_at(scales, channel)));
  }
  if (arguments->values[2] != 0) softmax(out, out_count);
}
