/* pirt's interface for workloads of your own: what a shared library gives pirt. C99;
 * <pirt/module.hpp> is a C++ face on it.
 *
 * A module is a shared library with one function, pirt_module_v1(), which returns a table of
 * workloads. pirt loads it where it measures or runs them (`--workloads libmine.so`,
 * RuntimeOptions::workloads), with RTLD_LOCAL, and never unloads it.
 *
 * The rules:
 * - Each struct begins with its size and PIRT_MODULE_VERSION: PIRT_HEAD(pirt_workload). A later
 * version appends fields; a library of this version is loaded for ever.
 * - The table and all that it points to stay as they are until the process ends.
 * - No exception crosses the interface. A function returns 0, or another number and why in
 * `message`.
 * - Tensors are the caller's: dense, row-major, aligned to 64 bytes. Nobody keeps their addresses
 * beyond a call.
 * - A kernel object is used by one thread at a time; each `make` that returned 0 is followed by one
 * `release`. Different objects are used at once.
 * - A module may start threads; the caller of a kernel must be able to let go of its tensors when
 * the kernel has returned. */
#ifndef PIRT_MODULE_H
#define PIRT_MODULE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PIRT_MODULE_VERSION 1
#define PIRT_HEAD(type) (uint32_t)sizeof(type), PIRT_MODULE_VERSION
#define PIRT_MOST_DIMS 6
#if defined(__GNUC__)
#define PIRT_EXPORT __attribute__((visibility("default")))
#else
#define PIRT_EXPORT
#endif

/* Types of a tensor's elements. */
enum { PIRT_U8 = 0, PIRT_I16 = 1, PIRT_I32 = 2, PIRT_F32 = 3, PIRT_F64 = 4 };

/* In a shape or a global size: the width and height that the workload is made for
 * (pirt_workload::width, or NAME@1280x720). */
enum { PIRT_WIDTH = -1, PIRT_HEIGHT = -2 };

/* What a tensor is. */
typedef struct pirt_tensor_spec {
  uint32_t size, version;
  const char* name;
  int32_t element; /* PIRT_U8, ... */
  int32_t dims;    /* 1 to PIRT_MOST_DIMS */
  int64_t
      shape[PIRT_MOST_DIMS]; /* slowest dimension first; extents >= 1, or PIRT_WIDTH, PIRT_HEIGHT */
  int32_t varies; /* 1: shape[0] is a capacity, and each tensor says how many of its rows it has */
  int32_t has_range; /* 1: values are within low and high, ends included */
  double low, high;
} pirt_tensor_spec;

/* A tensor of a call. */
typedef struct pirt_tensor {
  uint32_t size, version;
  void* data;
  int32_t element, dims;
  int64_t shape[PIRT_MOST_DIMS];
  int64_t rows; /* that it has; a kernel sets it of outputs that vary, 0 to shape[0] */
} pirt_tensor;

/* What a kernel is made for. */
typedef struct pirt_setup {
  uint32_t size, version;
  int64_t width, height;         /* 0 where the workload has no sizes */
  const pirt_tensor* parameters; /* as pirt_workload::parameters; valid until `make` returns */
  int32_t threads;               /* cores that the unit has */
  char* message;                 /* for a failure: text of up to message_size bytes with its 0 */
  size_t message_size;
} pirt_setup;

/* One call. Arrays are as those of pirt_workload. */
typedef struct pirt_call {
  uint32_t size, version;
  const pirt_tensor* inputs;
  pirt_tensor* outputs;
  const pirt_tensor* parameters; /* of a reference; null for kernels, which had them at `make` */
  const pirt_tensor* state;      /* to be read, */
  pirt_tensor* next_state;       /* and to be written as a whole; both null without a state */
  int64_t width, height;
  int32_t threads;
  /* 1: the result is wanted no more; the kernel may return 0 at once, whatever its outputs hold. */
  int32_t (*is_stopped)(const struct pirt_call* call);
  /* To be called between two of pirt_workload::slices: the unit may compute something more urgent
   * meanwhile, on this thread. */
  void (*between_slices)(const struct pirt_call* call);
  char* message;
  size_t message_size;
} pirt_call;

