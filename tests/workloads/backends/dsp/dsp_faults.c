/* A Hexagon program all of whose kernels do what values[0] says, for tests of what the host makes
 * of it. */
#include "workloads/backends/dsp/program/kernel.h"

enum { kFine, kIllegalInstruction, kNullPointer, kEndless, kEnd };

static void misbehave(const KernelArguments* arguments) {
  switch (arguments->values[0]) {
    case kIllegalInstruction:
      __asm__ volatile(".word 0xffffffff");
      break;
    case kNullPointer:
      *(volatile int*)4 = 1;
      break;
    case kEndless:
      for (;;) __asm__ volatile("" ::: "memory");
    case kEnd:
      __asm__ volatile("r6 = #93\n r0 = #7\n trap0(#1)" ::: "r0", "r6");
      break;
    default:
      break;
  }
}

#define PIRT_DSP_KERNEL(name) \
  void pirt_dsp_##name(const KernelArguments* arguments) { misbehave(arguments); }
#include "workloads/backends/dsp/kernels.inc"
#undef PIRT_DSP_KERNEL
