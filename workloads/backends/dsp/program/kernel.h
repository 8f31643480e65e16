/* What a kernel of the Hexagon program sees. */
#ifndef PIRT_DSP_KERNEL_H
#define PIRT_DSP_KERNEL_H

#include <stdint.h>

/* A command's buffers as addresses, its values as they came. */
typedef struct {
  void* buffers[8];
  const int32_t* values;
} KernelArguments;

#define PIRT_DSP_KERNEL(name) void pirt_dsp_##name(const KernelArguments* arguments);
#include "workloads/backends/dsp/kernels.inc"
#undef PIRT_DSP_KERNEL

#endif
