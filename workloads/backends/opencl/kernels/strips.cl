// What the kernels of pictures that slide down strips share (gaussian_blur.cl, filter7x7.cl, sobel.cl);
// included by them: PoCL compiles what a program holds, called or not.
//
// A work item computes 16 columns of `rows` rows, top to bottom, and keeps what neighbouring rows
// share in registers. Segments begin at columns 0, 16, 32, ...; the last one is moved back to end
// with the row, the one before it where it would look beyond the row, and they write some pixels
// again, with the same values. Where a segment touches the left or right border, the columns beyond
// it are shuffled out of its own. Pictures too narrow for that go pixel by pixel. Global ids are
// (segment, strip of rows). Integer results are exact.

#include "border.cl"
#include "lanes.cl"

#define MIDDLE 0
#define LEFT 1
#define RIGHT 2

/// 16 pixels beginning at p + dx, -3 <= dx <= 3, reflected at the side that p's segment touches.
/// dx and side are constants where this is inlined.
INLINE uchar16 tap(__global const uchar* p, const int dx, const int side) {
  if (dx < 0 && side == LEFT) {
    const uchar16 v = LOAD(Bytes16, p);
    if (dx == -1) return v.s10123456789abcde;
    if (dx == -2) return v.s210123456789abcd;
    return v.s3210123456789abc;
  }
  if (dx > 0 && side == RIGHT) {
    const uchar16 v = LOAD(Bytes16, p);
    if (dx == 1) return v.s123456789abcdefe;
    if (dx == 2) return v.s23456789abcdefed;
    return v.s3456789abcdefedc;
  }
  return LOAD(Bytes16, p + dx);
}

/// Calls STRIP(x, side) for this item's segment, or PIXEL(x, y) for all pixels of its strip where
/// the picture is narrower than 16 + `reach` columns.
#define FOR_SEGMENT(reach, STRIP, PIXEL)                                    \
  const int segment = (int)get_global_id(0) * 16;                           \
  const int first = (int)get_global_id(1) * rows;                           \
  const int end = min(first + rows, height);                                \
  if (segment >= width) return;                                             \
  if (width < 16 + (reach)) {                                               \
    for (int y = first; y < end; ++y)                                       \
      for (int x = segment; x < min(segment + 16, width); ++x) PIXEL(x, y); \
  } else if (segment == 0) {                                                \
    STRIP(0, LEFT);                                                         \
  } else if (segment + 16 >= width) {                                       \
    STRIP(width - 16, RIGHT);                                               \
  } else {                                                                  \
    STRIP(min(segment, width - 16 - (reach)), MIDDLE);                      \
  }
