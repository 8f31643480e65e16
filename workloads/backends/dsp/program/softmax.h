/* Softmax in scalar f32, which this DSP has; there is no C library. */
#ifndef PIRT_DSP_SOFTMAX_H
#define PIRT_DSP_SOFTMAX_H

#include <stdint.h>

/* 2^(x / ln 2) by its Taylor series on half a step to either side, 2e-7 of the value; x <= 0. */
static float exponential(float x) {
  if (x < -80.0F) return 0.0F;
  const float steps = x * 1.44269504F;
  const int whole = (int)(steps - 0.5F);
  const float t = (steps - (float)whole) * 0.693147181F;
  const float power =
      1.0F + t * (1.0F + t * (0.5F + t * (1.0F / 6 +
                                          t * (1.0F / 24 + t * (1.0F / 120 + t * (1.0F / 720))))));
  const uint32_t bits = (uint32_t)(127 + whole) << 23;
  float scale;
  __builtin_memcpy(&scale, &bits, sizeof scale);
  return power * scale;
}

/* By Newton's iteration; x > 0. */
static float inverse(float x) {
  uint32_t bits;
  __builtin_memcpy(&bits, &x, sizeof bits);
  bits = 0x7ef311c7 - bits;
  float r;
  __builtin_memcpy(&r, &bits, sizeof r);
  for (int i = 0; i < 4; ++i) r = r * (2.0F - x * r);
  return r;
}

static void softmax(float* values, int count) {
  float largest = values[0];
  for (int i = 1; i < count; ++i) {
    if (values[i] > largest) largest = values[i];
  }
  float sum = 0.0F;
  for (int i = 0; i < count; ++i) {
    values[i] = exponential(values[i] - largest);
    sum += values[i];
  }
  const float factor = inverse(sum);
  for (int i = 0; i < count; ++i) values[i] *= factor;
}

#endif
