/* What the HVX kernels share: types, and pictures in strips of one vector.
 *
 * A picture's rows begin at multiples of 128 bytes. A strip is 128 columns from the top to the
 * bottom of a picture: a kernel walks down one after the other, so that what it computed of a row
 * serves the rows below from registers. Borders are made in registers, too. */
#ifndef PIRT_DSP_HVX_H
#define PIRT_DSP_HVX_H

#include <stddef.h>
#include <stdint.h>

/* Of clang's own headers; hexagon_types.h has these only where C++ or a C library is. */
typedef int HVX_Vector __attribute__((__vector_size__(128), aligned(128)));
typedef int HVX_VectorPair __attribute__((__vector_size__(256), aligned(128)));
typedef int HVX_VectorPred __attribute__((__vector_size__(128), aligned(128)));
#include <hvx_hexagon_protos.h>

#include "workloads/backends/dsp/program/picture.h"

#define INLINE static inline __attribute__((always_inline))

enum { kVector = 128 };

typedef int HVX_Unaligned __attribute__((__vector_size__(128), aligned(1)));

INLINE HVX_Vector load(const void* p) { return *(const HVX_Vector*)p; }
INLINE void store(void* p, HVX_Vector v) { *(HVX_Vector*)p = v; }
INLINE HVX_Vector load_unaligned(const void* p) { return (HVX_Vector) * (const HVX_Unaligned*)p; }

/* A byte in each byte of a word. */
INLINE int32_t bytes4(int a, int b, int c, int d) {
  return (int32_t)((uint32_t)(a & 255) | (uint32_t)(b & 255) << 8 | (uint32_t)(c & 255) << 16 |
                   (uint32_t)(d & 255) << 24);
}

INLINE int32_t all_bytes(int a) { return bytes4(a, a, a, a); }

/* The bytes last to first: in a butterfly all of whose switches cross. */
INLINE HVX_Vector reversed(HVX_Vector v) { return Q6_V_vdelta_VV(v, Q6_V_vsplat_R(0x7f7f7f7f)); }

/* Where a strip lies: constants of each call, so that the compiler makes a loop of its own for the
 * strips at the edges and none of the others pays for them. */
typedef struct {
  int left;  /* its first column is the picture's */
  int right; /* the picture ends within it or kReach columns behind it */
} StripEdges;

enum { kReach = 8 }; /* no kernel looks at columns farther away */

typedef struct {
  int x;      /* its first column */
  int mirror; /* from a row's begin to the bytes that are, reversed, those from x on mirrored */
  StripEdges edges;
  HVX_VectorPred here, after; /* which columns of the strip and of that behind it there are */
} Strip;

/* The first `columns` of a vector, any number of them. */
INLINE HVX_VectorPred first(int columns) {
  if (columns <= 0) return Q6_Q_vsetq_R(0);
  return columns < kVector ? Q6_Q_vsetq_R(columns) : Q6_Q_not_Q(Q6_Q_vsetq_R(0));
}

INLINE Strip make_strip(int x, int width, StripEdges edges) {
  /* Column c beyond the right edge is 2 * (width - 1) - c. */
  const Strip strip = {x, 2 * (width - 1) - x - (kVector - 1), edges, first(width - x),
                       first(width - x - kVector)};
  return strip;
}

/* Three neighbouring vectors of a row: the strip's, with what is beyond the picture mirrored
 * without the edge pixel (gfedcba|bcdefg...). kReach columns at each side mean something, where the
 * picture is wider than that. */
typedef struct {
  HVX_Vector before, here, after;
} RowPart;

INLINE RowPart load_row_part(const uint8_t* row, const Strip* strip) {
  const uint8_t* at = row + strip->x;
  RowPart part = {load(strip->edges.left ? at : at - kVector), load(at), load(at + kVector)};
  /* before[j] is column j - 128, mirrored 128 - j = 1 + (127 - j) */
  if (strip->edges.left) part.before = reversed(load_unaligned(row + 1));
  if (strip->edges.right) {
    const uint8_t* mirror = row + strip->mirror;
    part.here = Q6_V_vmux_QVV(strip->here, part.here, reversed(load_unaligned(mirror)));
    part.after =
        Q6_V_vmux_QVV(strip->after, part.after, reversed(load_unaligned(mirror - kVector)));
  }
  return part;
}

/* A picture's rows from top to bottom, mirrored at both ends. */
typedef struct {
  const uint8_t* picture;
  int y, height, stride;
} Rows;

INLINE const uint8_t* next_row(Rows* rows) {
  return rows->picture + mirrored(rows->y++, rows->height) * rows->stride;
}

/* Calls walk(strip, context...) for each strip, with constant edges. */
#define FOR_EACH_STRIP(width, walk, ...)                            \
  do {                                                              \
    const int inner_ = (width)-kVector - kReach;                    \
    if (inner_ < 0) {                                               \
      walk(make_strip(0, width, (StripEdges){1, 1}), __VA_ARGS__);  \
    } else {                                                        \
      walk(make_strip(0, width, (StripEdges){1, 0}), __VA_ARGS__);  \
    }                                                               \
    int x_ = kVector;                                               \
    for (; x_ <= inner_; x_ += kVector) {                           \
      walk(make_strip(x_, width, (StripEdges){0, 0}), __VA_ARGS__); \
    }                                                               \
    for (; x_ < (width); x_ += kVector) {                           \
      walk(make_strip(x_, width, (StripEdges){0, 1}), __VA_ARGS__); \
    }                                                               \
  } while (0)

#endif
