// A layer of the OpenCL loader (OPENCL_LAYERS) that makes PoCL's device stand in for a GPU: with
// memory of its own, of which there is too little, and a context that is lost. PIRT_STAND_IN_GPU
// says how, in words with a comma between:
//   memory_mb=N  what it has, 1024 otherwise.
//   taken_mb=N   what others have of that. As NVIDIA's driver does it, a buffer that is too much is
//                made, and the first command fails.
//   pinned=no    there is no memory of the host's that it reads and writes itself.
//   dies=1       who asks what a device is ends there.
//   lose=N       the Nth kernel that is put into a queue ends the context: nothing in it succeeds
//   any more. reopens=no   and no context can be made after that; otherwise once all of the lost
//   one is released, as
//                with NVIDIA's driver.
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl_layer.h>

#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <string>

namespace {

const cl_icd_dispatch* driver = nullptr;
cl_icd_dispatch layer;

constexpr long kMemoryMb = 1024;

std::mutex mutex;
struct Held {
  cl_context context;
  int references;
  std::size_t size_bytes;
};
std::map<void*, Held> held;  // Contexts, queues and buffers that are not released.
std::size_t used_bytes = 0;
long kernels = 0;
bool is_lost = false;  // One context was; there is one at a time, but for pirt's look at devices.
cl_context lost = nullptr;

long option(const char* name, long standard) {
  const char* text = std::getenv("PIRT_STAND_IN_GPU");
  const char* found = text == nullptr ? nullptr : std::strstr(text, name);
  return found == nullptr ? standard : std::strtol(found + std::strlen(name), nullptr, 10);
}
bool says(const char* words) {
  const char* text = std::getenv("PIRT_STAND_IN_GPU");
  return text != nullptr && std::strstr(text, words) != nullptr;
}

/// CL_SUCCESS, or what a command in the context ends with.
cl_int state_of(cl_context context) {
  const std::lock_guard lock(mutex);
  if (is_lost && context == lost) return CL_OUT_OF_RESOURCES;
  const long most_mb = option("memory_mb=", kMemoryMb) - option("taken_mb=", 0);
  if (used_bytes > static_cast<std::size_t>(most_mb) << 20) {
    return CL_MEM_OBJECT_ALLOCATION_FAILURE;
  }
  return CL_SUCCESS;
}
cl_int state_of(cl_command_queue queue) {
  cl_context context = nullptr;
  driver->clGetCommandQueueInfo(queue, CL_QUEUE_CONTEXT, sizeof(context), &context, nullptr);
  return state_of(context);
}

template <typename Object>
Object hold(Object object, cl_context context, std::size_t size_bytes = 0) {
  if (object == nullptr) return object;
  const std::lock_guard lock(mutex);
  held[object] = {context, 1, size_bytes};
  used_bytes += size_bytes;
  return object;
}
void retain(void* object) {
  const std::lock_guard lock(mutex);
  if (const auto found = held.find(object); found != held.end()) ++found->second.references;
}
void release(void* object) {
  const std::lock_guard lock(mutex);
  const auto found = held.find(object);
  if (found == held.end() || --found->second.references > 0) return;
  used_bytes -= found->second.size_bytes;
  held.erase(found);
}

template <auto Member>
struct Queued;
template <typename... Arguments,
          cl_int (CL_API_CALL* cl_icd_dispatch::*Member)(cl_command_queue, Arguments...)>
struct Queued<Member> {
  static cl_int CL_API_CALL call(cl_command_queue queue, Arguments... arguments) {
    const cl_int state = state_of(queue);
    return state == CL_SUCCESS ? (driver->*Member)(queue, arguments...) : state;
  }
};

cl_int CL_API_CALL launch(cl_command_queue queue, cl_kernel kernel, cl_uint dimensions,
                          const size_t* offset, const size_t* global, const size_t* local,
                          cl_uint count, const cl_event* after, cl_event* event) {
  {
    cl_context context = nullptr;
    driver->clGetCommandQueueInfo(queue, CL_QUEUE_CONTEXT, sizeof(context), &context, nullptr);
    const std::lock_guard lock(mutex);
    if (++kernels == option("lose=", -1)) {
      is_lost = true;
      lost = context;
    }
  }
  const cl_int state = state_of(queue);
  if (state != CL_SUCCESS) return state;
  return driver->clEnqueueNDRangeKernel(queue, kernel, dimensions, offset, global, local, count,
                                        after, event);
}

void* CL_API_CALL map_buffer(cl_command_queue queue, cl_mem buffer, cl_bool blocking,
                             cl_map_flags flags, size_t offset, size_t size, cl_uint count,
                             const cl_event* after, cl_event* event, cl_int* code) {
  const cl_int state = state_of(queue);
  if (state == CL_SUCCESS) {
    return driver->clEnqueueMapBuffer(queue, buffer, blocking, flags, offset, size, count, after,
                                      event, code);
  }
  if (code != nullptr) *code = state;
  return nullptr;
}

cl_mem CL_API_CALL create_buffer(cl_context context, cl_mem_flags flags, size_t size, void* host,
                                 cl_int* code) {
  {
    const std::lock_guard lock(mutex);
    if (is_lost && context == lost) {
      if (code != nullptr) *code = CL_OUT_OF_RESOURCES;
      return nullptr;
    }
  }
  if ((flags & CL_MEM_ALLOC_HOST_PTR) != 0 && says("pinned=no")) {
    if (code != nullptr) *code = CL_OUT_OF_HOST_MEMORY;
    return nullptr;
  }
  // What the host's memory holds takes none of the device's.
  const bool pinned = (flags & (CL_MEM_ALLOC_HOST_PTR | CL_MEM_USE_HOST_PTR)) != 0;
  return hold(driver->clCreateBuffer(context, flags, size, host, code), context, pinned ? 0 : size);
}

cl_context CL_API_CALL create_context(
    const cl_context_properties* properties, cl_uint count, const cl_device_id* devices,
    void(CL_CALLBACK* notify)(const char*, const void*, size_t, void*), void* user, cl_int* code) {
  {
    const std::lock_guard lock(mutex);
    bool remains = false;
    for (const auto& [object, each] : held) remains = remains || (is_lost && each.context == lost);
    if (is_lost && (remains || says("reopens=no"))) {
      constexpr cl_int kNvidiaSays = -9999;
      if (code != nullptr) *code = kNvidiaSays;
      return nullptr;
    }
    is_lost = false;
    lost = nullptr;
  }
  const cl_context context =
      driver->clCreateContext(properties, count, devices, notify, user, code);
  return hold(context, context);
}

cl_command_queue CL_API_CALL create_queue(cl_context context, cl_device_id device,
                                          cl_command_queue_properties properties, cl_int* code) {
  return hold(driver->clCreateCommandQueue(context, device, properties, code), context);
}

cl_int CL_API_CALL device_info(cl_device_id device, cl_device_info what, size_t size, void* value,
                               size_t* needed) {
  if (option("dies=", 0) != 0) std::abort();
  const auto answer = [&](const void* data, size_t bytes) -> cl_int {
    if (needed != nullptr) *needed = bytes;
    if (value == nullptr) return CL_SUCCESS;
    if (size < bytes) return CL_INVALID_VALUE;
    std::memcpy(value, data, bytes);
    return CL_SUCCESS;
  };
  const cl_device_type gpu = CL_DEVICE_TYPE_GPU;
  const cl_bool no = CL_FALSE;
  static const char name[] = "Stand-in GPU";
  const cl_ulong memory = static_cast<cl_ulong>(option("memory_mb=", kMemoryMb)) << 20;
  switch (what) {
    case CL_DEVICE_TYPE:
      return answer(&gpu, sizeof(gpu));
    case CL_DEVICE_HOST_UNIFIED_MEMORY:
      return answer(&no, sizeof(no));
    case CL_DEVICE_NAME:
      return answer(name, sizeof(name));
    case CL_DEVICE_GLOBAL_MEM_SIZE:
    case CL_DEVICE_MAX_MEM_ALLOC_SIZE:
      return answer(&memory, sizeof(memory));
    default:
      return driver->clGetDeviceInfo(device, what, size, value, needed);
  }
}

template <auto Retain, auto Release>
struct Counted;
template <typename Object, cl_int (CL_API_CALL* cl_icd_dispatch::*Retain)(Object),
          cl_int (CL_API_CALL* cl_icd_dispatch::*Release)(Object)>
struct Counted<Retain, Release> {
  static cl_int CL_API_CALL retained(Object object) {
    retain(object);
    return (driver->*Retain)(object);
  }
  static cl_int CL_API_CALL released(Object object) {
    release(object);
    return (driver->*Release)(object);
  }
};

}  // namespace

