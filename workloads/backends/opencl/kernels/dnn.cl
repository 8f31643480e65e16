// The layers of AlexNet (definitions: workloads/dnn/dnn.h) in plain OpenCL C 1.2, f32. Fully
// connected layers of a batch are in dnn_batch.cl.
//
// Shapes are arguments, so that all layers of a network share one binary of each kernel.

// Defined by the host (tuning.cpp):
//   CONV_CHANNELS  output channels of a work item of conv2d_relu, a vector's width or twice the
//                  widest; layers need not have a multiple of it;
//   CONV_PIXELS    its output pixels: 6 x 16 sums are 12 of the 16 vector registers of AVX2,
//                  13 x 32 are 26 of the 32 of AVX-512, where a loaded pixel serves two products,
//                  and divide the 169 pixels of conv3 to conv5;
//   FC_ROWS        output rows of a work item of fully_connected.
#define CHANNELS CONV_CHANNELS
#define PIXELS CONV_PIXELS
#if CHANNELS > 16
#define WIDTH 16
#else
#define WIDTH CHANNELS
#endif
#define VECTORS (CHANNELS / WIDTH)
#define JOIN(a, b) a##b
#define VECTOR(name, width) JOIN(name, width)
typedef VECTOR(float, WIDTH) Lanes;

/// max(least, conv + bias): least is 0, or -infinity for no ReLU. Global ids (block of PIXELS pixels,
/// block of CHANNELS output channels of an image; those of the next image follow).
///
/// @param input    Planes of in_plane floats, rows of in_pitch floats, zero border included.
/// @param weights  [ceil(out_c/CHANNELS), in_c, k_h, k_w, CHANNELS], missing channels 0.
/// @param bias     [ceil(out_c/CHANNELS), CHANNELS], alike.
/// @param output   Channel c, row y, column x at out_offset + c*out_plane + y*out_pitch + x: the
///                 border that the next layer wants stays untouched.
/// @param in_image, out_image  Floats from an image of a batch to the next.
__kernel void conv2d_relu(__global const float* restrict input,
                          __global const float* restrict weights,
                          __global const float* restrict bias, __global float* restrict output,
                          int in_c, int in_plane, int in_pitch, int k_h, int k_w, int stride,
                          int out_c, int out_h, int out_w, int out_plane, int out_pitch,
                          int out_offset, int in_image, int out_image, float least) {
  const int first = (int)get_global_id(0) * PIXELS;
  const int blocks = (out_c + CHANNELS - 1) / CHANNELS;
  const int block = (int)get_global_id(1) % blocks;
  input += (int)get_global_id(1) / blocks * in_image;
  output += (int)get_global_id(1) / blocks * out_image;
  const int pixels = out_h * out_w;
  if (first >= pixels) return;

  // The last block computes its last pixel several times rather than branch in the loop.
  __global const float* from[PIXELS];
#pragma unroll
  for (int i = 0; i < PIXELS; ++i) {
    const int pixel = min(first + i, pixels - 1);
    from[i] = input + pixel / out_w * stride * in_pitch + pixel % out_w * stride;
  }
  Lanes sum[VECTORS][PIXELS];
#pragma unroll
  for (int v = 0; v < VECTORS; ++v) {
    const Lanes start = VECTOR(vload, WIDTH)(block * VECTORS + v, bias);
#pragma unroll
    for (int i = 0; i < PIXELS; ++i) sum[v][i] = start;
  }

  __global const float* w = weights + block * in_c * k_h * k_w * CHANNELS;
  for (int c = 0; c < in_c; ++c) {
    for (int ky = 0; ky < k_h; ++ky) {
      const int row = c * in_plane + ky * in_pitch;
      for (int kx = 0; kx < k_w; ++kx) {
        Lanes weight[VECTORS];
#pragma unroll
        for (int v = 0; v < VECTORS; ++v) weight[v] = VECTOR(vload, WIDTH)(v, w);
        w += CHANNELS;
#pragma unroll
        for (int i = 0; i < PIXELS; ++i) {
          const float pixel = from[i][row + kx];
#pragma unroll
          for (int v = 0; v < VECTORS; ++v) sum[v][i] += weight[v] * pixel;
        }
      }
    }
  }

#pragma unroll
  for (int i = 0; i < PIXELS; ++i) {
    float lanes[CHANNELS];
#pragma unroll
    for (int v = 0; v < VECTORS; ++v) VECTOR(vstore, WIDTH)(fmax(sum[v][i], least), v, lanes);
    const int pixel = first + i;
    __global float* to = output + out_offset + pixel / out_w * out_pitch + pixel % out_w;
    const int channels = pixel < pixels ? min(CHANNELS, out_c - block * CHANNELS) : 0;
    for (int c = 0; c < channels; ++c) to[(block * CHANNELS + c) * out_plane] = lanes[c];
  }
}

