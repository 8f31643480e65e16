// undistort (definition: make_undistort in workloads/vision/vision.h) in plain OpenCL C 1.2, exact, of
// tables that the host makes (undistort.cpp).
//
// Defined by the host (tuning.cpp):
//   UNDISTORT_PIXELS  neighbouring pixels of a work item, a vector's width or 1.

#define PIXELS UNDISTORT_PIXELS
#define JOIN(a, b) a##b
#define VECTOR(name, width) JOIN(name, width)
#if PIXELS == 1
#define LANES(name) name
#else
#define LANES(name) VECTOR(name, PIXELS)
#endif

#ifdef __ENDIAN_LITTLE__
#define LEFT(pairs) ((pairs) & (Shorts)255)
#define RIGHT(pairs) ((pairs) >> (Shorts)8)
#else
#define LEFT(pairs) ((pairs) >> (Shorts)8)
#define RIGHT(pairs) ((pairs) & (Shorts)255)
#endif

/// PAIR: two neighbouring bytes, the left one and the right one, at any address; as lanes.cl says.
#ifdef POCL_DEVICE_ADDRESS_BITS
typedef ushort Pair __attribute__((aligned(1)));
typedef LANES(uchar) Bytes __attribute__((aligned(1)));
#define PAIR(p) (*(__global const Pair*)(p))
#define STORE_LANES(p, value) (*(__global Bytes*)(p) = (value))
#else
typedef LANES(uchar) Bytes;
#define PAIR(p) as_ushort(vload2(0, p))
#if PIXELS == 1
#define STORE_LANES(p, value) (*(p) = (value))
#else
#define STORE_LANES(p, value) LANES(vstore)(value, 0, p)
#endif
#endif
typedef LANES(ushort) Shorts;
typedef LANES(uint) Words;
typedef union {
  Shorts all;
  ushort each[PIXELS];
} Pairs;

/// Global ids (block of PIXELS columns, row).
///
/// @param offsets  [rows, blocks, PIXELS]: where the upper left neighbour of each output pixel is,
///                 such that the one to its right and those `below` are in the picture, too.
/// @param weights  [rows, blocks, 4, PIXELS]: of the left neighbours and of the right ones, of the
///                 upper ones and of the lower ones, in 1/32; 0 for those outside the picture.
/// @param below    Bytes to the next row; 0 in a picture of one.
__kernel void undistort(__global const uchar* restrict image, __global uchar* restrict straight,
                        __global const int* restrict offsets,
                        __global const Bytes* restrict weights, int width, int below) {
  const int first = (int)get_global_id(0) * PIXELS;
  if (first >= width) return;
  const int y = (int)get_global_id(1);
  const int block = y * ((width + PIXELS - 1) / PIXELS) + (int)get_global_id(0);
  offsets += block * PIXELS;
  weights += block * 4;

  Pairs upper, lower;
  if (width > 1) {
#pragma unroll
    for (int i = 0; i < PIXELS; ++i) {
      upper.each[i] = PAIR(image + offsets[i]);
      lower.each[i] = PAIR(image + offsets[i] + below);
    }
  } else {  // The pixel and nothing: its right neighbour's weight is 0.
#pragma unroll
    for (int i = 0; i < PIXELS; ++i) {
      const uchar2 here = (uchar2)(image[offsets[i]], 0);
      const uchar2 there = (uchar2)(image[offsets[i] + below], 0);
      upper.each[i] = as_ushort(here);
      lower.each[i] = as_ushort(there);
    }
  }

  // 255 * 32 fits 16 bits.
  const Shorts left = LANES(convert_ushort)(weights[0]), right = LANES(convert_ushort)(weights[1]);
  const Words above = LANES(convert_uint)(LEFT(upper.all) * left + RIGHT(upper.all) * right);
  const Words beneath = LANES(convert_uint)(LEFT(lower.all) * left + RIGHT(lower.all) * right);
  const Words sum =
      above * LANES(convert_uint)(weights[2]) + beneath * LANES(convert_uint)(weights[3]);
  const Bytes result = LANES(convert_uchar)((sum + (Words)512) >> (Words)10);

  __global uchar* to = straight + y * width + first;
  if (first + PIXELS <= width) {
    STORE_LANES(to, result);
    return;
  }
  union {
    Bytes all;
    uchar each[PIXELS];
  } last;
  last.all = result;
  for (int i = 0; first + i < width; ++i) to[i] = last.each[i];
}
