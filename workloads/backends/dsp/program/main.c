/* The Hexagon program: waits for commands and runs kernels. No C library: three system calls of
 * Linux and what the compiler calls by itself. It never spins: between commands it sleeps in
 * read(). */
#include <stddef.h>
#include <stdint.h>

#include "workloads/backends/dsp/program/kernel.h"
#include "workloads/backends/dsp/protocol.h"

/* Numbers of asm-generic/unistd.h, which Hexagon uses as they are. */
enum { kRead = 63, kWrite = 64, kExit = 93, kMmap = 222 };
enum { kReadWrite = 3, kMapShared = 1 };

static int32_t system_call(int32_t number, int32_t a, int32_t b, int32_t c, int32_t d, int32_t e,
                           int32_t f) {
  register int32_t r6 __asm__("r6") = number;
  register int32_t r0 __asm__("r0") = a;
  register int32_t r1 __asm__("r1") = b;
  register int32_t r2 __asm__("r2") = c;
  register int32_t r3 __asm__("r3") = d;
  register int32_t r4 __asm__("r4") = e;
  register int32_t r5 __asm__("r5") = f;
  __asm__ volatile("trap0(#1)"
                   : "+r"(r0)
                   : "r"(r6), "r"(r1), "r"(r2), "r"(r3), "r"(r4), "r"(r5)
                   : "memory");
  return r0;
}

void* memset(void* to, int value, size_t bytes) {
  uint8_t* p = to;
  for (size_t i = 0; i < bytes; ++i) {
    p[i] = (uint8_t)value;
    __asm__ volatile("" ::: "memory"); /* or the loop becomes a call of itself */
  }
  return to;
}

void* memcpy(void* to, const void* from, size_t bytes) {
  uint8_t* p = to;
  const uint8_t* q = from;
  for (size_t i = 0; i < bytes; ++i) {
    p[i] = q[i];
    __asm__ volatile("" ::: "memory");
  }
  return to;
}

static uint8_t* mapping;
static uint32_t mapping_bytes;

static PirtDspReply map_shared(const PirtDspCommand* command) {
  PirtDspReply reply = {command->serial, PIRT_DSP_OK, 0};
  const int32_t bytes = command->values[0];
  const int32_t address =
      system_call(kMmap, 0, bytes, kReadWrite, kMapShared, PIRT_DSP_MAPPING_FD, 0);
  if (address < 0 && address > -4096) {
    reply.status = PIRT_DSP_NOT_MAPPED;
    reply.detail = (uint32_t)-address;
  } else {
    mapping = (uint8_t*)address;
    mapping_bytes = (uint32_t)bytes;
  }
  return reply;
}

typedef void (*Kernel)(const KernelArguments*);

static PirtDspReply run_kernel(const PirtDspCommand* command) {
  static const Kernel kernels[] = {
      NULL,
#define PIRT_DSP_KERNEL(name) pirt_dsp_##name,
#include "workloads/backends/dsp/kernels.inc"
#undef PIRT_DSP_KERNEL
  };
  PirtDspReply reply = {command->serial, PIRT_DSP_OK, 0};
  KernelArguments arguments;
  if (command->kernel >= PIRT_DSP_KERNEL_COUNT) {
    reply.status = PIRT_DSP_NO_SUCH_KERNEL;
    return reply;
  }
  if (mapping == NULL) {
    reply.status = PIRT_DSP_NOT_MAPPED;
    return reply;
  }
  for (uint32_t i = 0; i < PIRT_DSP_MAX_BUFFERS; ++i) {
    const PirtDspBuffer* buffer = &command->buffers[i];
    if (buffer->offset > mapping_bytes || buffer->bytes > mapping_bytes - buffer->offset) {
      reply.status = PIRT_DSP_OUTSIDE_MAPPING;
      reply.detail = i;
      return reply;
    }
    arguments.buffers[i] = mapping + buffer->offset;
  }
  arguments.values = command->values;
  kernels[command->kernel](&arguments);
  return reply;
}

/* Commands and replies are shorter than what a pipe passes in one piece. */
__attribute__((noreturn, used)) static void serve(void) {
  PirtDspCommand command;
  while (system_call(kRead, PIRT_DSP_COMMAND_FD, (int32_t)&command, sizeof command, 0, 0, 0) ==
         (int32_t)sizeof command) {
    const PirtDspReply reply =
        command.kernel == PIRT_DSP_MAP ? map_shared(&command) : run_kernel(&command);
    system_call(kWrite, PIRT_DSP_REPLY_FD, (int32_t)&reply, sizeof reply, 0, 0, 0);
  }
  for (;;) system_call(kExit, 0, 0, 0, 0, 0, 0);
}

/* The stack comes aligned to 8 bytes; vectors that the compiler keeps there want 128. */
__asm__(
    ".globl _start\n"
    "_start:\n"
    "  { r29 = and(r29, #-128) }\n"
    "  { jump serve }\n");
