/* What the scalar twins of the layers share; see ../int8.h. */
#ifndef PIRT_DSP_SCALAR_INT8_H
#define PIRT_DSP_SCALAR_INT8_H

#include <stdint.h>

enum { kOffset = 128 };

/* mantissa / 2^31 * 2^exponent */
static inline float factor_of(int32_t mantissa, int32_t exponent) {
  const uint32_t bits = (uint32_t)(127 - 31 + exponent) << 23;
  float power;
  __builtin_memcpy(&power, &bits, sizeof power);
  return (float)mantissa * power;
}

static inline void quantize(const float* in, int8_t* out, int count, int32_t mantissa,
                            int32_t exponent) {
  const float factor = factor_of(mantissa, exponent);
  for (int i = 0; i < count; ++i) {
    const float value = in[i] * factor;
    const int rounded = (int)(value + (value < 0.0F ? -0.5F : 0.5F));
    out[i] = (int8_t)(rounded > 127 ? 127 : rounded < -127 ? -127 : rounded);
  }
}

/* The sum with its bias as f32. @table: bias, mantissas, exponents of all channels. */
static inline float scaled(int32_t sum, const int32_t* table, int channels, int channel) {
  return (float)(sum + table[channel]) *
         factor_of(table[channels + channel], table[2 * channels + channel]);
}

#endif
