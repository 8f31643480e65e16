/* What host and Hexagon program say to each other: plain C, compiled by both.
 *
 * The program maps one file (shared with the host), reads a command, runs a kernel on buffers of
 * that mapping, writes a reply, and waits in read() for the next; end of file ends it. The plugin
 * counts what lies between the end of a read() and the next write(). Both ends are little-endian.
 */
#ifndef PIRT_DSP_PROTOCOL_H
#define PIRT_DSP_PROTOCOL_H

#include <stdint.h>

/* Descriptors that the program inherits, out of the way of those that the emulator opens. */
#define PIRT_DSP_MAPPING_FD 200
#define PIRT_DSP_COMMAND_FD 201
#define PIRT_DSP_REPLY_FD 202
#define PIRT_DSP_COUNTS_FD 203 /* the plugin's */

#define PIRT_DSP_MAX_BUFFERS 8
#define PIRT_DSP_MAX_VALUES 24
/* What buffers begin at a multiple of: a vector, and a line of any cache. */
#define PIRT_DSP_ALIGNMENT 128

/* Kernels by number. PIRT_DSP_MAP is the first command: values[0] is the mapping's size. */
enum {
  PIRT_DSP_MAP = 0,
#define PIRT_DSP_KERNEL(name) PIRT_DSP_##name,
#include "workloads/backends/dsp/kernels.inc"
#undef PIRT_DSP_KERNEL
  PIRT_DSP_KERNEL_COUNT
};

typedef struct {
  uint32_t offset; /* into the mapping */
  uint32_t bytes;
} PirtDspBuffer;

typedef struct {
  uint32_t serial; /* comes back in the reply */
  uint32_t kernel;
  PirtDspBuffer buffers[PIRT_DSP_MAX_BUFFERS]; /* unused ones are empty */
  int32_t values[PIRT_DSP_MAX_VALUES];
} PirtDspCommand;

enum {
  PIRT_DSP_OK = 0,
  PIRT_DSP_NO_SUCH_KERNEL = 1,
  PIRT_DSP_NOT_MAPPED = 2,     /* detail: errno of mmap, or 0 where there was no PIRT_DSP_MAP */
  PIRT_DSP_OUTSIDE_MAPPING = 3 /* detail: the buffer's number */
};

typedef struct {
  uint32_t serial;
  uint32_t status;
  uint32_t detail;
} PirtDspReply;

typedef struct {
  uint64_t packets;
  uint64_t
      lines; /* of PIRT_DSP_LINE bytes that accesses went over to; 0 unless memory is modelled */
  uint64_t misses; /* of these, those that the modelled L2 did not hold */
} PirtDspCounts;

/* What the plugin has counted, written at write(): it stands until the host, which has the reply
 * then, sends the next command. */
typedef struct {
  uint32_t magic; /* PIRT_DSP_COUNTS_MAGIC, once the plugin is in place */
  uint32_t reserved;
  PirtDspCounts total;
  PirtDspCounts command; /* since the last read() */
} PirtDspCountsPage;

#define PIRT_DSP_COUNTS_MAGIC 0x70697274U
/* The modelled L2; see cost_model.h. */
#define PIRT_DSP_LINE 64
#define PIRT_DSP_L2_BYTES (512 << 10)
#define PIRT_DSP_L2_WAYS 8

#endif
