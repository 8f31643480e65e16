/* The scalar twin of ../conv2d_relu.c: the same bytes and layouts, one product at a time. */
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/program/scalar/int8.h"

enum { kSet = 96 };

void pirt_dsp_conv2d_relu(const KernelArguments* arguments) {
  const float* in = arguments->buffers[0];
  float* out = arguments->buffers[1];
  const uint8_t* weights = arguments->buffers[2];
  int8_t* bytes = arguments->buffers[4];
  const int32_t* v = arguments->values;
  const int in_c = v[0], in_h = v[1], pitch = v[2], out_c = v[3], out_h = v[4], out_w = v[5];
  const int k_h = v[6], words = v[7], stride = v[8];
  quantize(in, bytes, in_c * in_h * pitch, v[10], v[11]);
  const int channels = (out_c + kSet - 1) / kSet * kSet;
  for (int channel = 0; channel < out_c; ++channel) {
    const uint8_t* first =
        weights + channel / kSet * in_c * k_h * words * kSet * 4 + channel % kSet * 4;
    for (int y = 0; y < out_h; ++y) {
      for (int x = 0; x < out_w; ++x) {
        const uint8_t* w = first;
        int32_t sum = 0;
        for (int c = 0; c < in_c; ++c) {
          for (int j = 0; j < k_h; ++j) {
            const int8_t* row = bytes + (c * in_h + y * stride + j) * pitch + x * stride;
            for (int k = 0; k < words; ++k, w += kSet * 4, row += 4) {
              sum += (w[0] - kOffset) * row[0] + (w[1] - kOffset) * row[1] +
                     (w[2] - kOffset) * row[2] + (w[3] - kOffset) * row[3];
            }
          }
        }
        const float value = scaled(sum, arguments->buffers[3], channels, channel);
        *out++ = value > 0.0F ? value : 0.0F;
      }
    }
  }
}