cl_int CL_API_CALL clGetLayerInfo(cl_layer_info what, size_t size, void* value, size_t* needed) {
  if (what != CL_LAYER_API_VERSION) return CL_INVALID_VALUE;
  const cl_layer_api_version version = CL_LAYER_API_VERSION_100;
  if (needed != nullptr) *needed = sizeof(version);
  if (value != nullptr && size >= sizeof(version)) std::memcpy(value, &version, sizeof(version));
  return CL_SUCCESS;
}

cl_int CL_API_CALL clInitLayer(cl_uint entries, const cl_icd_dispatch* target, cl_uint* count,
                               const cl_icd_dispatch** dispatch) {
  if (target == nullptr || count == nullptr || dispatch == nullptr ||
      entries < sizeof(layer) / sizeof(void*)) {
    return CL_INVALID_VALUE;
  }
  driver = target;
  layer = *target;
#define QUEUED(name) layer.name = Queued<&cl_icd_dispatch::name>::call
  QUEUED(clEnqueueReadBuffer);
  QUEUED(clEnqueueReadBufferRect);
  QUEUED(clEnqueueWriteBuffer);
  QUEUED(clEnqueueWriteBufferRect);
  QUEUED(clEnqueueCopyBuffer);
  QUEUED(clEnqueueFillBuffer);
  QUEUED(clEnqueueUnmapMemObject);
  QUEUED(clFinish);
#undef QUEUED
#define COUNTED(object)                                                                           \
  layer.clRetain##object =                                                                        \
      Counted<&cl_icd_dispatch::clRetain##object, &cl_icd_dispatch::clRelease##object>::retained; \
  layer.clRelease##object =                                                                       \
      Counted<&cl_icd_dispatch::clRetain##object, &cl_icd_dispatch::clRelease##object>::released
  COUNTED(Context);
  COUNTED(CommandQueue);
  COUNTED(MemObject);
#undef COUNTED
  layer.clGetDeviceInfo = device_info;
  layer.clCreateContext = create_context;
  layer.clCreateCommandQueue = create_queue;
  layer.clCreateBuffer = create_buffer;
  layer.clEnqueueNDRangeKernel = launch;
  layer.clEnqueueMapBuffer = map_buffer;
  *dispatch = &layer;
  *count = sizeof(layer) / sizeof(void*);
  return CL_SUCCESS;
}
