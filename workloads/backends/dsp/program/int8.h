/* Layers in 8 bits: the vectors of this generation have no floating point, so that f32 is taken
 * apart and put together in integers.
 *
 * Inputs are signed, weights have 128 added: products of an unsigned vector and four signed bytes
 * are what HVX has, two a packet. What that adds to a sum, 128 times the sum of its inputs, is
 * taken away again. */
#ifndef PIRT_DSP_INT8_H
#define PIRT_DSP_INT8_H

#include "workloads/backends/dsp/program/hvx.h"

enum { kWords = 32, kOffset = 128 };

/* factor = mantissa / 2^31 * 2^exponent, mantissas from 2^30 on. */
typedef struct {
  HVX_Vector mantissa, exponent;
} Factor;

INLINE Factor factor_of(int32_t mantissa, int32_t exponent) {
  const Factor factor = {Q6_V_vsplat_R(mantissa), Q6_V_vsplat_R(exponent)};
  return factor;
}

/* What of a channel follows its sums: [channels] each, channels a multiple of 32. */
typedef struct {
  const int32_t* bias; /* in units of the sums */
  const int32_t *mantissas, *exponents;
} ChannelScales;

INLINE ChannelScales scales_at(const int32_t* table, int channels) {
  const ChannelScales scales = {table, table + channels, table + 2 * channels};
  return scales;
}
INLINE Factor factor_at(ChannelScales scales, int channel) {
  const Factor factor = {load(scales.mantissas + channel), load(scales.exponents + channel)};
  return factor;
}

/* (a * b) >> 31, rounded. */
INLINE HVX_Vector multiply_31(HVX_Vector a, HVX_Vector b) {
  return Q6_Vw_vmpyoacc_VwVwVh_s1_rnd_sat_shift(Q6_Vw_vmpye_VwVuh(a, b), a, b);
}

/* 32 floats times a factor, to the nearest of -127 to 127. */
INLINE HVX_Vector quantized(HVX_Vector floats, Factor factor) {
  const HVX_Vector one = Q6_V_vsplat_R(1);
  const HVX_Vector exponent = Q6_V_vand_VV(Q6_Vuw_vlsr_VuwR(floats, 23), Q6_V_vsplat_R(0xff));
  const HVX_Vector mantissa = Q6_V_vor_VV(
      Q6_V_vand_VV(Q6_Vw_vasl_VwR(floats, 7), Q6_V_vsplat_R(0x3fffff80)), Q6_V_vsplat_R(1 << 30));
  /* The product is P * 2^-shift. */
  const HVX_Vector shift =
      Q6_Vw_vsub_VwVw(Q6_V_vsplat_R(157), Q6_Vw_vadd_VwVw(exponent, factor.exponent));
  const HVX_Vector bounded =
      Q6_Vw_vmin_VwVw(Q6_Vw_vmax_VwVw(shift, Q6_V_vsplat_R(23)), Q6_V_vsplat_R(31));
  const HVX_Vector half = Q6_Vw_vasl_VwVw(one, Q6_Vw_vsub_VwVw(bounded, one));
  HVX_Vector value =
      Q6_Vw_vlsr_VwVw(Q6_Vw_vadd_VwVw(multiply_31(mantissa, factor.mantissa), half), bounded);
  value = Q6_Vw_vmin_VwVw(value, Q6_V_vsplat_R(127));
  value = Q6_V_vmux_QVV(Q6_Q_vcmp_gt_VwVw(shift, Q6_V_vsplat_R(31)), Q6_V_vzero(), value);
  const HVX_VectorPred negative = Q6_Q_vcmp_gt_VwVw(Q6_V_vzero(), floats);
  return Q6_V_vmux_QVV(negative, Q6_Vw_vsub_VwVw(Q6_V_vzero(), value), value);
}

/* 128 floats to bytes. */
INLINE HVX_Vector quantized_128(const float* floats, Factor factor) {
  HVX_Vector words[4];
#pragma clang loop unroll(full)
  for (int i = 0; i < 4; ++i) words[i] = quantized(load(floats + kWords * i), factor);
  return Q6_Vb_vpacke_VhVh(Q6_Vh_vpacke_VwVw(words[3], words[2]),
                           Q6_Vh_vpacke_VwVw(words[1], words[0]));
}

/* Integers times factors as f32. */
INLINE HVX_Vector to_float(HVX_Vector value, Factor factor) {
  const HVX_Vector size = Q6_Vw_vabs_Vw(value);
  const HVX_Vector shift = Q6_Vw_vnormamt_Vw(size);
  const HVX_Vector product = multiply_31(Q6_Vw_vasl_VwVw(size, shift), factor.mantissa);
  const HVX_Vector again = Q6_Vw_vnormamt_Vw(product);
  const HVX_Vector mantissa =
      Q6_Vuw_vlsr_VuwR(Q6_Vw_vadd_VwVw(Q6_Vw_vasl_VwVw(product, again), Q6_V_vsplat_R(64)), 7);
  const HVX_Vector exponent = Q6_Vw_vsub_VwVw(Q6_Vw_vadd_VwVw(factor.exponent, Q6_V_vsplat_R(156)),
                                              Q6_Vw_vadd_VwVw(shift, again));
  const HVX_Vector sign = Q6_V_vand_VV(value, Q6_V_vsplat_R((int32_t)0x80000000));
  /* The mantissa's first bit adds 1 to the exponent. */
  const HVX_Vector bits =
      Q6_V_vor_VV(sign, Q6_Vw_vadd_VwVw(Q6_Vw_vasl_VwR(exponent, 23), mantissa));
  return Q6_V_vmux_QVV(Q6_Q_vcmp_eq_VwVw(value, Q6_V_vzero()), Q6_V_vzero(), bits);
}

#endif
