/* What the HVX kernels share: types, and pictures in strips of one vector.
 *
 * A picture's rows begin at multiples of 128 bytes. A strip is 128 columns from the top to the bottom
 * of a picture: a kernel walks down one after the other, so that what it computed of a row serves the
 * rows below from registers. Borders are made in registers, too. */
#ifndef PIRT_DSP_HVX_H
#define PIRT_DSP_HVX_H

#include <stddef.h>
#include <stdint.h>

/* Of clang's own headers; hexagon_types.h has these only where C++ or a C library is. */
typedef int HVX_Vector __attribute__((__vector_size__(128), aligned(128)));
typedef int HVX_VectorPair __attribute__((__vector_size__(256), aligned(128)));
typedef int HVX_VectorPred __attribute__((__vector_size__(128), aligned(128)));
#include <hvx_hexagon_protos.h>

#define INLINE static inline __attribute__((always_inline))

enum { kVector = 128 };

typedef int HVX_Unaligned __attribute__((__vector_size__(128), aligned(1)));

INLINE HVX_Vector load(const void *p) { return *(const HVX_Vector *)p; }
INLINE void store(void *p, HVX_Vector v) { *(HVX_Vector *)p = v; }
INLINE HVX_Vector load_unaligned(const void *p) {
  return (HVX_Vector) * (const HVX_Unaligned *)p;
}

/* A byte in each byte of a word. */
INLINE int32_t bytes4(int a, int b, int c, int d) {
  return (int32_t)((uint32_t)(a & 255) | (uint32_t)(b & 255) << 8 | (uint32_t)(c & 255) << 16 |
                   (uint32_t)(d & 255) << 24);
}

/* The bytes last to first: in a butterfly all of whose switches cross. */
INLINE HVX_Vector reversed(HVX_Vector v) { return Q6_V_vdelta_VV(v, Q6_V_vsplat_R(0x7f7f7f7f)); }

/* Where a strip lies: constants of each call, so that the compiler makes a loop of its own for the
 * strips at the edges and none of the others pays for them. */
typedef struct {
  int left;  /* its first column is the picture's */
  int right; /* the picture ends within it or kReach columns behind it */
} StripEdges;

enum { kReach = 8 }; /* no kernel looks at columns farther away */

/* Three neighbouring vectors of a row: the strip's, with what is beyond the picture mirrored without
 * the edge pixel (gfedcba|bcdefg...). kReach columns at each side mean something, where the picture
 * is wider than that. */
typedef struct {
  HVX_Vector before, here, after;
} RowPart;

/* The first `columns` (0 to 127) bytes of a, the others of b. */
INLINE HVX_Vector first_of(int columns, HVX_Vector a, HVX_Vector b) {
  return Q6_V_vmux_QVV(Q6_Q_vsetq_R(columns), a, b);
}

INLINE RowPart load_row_part(const uint8_t *row, int x, int width, StripEdges edges) {
  RowPart part;
  part.here = load(row + x);
  /* before[j] is column j - 128, mirrored 128 - j = 1 + (127 - j) */
  part.before = edges.left ? reversed(load_unaligned(row + 1)) : load(row + x - kVector);
  if (!edges.right) {
    part.after = load(row + x + kVector);
    return part;
  }
  /* column c beyond the edge is 2 * (width - 1) - c */
  const uint8_t *mirror = row + 2 * (width - 1) - x - (kVector - 1);
  const int columns = width - x;
  if (columns < kVector) {
    part.here = first_of(columns, part.here, reversed(load_unaligned(mirror)));
  }
  part.after = reversed(load_unaligned(mirror - kVector));
  if (columns > kVector) {
    part.after = first_of(columns - kVector, load(row + x + kVector), part.after);
  }
  return part;
}

/* The row that mirroring without the edge row means by y. */
INLINE int mirrored(int y, int height) {
  if (y < 0) y = -y;
  return y < height ? y : 2 * (height - 1) - y;
}

/* Calls strip(x, edges, context...) for each strip, with constant edges. */
#define FOR_EACH_STRIP(width, strip, ...)                \
  do {                                                   \
    const int inner_ = (width)-kVector - kReach;         \
    if (inner_ < 0) {                                    \
      strip(0, ((StripEdges){1, 1}), __VA_ARGS__);       \
    } else {                                             \
      strip(0, ((StripEdges){1, 0}), __VA_ARGS__);       \
    }                                                    \
    int x_ = kVector;                                    \
    for (; x_ <= inner_; x_ += kVector) {                \
      strip(x_, ((StripEdges){0, 0}), __VA_ARGS__);      \
    }                                                    \
    for (; x_ < (width); x_ += kVector) {                \
      strip(x_, ((StripEdges){0, 1}), __VA_ARGS__);      \
    }                                                    \
  } while (0)

#endif
