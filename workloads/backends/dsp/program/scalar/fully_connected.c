/* The scalar twin of ../fully_connected.c: the same bytes and layouts, one product at a time. */
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/program/scalar/int8.h"
#include "workloads/backends/dsp/program/softmax.h"

enum { kLanes = 32 };

void pirt_dsp_fully_connected(const KernelArguments* arguments) {
  const float* in = arguments->buffers[0];
  float* out = arguments->buffers[1];
  const uint8_t* weights = arguments->buffers[2];
  int8_t* bytes = arguments->buffers[4];
  const int in_count = arguments->values[0];
  const int out_count = arguments->values[1];
  quantize(in, bytes, in_count, arguments->values[3], arguments->values[4]);
  const int channels = (out_count + kLanes - 1) / kLanes * kLanes;
  for (int channel = 0; channel < out_count; ++channel) {
    const uint8_t* w = weights + channel / kLanes * kLanes * in_count + channel % kLanes * 4;
    int32_t sum = 0;
    for (int i = 0; i < in_count; i += 4, w += kLanes * 4) {
      sum += (w[0] - kOffset) * bytes[i] + (w[1] - kOffset) * bytes[i + 1] +
             (w[2] - kOffset) * bytes[i + 2] + (w[3] - kOffset) * bytes[i + 3];
    }
    out[channel] = scaled(sum, arguments->buffers[3], channels, channel);
  }
  if (arguments->values[2] != 0) softmax(out, out_count);
}
