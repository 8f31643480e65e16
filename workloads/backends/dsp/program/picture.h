/* Where rows of a picture are. */
#ifndef PIRT_DSP_PICTURE_H
#define PIRT_DSP_PICTURE_H

/* Columns that the scalar twins have room for. */
enum { kWidest = 2048 };

/* The row, or column, that mirroring without the edge means by y. */
static inline int mirrored(int y, int height) {
  if (y < 0) y = -y;
  return y < height ? y : 2 * (height - 1) - y;
}

/* The same where the edge is repeated. */
static inline int clamped(int y, int height) { return y < 0 ? 0 : y < height ? y : height - 1; }

#endif
