// Loops that reach for a device's limits; workloads/backends/opencl/device/peak_loops.cpp says what each has to leave.

#ifdef FP_FAST_FMAF
#define MULTIPLY_ADD(x, a, b) fma(x, a, b)
#else
#define MULTIPLY_ADD(x, a, b) ((x) * (a) + (b))
#endif

// 8 independent chains x = x * a + b of W lanes a work item. Chain c starts at starts[(item % 4) + c * W], so
// that neither lanes nor items are alike; the item leaves the sum of its chains.
#define CHAINS(NAME, T, LOAD, STORE)                                                          \
  __kernel void NAME(__global float* sums, __global const float* starts, float a, float b,    \
                     int iterations) {                                                        \
    const size_t item = get_global_id(0);                                                     \
    __global const float* from = starts + item % 4;                                           \
    T x0 = LOAD(0, from), x1 = LOAD(1, from), x2 = LOAD(2, from), x3 = LOAD(3, from);         \
    T x4 = LOAD(4, from), x5 = LOAD(5, from), x6 = LOAD(6, from), x7 = LOAD(7, from);         \
    for (int i = 0; i < iterations; ++i) {                                                    \
      x0 = MULTIPLY_ADD(x0, (T)a, (T)b);                                                      \
      x1 = MULTIPLY_ADD(x1, (T)a, (T)b);                                                      \
      x2 = MULTIPLY_ADD(x2, (T)a, (T)b);                                                      \
      x3 = MULTIPLY_ADD(x3, (T)a, (T)b);                                                      \
      x4 = MULTIPLY_ADD(x4, (T)a, (T)b);                                                      \
      x5 = MULTIPLY_ADD(x5, (T)a, (T)b);                                                      \
      x6 = MULTIPLY_ADD(x6, (T)a, (T)b);                                                      \
      x7 = MULTIPLY_ADD(x7, (T)a, (T)b);                                                      \
    }                                                                                         \
    STORE(((x0 + x1) + (x2 + x3)) + ((x4 + x5) + (x6 + x7)), item, sums);                     \
  }

#define LOAD1(i, p) ((p)[i])
#define STORE1(value, i, p) ((p)[i] = (value))
CHAINS(chains1, float, LOAD1, STORE1)
CHAINS(chains4, float4, vload4, vstore4)
CHAINS(chains8, float8, vload8, vstore8)
CHAINS(chains16, float16, vload16, vstore16)

// A GPU's way of reading: items side by side, each `count` vectors of 4 words, `passes` times over; it leaves the
// sum of (word xor pass) modulo 2^32. Without the pass number a compiler could read once; and each pass begins
// elsewhere, so that a compute unit does not find its own words in its first cache.
__kernel void read_words(__global uint* sums, __global const uint4* words, int count, int passes) {
  const size_t items = get_global_size(0);
  uint4 s0 = 0, s1 = 0, s2 = 0, s3 = 0;
  for (uint pass = 0; pass < (uint)passes; ++pass) {
    __global const uint4* from = words + (get_global_id(0) + (size_t)pass * 7 * get_local_size(0)) % items;
    for (int i = 0; i < count; i += 4) {
      s0 += from[i * items] ^ pass;
      s1 += from[(i + 1) * items] ^ pass;
      s2 += from[(i + 2) * items] ^ pass;
      s3 += from[(i + 3) * items] ^ pass;
    }
  }
  const uint4 s = (s0 + s1) + (s2 + s3);
  sums[get_global_id(0)] = (s.x + s.y) + (s.z + s.w);
}

// A core's way of reading: `count` contiguous vectors of 16 words from vector item * begin on. It leaves the same.
__kernel void read_lines(__global uint* sums, __global const uint16* words, int begin, int count,
                         int passes) {
  const size_t item = get_global_id(0);
  __global const uint16* from = words + item * (size_t)begin;
  uint16 s0 = 0, s1 = 0;
  for (uint pass = 0; pass < (uint)passes; ++pass) {
    for (int i = 0; i < count; i += 2) {
      s0 += from[i] ^ pass;
      s1 += from[i + 1] ^ pass;
    }
  }
  const uint16 s = s0 + s1;
  const uint8 eight = s.lo + s.hi;
  const uint4 four = eight.lo + eight.hi;
  sums[item] = (four.x + four.y) + (four.z + four.w);
}

// The same, a stretch in four streams side by side, which keeps four of a core's prefetchers busy. `count` and `begin`
// are in vectors of 8 words; a stream has a quarter of count.
__kernel void read_streams(__global uint* sums, __global const uint8* words, int begin, int count,
                           int passes) {
  const size_t item = get_global_id(0);
  __global const uint8* from = words + item * (size_t)begin;
  const int quarter = count / 4;
  uint8 s0 = 0, s1 = 0, s2 = 0, s3 = 0;
  for (uint pass = 0; pass < (uint)passes; ++pass) {
    for (int i = 0; i < quarter; i += 2) {
      s0 += from[i] ^ pass;
      s1 += from[i + quarter] ^ pass;
      s2 += from[i + 2 * quarter] ^ pass;
      s3 += from[i + 3 * quarter] ^ pass;
      s0 += from[i + 1] ^ pass;
      s1 += from[i + 1 + quarter] ^ pass;
      s2 += from[i + 1 + 2 * quarter] ^ pass;
      s3 += from[i + 1 + 3 * quarter] ^ pass;
    }
  }
  const uint8 s = (s0 + s1) + (s2 + s3);
  const uint4 four = s.lo + s.hi;
  sums[item] = (four.x + four.y) + (four.z + four.w);
}
