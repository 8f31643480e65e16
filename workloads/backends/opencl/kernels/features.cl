// Shi-Tomasi corners: the response map, its peak, and the candidates; sorting and the distance rule
// are the host's (feature_detect.cpp). Gradients come from kernel `sobel`, which this program has too.
// A work item computes `pixels` neighbouring pixels of a row, a multiple of 8, which the host chooses
// (tuning.cpp); global ids are (segment, row).

#include "sobel.cl"  // One program for all three steps.

/// Twice the smaller eigenvalue of [sxx sxy; sxy syy]; the factor changes no comparison. Computed
/// as 4*det / (trace + sqrt((sxx-syy)^2 + 4*sxy^2)): trace - sqrt(...) would cancel in float, and
/// det is an exact integer.
INLINE float8 response8(int8 sxx, int8 sxy, int8 syy) {
  const long8 xx = convert_long8(sxx), xy = convert_long8(sxy), yy = convert_long8(syy);
  const long8 det = xx * yy - xy * xy;
  const long8 difference = xx - yy;
  const float8 root = sqrt(convert_float8(difference * difference + (xy * xy << 2)));
  const float8 below = convert_float8(sxx + syy) + root;
  return select((float8)0.0f, 4.0f * convert_float8(det) / below, below > 0.0f);
}

/// Computes the responses of the 8 pixels from x on, or as many as there are, and gives the largest.
INLINE float segment_response(__global const short* gx, __global const short* gy,
                              __global float* response, int x, int y, int width, int height) {
  int8 sxx = 0, sxy = 0, syy = 0;
  if (x >= 1 && x + 9 <= width) {
    for (int dy = -1; dy <= 1; ++dy) {
      const int at = reflect(y + dy, height) * width + x - 1;
      for (int dx = 0; dx < 3; ++dx) {
        const int8 a = convert_int8(LOAD(Shorts8, gx + at + dx));
        const int8 b = convert_int8(LOAD(Shorts8, gy + at + dx));
        sxx += a * a, sxy += a * b, syy += b * b;
      }
    }
  } else {
    int xx[8], xy[8], yy[8];
    for (int i = 0; i < 8; ++i) {
      xx[i] = xy[i] = yy[i] = 0;
      if (x + i >= width) continue;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const int at = reflect(y + dy, height) * width + reflect(x + i + dx, width);
          const int a = gx[at], b = gy[at];
          xx[i] += a * a, xy[i] += a * b, yy[i] += b * b;
        }
      }
    }
    sxx = vload8(0, xx), sxy = vload8(0, xy), syy = vload8(0, yy);
  }
  const float8 value = response8(sxx, sxy, syy);
  if (x + 8 <= width) {
    STORE(Floats8, response + y * width + x, value);
  } else {
    float lanes[8];
    vstore8(value, 0, lanes);
    for (int i = 0; x + i < width; ++i) response[y * width + x + i] = lanes[i];
  }
  const float4 top4 = fmax(value.lo, value.hi);
  const float2 top2 = fmax(top4.lo, top4.hi);
  return fmax(top2.x, top2.y);
}

/// @param response  f32 [height,width].
/// @param state     [0] becomes the bits of the largest response; zeroed beforehand. Responses are
///                  not negative, so that their bits order as they do.
/// @param pixels    Of a work item.
__kernel void corner_response(__global const short* restrict gx, __global const short* restrict gy,
                              __global float* restrict response, volatile __global uint* state,
                              int width, int height, int pixels) {
  const int begin = (int)get_global_id(0) * pixels;
  const int end = min(begin + pixels, width);
  const int y = (int)get_global_id(1);
  if (begin >= width) return;
  float largest = 0.0f;
  for (int x = begin; x < end; x += 8)
    largest = fmax(largest, segment_response(gx, gy, response, x, y, width, height));
  const uint top = as_uint(largest);
  if (top > state[0]) atomic_max(state, top);
}

/// Pixels above quality * peak that no neighbour exceeds; the image's border pixels are excluded.
/// @param state       [1] becomes the number of candidates; zeroed beforehand.
/// @param candidates  bits of the response << 32 | pixel index, in no particular order; room for
///                    all pixels.
__kernel void corner_candidates(__global const float* restrict response,
                                volatile __global uint* state, __global ulong* restrict candidates,
                                float quality, int width, int height, int pixels) {
  const int first = max((int)get_global_id(0) * pixels, 1);
  const int end = min((int)get_global_id(0) * pixels + pixels, width - 1);
  const int y = (int)get_global_id(1);
  if (y < 1 || y >= height - 1) return;
  const float threshold = as_float(state[0]) * quality;
  for (int x = first; x < end; ++x) {
    __global const float* p = response + y * width + x;
    const float value = p[0];
    if (value <= threshold) continue;
    if (p[-1] > value || p[1] > value) continue;
    p -= width;
    if (p[-1] > value || p[0] > value || p[1] > value) continue;
    p += 2 * width;
    if (p[-1] > value || p[0] > value || p[1] > value) continue;
    candidates[atomic_inc(state + 1)] = upsample(as_uint(value), (uint)(y * width + x));
  }
}

/// Puts up to MOST_ORDERED candidates in order, the largest first, each by how many are larger: no
/// two are equal. More are only copied. Global id: candidate.
/// @param ordered  As candidates.
#define MOST_ORDERED 8192
__kernel void order_candidates(__global const uint* restrict state,
                               __global const ulong* restrict candidates,
                               __global ulong* restrict ordered) {
  const int count = (int)state[1], me = (int)get_global_id(0);
  if (me >= count) return;
  const ulong mine = candidates[me];
  int place = me;
  if (count <= MOST_ORDERED) {
    place = 0;
#pragma unroll 8
    for (int i = 0; i < count; ++i) place += candidates[i] > mine;
  }
  ordered[place] = mine;
}
