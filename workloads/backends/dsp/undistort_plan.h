/* The map of undistort as the DSP wants it: tiles whose pixels come from a small window of the
 * source. Plain C, compiled by host and Hexagon program. */
#ifndef PIRT_DSP_UNDISTORT_PLAN_H
#define PIRT_DSP_UNDISTORT_PLAN_H

#include <stdint.h>

#define PIRT_DSP_TILE_WIDTH 16
#define PIRT_DSP_TILE_HEIGHT 8
#define PIRT_DSP_WINDOW_WIDTH 32
#define PIRT_DSP_WINDOW_HEIGHT 16

typedef struct {
  int32_t window; /* from the source buffer's begin to the window's first pixel */
  int32_t rows;   /* of the window that are used, at most PIRT_DSP_WINDOW_HEIGHT */
} PirtDspTile;

/* In the byte that has fy in its lowest 5 bits: the pixel, or the one below it, is in row 8 or
 * beyond of the window. Its index is row % 8 * 32 + column. */
#define PIRT_DSP_FLAG_HERE 0x80
#define PIRT_DSP_FLAG_BELOW 0x40

/* What the scalar twin has in place of tiles. */
typedef struct {
  int32_t offset; /* from the source buffer's begin to the upper left of the four pixels */
  int16_t fx, fy;
} PirtDspMapEntry;

#endif