/* A function of the host's cores. */
typedef struct pirt_cpu_kernel {
  uint32_t size, version;
  int (*make)(const pirt_setup* setup, void** kernel); /* may be null: `run` gets a null kernel */
  int (*run)(void* kernel, const pirt_call* call);
  void (*release)(void* kernel); /* may be null without `make` */
} pirt_cpu_kernel;

/* An argument of an OpenCL kernel: a tensor of the workload by its name ("next NAME": what of the
 * state is written), or a number. */
typedef struct pirt_opencl_argument {
  uint32_t size, version;
  const char* tensor; /* null: a number */
  int32_t element;    /* of a number: PIRT_U8, ... */
  double value;
} pirt_opencl_argument;

/* The unit that a kernel is made on, and the workload's buffers there, as cl_context, cl_device_id,
 * cl_command_queue, cl_mem. */
typedef struct pirt_opencl_unit {
  uint32_t size, version;
  void *context, *device, *queue; /* the queue is in order; enqueue, and do not wait */
  void *const *inputs, *const *outputs, *const *parameters;
  int64_t width, height;
  char* message;
  size_t message_size;
} pirt_opencl_unit;

/* OpenCL: a source whose kernel is launched once a call, or functions that enqueue what they like.
 */
typedef struct pirt_opencl_kernel {
  uint32_t size, version;
  const char* source; /* OpenCL C 1.2; null: the functions below */
  const char* kernel;
  const char* options; /* of the compiler, or null; -DPIRT_WIDTH=..., -DPIRT_HEIGHT=... are added */
  int64_t global[3], local[3];           /* 0: 1, and as the driver likes; global sizes as shapes */
  const pirt_opencl_argument* arguments; /* in the kernel's order */
  uint32_t argument_count;
  int (*make)(const pirt_opencl_unit* unit, void** kernel);
  int (*enqueue)(void* kernel, const pirt_opencl_unit* unit);
  void (*release)(void* kernel);
} pirt_opencl_kernel;

/* A workload. */
typedef struct pirt_workload {
  uint32_t size, version;
  const char* name; /* with a dot, "mine.sobel"; letters, digits, '_', '-' and '.' */
  const char* description;
  const pirt_tensor_spec *inputs, *outputs, *parameters, *state;
  uint32_t input_count, output_count, parameter_count, state_count;
  int64_t width, height; /* that it has by itself; 0 where no shape has PIRT_WIDTH or PIRT_HEIGHT */
  int32_t
      frames; /* inputs of the sequence that it is measured with; 0 or 1: one call is repeated */
  int32_t slices; /* parts of a call of about the same time; 0 or 1: it cannot be suspended. A row
                     says where calls have others */
  double operations_per_element; /* of the first output; 0: not known */
  double tolerance; /* |output - reference| <= tolerance * max|reference| of the tensor; 0: integers
                       are equal, and 1e-4 of others */
  /* Input number `frame` of the sequence, and the parameters, a pure function of the seed. Null:
   * pictures for u8[height, width] and u8[3, height, width], each the frame after that of the input
   * before it, else numbers within the range (without one: all of u8, -100 to 100 of other
   * integers, 0 to 1). */
  int (*make_inputs)(uint64_t seed, int32_t frame, pirt_tensor* inputs, pirt_tensor* parameters);
  int (*make_state)(pirt_tensor* state); /* before the first call; null: zeros */
  /* The definition, written for clarity. Null: the outputs of the first unit are what the others
   * are compared with, and rows say `unverified`. */
  int (*reference)(const pirt_call* call);
  const pirt_cpu_kernel* cpu; /* either may be null */
  const pirt_opencl_kernel* opencl;
} pirt_workload;

typedef struct pirt_module {
  uint32_t size, version;
  const pirt_workload* const* workloads;
  uint32_t workload_count;
} pirt_module;

/* What a module exports. */
PIRT_EXPORT const pirt_module* pirt_module_v1(void);

#ifdef __cplusplus
}
#endif

#endif
