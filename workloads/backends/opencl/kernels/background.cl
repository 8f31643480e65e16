// background_model (definition: make_background_model in workloads/vision/vision.h). An item has 16
// pixels in memory's order. Subtraction and sum round once each and the product with a power of
// two is exact, so that it does not matter whether the compiler contracts them.

#define THRESHOLD 24
#define MAX_SHIFT 4

/// @param background, frames            The current state: f32 [pixels], i32 [1].
/// @param next_background, next_frames  The next one.
__kernel void background_model(__global const uchar* restrict image,
                               __global const float* restrict background,
                               __global const int* restrict frames, __global uchar* restrict mask,
                               __global float* restrict next_background,
                               __global int* restrict next_frames, int pixels) {
  const int first = (int)get_global_id(0) * 16;
  const int shift = clamp(frames[0], 0, MAX_SHIFT);
  if (first == 0) next_frames[0] = min(shift + 1, MAX_SHIFT);
  if (first >= pixels) return;
  const float rate = 1.0f / (float)(1 << shift);
  // Nothing differs from what was never seen.
  const float threshold = shift > 0 ? (float)THRESHOLD : INFINITY;
  if (first + 16 <= pixels) {
    const float16 before = vload16(0, background + first);
    const float16 difference = convert_float16(vload16(0, image + first)) - before;
    vstore16(before + difference * rate, 0, next_background + first);
    vstore16(convert_uchar16((fabs(difference) > threshold) & 255), 0, mask + first);
    return;
  }
  for (int i = first; i < pixels; ++i) {
    const float difference = (float)image[i] - background[i];
    next_background[i] = background[i] + difference * rate;
    mask[i] = fabs(difference) > threshold ? 255 : 0;
  }
}
