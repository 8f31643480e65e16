/* The choice of corners among candidates: strongest first, at a distance from each other. Scalar
 * code that feature_detect.c and its scalar twin share. */
#ifndef PIRT_DSP_CORNERS_H
#define PIRT_DSP_CORNERS_H

#include <stdint.h>

enum { kMostCorners = 500, kDistance = 10 };

/* Strength and, of equals the later, place. */
static inline uint64_t key_of(int32_t value, int x, int y) {
  return (uint64_t)(uint32_t)value << 32 | (uint32_t)y << 16 | (uint32_t)x;
}

static void sift_down(uint64_t* heap, int count, int at) {
  const uint64_t value = heap[at];
  for (int child = 2 * at + 1; child < count; child = 2 * at + 1) {
    if (child + 1 < count && heap[child + 1] > heap[child]) ++child;
    if (heap[child] <= value) break;
    heap[at] = heap[child];
    at = child;
  }
  heap[at] = value;
}

/* A bit a pixel, in rows of 32-bit words with one more at either end and kDistance rows more above
 * and below: the discs around accepted corners are never cut. */
typedef struct {
  uint32_t* words; /* of the picture's first pixel */
  int stride;
} Occupied;

static int is_occupied(Occupied map, int x, int y) {
  return (map.words[y * map.stride + (x >> 5)] >> (x & 31)) & 1;
}

static void occupy(Occupied map, int x, int y) {
  /* The largest dx with dx^2 + dy^2 < 10^2, by |dy|. */
  static const uint8_t reach[kDistance] = {9, 9, 9, 9, 9, 8, 7, 7, 5, 4};
  for (int dy = 1 - kDistance; dy < kDistance; ++dy) {
    const int half = reach[dy < 0 ? -dy : dy];
    const int from = x - half;
    const uint64_t run = ((uint64_t)1 << (2 * half + 1)) - 1;
    uint32_t* word = map.words + (y + dy) * map.stride + (from >> 5);
    const uint64_t bits = run << (from & 31);
    word[0] |= (uint32_t)bits;
    word[1] |= (uint32_t)(bits >> 32);
  }
}

static int choose(uint64_t* heap, int count, Occupied map, float* corners) {
  for (int i = count / 2 - 1; i >= 0; --i) sift_down(heap, count, i);
  int chosen = 0;
  while (count > 0 && chosen < kMostCorners) {
    const int x = (int)(heap[0] & 0xffff);
    const int y = (int)(heap[0] >> 16 & 0xffff);
    heap[0] = heap[--count];
    if (count > 0) sift_down(heap, count, 0);
    if (is_occupied(map, x, y)) continue;
    occupy(map, x, y);
    corners[2 * chosen] = (float)x;
    corners[2 * chosen + 1] = (float)y;
    ++chosen;
  }
  return chosen;
}

#endif
