// Fully connected layers for several images a call (definition: workloads/dnn/dnn.h) in plain OpenCL
// C 1.2, f32: each weight comes from memory once for the whole batch.

/// Outputs of a work item.
#define OUTPUTS 16
/// Images whose sums stay in registers: 6 x 16 sums are 12 of the 16 vector registers of AVX2.
#define IMAGES 6
/// Inputs after which the next images take their turn: 16 KB of weights, which the first images
/// bring into the nearest cache and the others find there.
#define CHUNK 256

/// Global ids (block of OUTPUTS outputs).
///
/// @param input    [images, in].
/// @param weights  [ceil(out/16), in, 16], missing outputs 0.
/// @param bias     [ceil(out/16), 16], alike.
/// @param sums     [ceil(out/16), images rounded up to IMAGES, 16], scratch between two chunks.
/// @param output   [images, out].
__kernel void fully_connected_batch(__global const float* restrict input,
                                    __global const float* restrict weights,
                                    __global const float* restrict bias,
                                    __global float* restrict sums, __global float* restrict output,
                                    int in, int out, int images) {
  const int block = (int)get_global_id(0);
  if (block * OUTPUTS >= out) return;
  const int rows = (images + IMAGES - 1) / IMAGES * IMAGES;
  __global float* mine = sums + (size_t)block * rows * OUTPUTS;
  __global const float* w = weights + (size_t)block * in * OUTPUTS;
  const float16 start = vload16(block, bias);

  for (int begin = 0; begin < in; begin += CHUNK) {
    const int end = min(begin + CHUNK, in);
    for (int first = 0; first < images; first += IMAGES) {
      // The last block computes its last image several times rather than branch in the loop.
      __global const float* from[IMAGES];
      float16 sum[IMAGES];
#pragma unroll
      for (int i = 0; i < IMAGES; ++i) {
        from[i] = input + (size_t)min(first + i, images - 1) * in;
        sum[i] = begin == 0 ? start : vload16(first + i, mine);
      }
      for (int k = begin; k < end; ++k) {
        const float16 weight = vload16(k, w);
#pragma unroll
        for (int i = 0; i < IMAGES; ++i) sum[i] += weight * from[i][k];
      }
#pragma unroll
      for (int i = 0; i < IMAGES; ++i) vstore16(sum[i], first + i, mine);
    }
  }

  const int outputs = min(OUTPUTS, out - block * OUTPUTS);
  for (int image = 0; image < images; ++image)
    for (int o = 0; o < outputs; ++o)
      output[(size_t)image * out + block * OUTPUTS + o] = mine[image * OUTPUTS + o];
}
