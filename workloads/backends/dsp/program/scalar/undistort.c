/* The scalar twin of ../undistort.c: four bytes a pixel, along a map of offsets and weights that
 * stands for the tiles there (buffer 4: PirtDspMapEntry [height, width]; buffers 0 and 1 as there;
 * values[3] is the width). */
#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/undistort_plan.h"

void pirt_dsp_undistort(const KernelArguments* arguments) {
  const uint8_t* source = arguments->buffers[0];
  uint8_t* out = arguments->buffers[1];
  const PirtDspMapEntry* map = arguments->buffers[4];
  const int height = arguments->values[0];
  const int stride = arguments->values[1];
  const int source_stride = arguments->values[2];
  const int width = arguments->values[3];
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++map) {
      const uint8_t* p = source + map->offset;
      const int above = (32 - map->fx) * p[0] + map->fx * p[1];
      const int below = (32 - map->fx) * p[source_stride] + map->fx * p[source_stride + 1];
      out[y * stride + x] = (uint8_t)(((32 - map->fy) * above + map->fy * below + 512) >> 10);
    }
  }
}