/// Global ids (output column, channel * out_h + output row); the channels of a batch's images follow
/// one another. Output layout as for conv2d_relu.
__kernel void max_pool(__global const float* restrict input, __global float* restrict output,
                       int in_h, int in_w, int size, int stride, int out_h, int out_w,
                       int out_plane, int out_pitch, int out_offset) {
  const int x = (int)get_global_id(0);
  const int channel = (int)get_global_id(1) / out_h;
  const int y = (int)get_global_id(1) % out_h;
  if (x >= out_w) return;
  __global const float* window = input + (channel * in_h + y * stride) * in_w + x * stride;
  float top = window[0];
  for (int dy = 0; dy < size; ++dy)
    for (int dx = 0; dx < size; ++dx) top = fmax(top, window[dy * in_w + dx]);
  output[out_offset + channel * out_plane + y * out_pitch + x] = top;
}

float horizontal_sum(float8 v) {
  const float4 a = v.lo + v.hi;
  const float2 b = a.lo + a.hi;
  return b.x + b.y;
}

/// FC_ROWS output rows from @p first on, so that each input value is loaded once for as many
/// products.
void rows_of_fully_connected(__global const float* restrict input,
                             __global const float* restrict weights,
                             __global const float* restrict bias, __global float* output, int in,
                             int out, int first) {
  __global const float* row[FC_ROWS];
  float8 sum[FC_ROWS];
#pragma unroll
  for (int r = 0; r < FC_ROWS; ++r) {
    row[r] = weights + (size_t)min(first + r, out - 1) * in;
    sum[r] = 0.0f;
  }
  int i = 0;
  for (; i + 16 <= in; i += 16) {  // a cache line of each row
    const float8 x = vload8(0, input + i);
    const float8 y = vload8(0, input + i + 8);
#pragma unroll
    for (int r = 0; r < FC_ROWS; ++r) {
      sum[r] += vload8(0, row[r] + i) * x;
      sum[r] += vload8(0, row[r] + i + 8) * y;
    }
  }
#pragma unroll
  for (int r = 0; r < FC_ROWS; ++r) {
    if (first + r >= out) continue;
    float rest = bias[first + r];
    for (int k = i; k < in; ++k) rest += row[r][k] * input[k];
    output[first + r] = horizontal_sum(sum[r]) + rest;
  }
}

/// @param weights  [out, in] as the workload has them: 151 MB need no repacking.
__kernel void fully_connected(__global const float* restrict input,
                              __global const float* restrict weights,
                              __global const float* restrict bias, __global float* output, int in,
                              int out) {
  const int first = (int)get_global_id(0) * FC_ROWS;
  if (first < out) rows_of_fully_connected(input, weights, bias, output, in, out, first);
}

/// exp(v - max) / sum in place, by one work item: for devices where that takes less than waking a
/// work group's others, CPUs. A launch of its own: within one, no work group of OpenCL 1.2 may read
/// what another has written.
__kernel void softmax_alone(__global float* restrict values, int count) {
  if (get_global_id(0) > 0) return;
  float8 tops = -INFINITY;
  int i = 0;
  for (; i + 8 <= count; i += 8) tops = fmax(tops, vload8(0, values + i));
  float4 top4 = fmax(tops.lo, tops.hi);
  float top = fmax(fmax(top4.x, top4.y), fmax(top4.z, top4.w));
  for (; i < count; ++i) top = fmax(top, values[i]);

  float8 sums = 0.0f;
  for (i = 0; i + 8 <= count; i += 8) {
    const float8 e = exp(vload8(0, values + i) - top);
    vstore8(e, 0, values + i);
    sums += e;
  }
  float sum = horizontal_sum(sums);
  for (; i < count; ++i) sum += values[i] = exp(values[i] - top);

  for (i = 0; i + 8 <= count; i += 8) vstore8(vload8(0, values + i) / sum, 0, values + i);
  for (; i < count; ++i) values[i] /= sum;
}

/// In place, by one work group an image (global id 1): exp(v - max) / sum.
/// @param partial  [items]
__kernel void softmax(__global float* restrict values, int count, __local float* partial) {
  const int me = (int)get_local_id(0), items = (int)get_local_size(0);
  values += (int)get_global_id(1) * count;

  float top = -INFINITY;
  for (int i = me; i < count; i += items) top = fmax(top, values[i]);
  partial[me] = top;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int i = 0; i < items; ++i) top = fmax(top, partial[i]);
  barrier(CLK_LOCAL_MEM_FENCE);

  float sum = 0.0f;
  for (int i = me; i < count; i += items) {
    const float e = exp(values[i] - top);
    values[i] = e;
    sum += e;
  }
  partial[me] = sum;
  barrier(CLK_LOCAL_MEM_FENCE);
  sum = 0.0f;
  for (int i = 0; i < items; ++i) sum += partial[i];
  for (int i = me; i < count; i += items) values[i] /= sum;
}
