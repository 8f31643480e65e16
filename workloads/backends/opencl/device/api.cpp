#include "workloads/backends/opencl/device/api.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>

#include "workloads/base/error.h"

namespace pirt::opencl {
namespace {

struct CodeName {
  cl_int code;
  std::string_view name;
  std::string_view remedy = {};
};

constexpr std::string_view kFreeMemory = "free device memory or choose a device with more";
// No "; " within: the last one of a message begins the remedy.
constexpr std::string_view kNoResources =
    "free device memory, or mend a kernel that reads or writes beyond its buffers, of which "
    "drivers say the same";
constexpr std::string_view kCheckDriver = "check the driver with clinfo";

// The codes of OpenCL 1.2 that the calls of this backend can return, the ICD loader's own (-1001),
// and NVIDIA's of a context that is lost (-9999).
constexpr std::array kCodes = {
    CodeName{-9999, "error -9999",
             "mend a kernel that reads or writes beyond its buffers, or start again: NVIDIA's "
             "driver says so of a lost device as well"},
    CodeName{-1001, "CL_PLATFORM_NOT_FOUND_KHR", kInstallDriver},
    CodeName{CL_DEVICE_NOT_FOUND, "CL_DEVICE_NOT_FOUND", kInstallDriver},
    CodeName{CL_DEVICE_NOT_AVAILABLE, "CL_DEVICE_NOT_AVAILABLE", kCheckDriver},
    CodeName{CL_COMPILER_NOT_AVAILABLE, "CL_COMPILER_NOT_AVAILABLE", kCheckDriver},
    CodeName{CL_MEM_OBJECT_ALLOCATION_FAILURE, "CL_MEM_OBJECT_ALLOCATION_FAILURE", kFreeMemory},
    CodeName{CL_OUT_OF_RESOURCES, "CL_OUT_OF_RESOURCES", kNoResources},
    CodeName{CL_OUT_OF_HOST_MEMORY, "CL_OUT_OF_HOST_MEMORY", "free host memory"},
    CodeName{CL_PROFILING_INFO_NOT_AVAILABLE, "CL_PROFILING_INFO_NOT_AVAILABLE", kCheckDriver},
    CodeName{CL_MEM_COPY_OVERLAP, "CL_MEM_COPY_OVERLAP"},
    CodeName{CL_BUILD_PROGRAM_FAILURE, "CL_BUILD_PROGRAM_FAILURE"},
    CodeName{CL_MAP_FAILURE, "CL_MAP_FAILURE"},
    CodeName{CL_MISALIGNED_SUB_BUFFER_OFFSET, "CL_MISALIGNED_SUB_BUFFER_OFFSET"},
    CodeName{CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST,
             "CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST", kCheckDriver},
    CodeName{CL_DEVICE_PARTITION_FAILED, "CL_DEVICE_PARTITION_FAILED",
             "give the unit all cores of the device"},
    CodeName{CL_INVALID_VALUE, "CL_INVALID_VALUE"},
    CodeName{CL_INVALID_PLATFORM, "CL_INVALID_PLATFORM", kCheckDriver},
    CodeName{CL_INVALID_DEVICE, "CL_INVALID_DEVICE", kCheckDriver},
    CodeName{CL_INVALID_CONTEXT, "CL_INVALID_CONTEXT"},
    CodeName{CL_INVALID_QUEUE_PROPERTIES, "CL_INVALID_QUEUE_PROPERTIES", kCheckDriver},
    CodeName{CL_INVALID_COMMAND_QUEUE, "CL_INVALID_COMMAND_QUEUE"},
    CodeName{CL_INVALID_MEM_OBJECT, "CL_INVALID_MEM_OBJECT"},
    CodeName{CL_INVALID_BINARY, "CL_INVALID_BINARY", "empty the driver's kernel cache"},
    CodeName{CL_INVALID_BUILD_OPTIONS, "CL_INVALID_BUILD_OPTIONS"},
    CodeName{CL_INVALID_PROGRAM, "CL_INVALID_PROGRAM"},
    CodeName{CL_INVALID_PROGRAM_EXECUTABLE, "CL_INVALID_PROGRAM_EXECUTABLE"},
    CodeName{CL_INVALID_KERNEL_NAME, "CL_INVALID_KERNEL_NAME"},
    CodeName{CL_INVALID_KERNEL_DEFINITION, "CL_INVALID_KERNEL_DEFINITION"},
    CodeName{CL_INVALID_KERNEL, "CL_INVALID_KERNEL"},
    CodeName{CL_INVALID_ARG_INDEX, "CL_INVALID_ARG_INDEX"},
    CodeName{CL_INVALID_ARG_VALUE, "CL_INVALID_ARG_VALUE"},
    CodeName{CL_INVALID_ARG_SIZE, "CL_INVALID_ARG_SIZE"},
    CodeName{CL_INVALID_KERNEL_ARGS, "CL_INVALID_KERNEL_ARGS"},
    CodeName{CL_INVALID_WORK_DIMENSION, "CL_INVALID_WORK_DIMENSION"},
    CodeName{CL_INVALID_WORK_GROUP_SIZE, "CL_INVALID_WORK_GROUP_SIZE"},
    CodeName{CL_INVALID_WORK_ITEM_SIZE, "CL_INVALID_WORK_ITEM_SIZE"},
    CodeName{CL_INVALID_EVENT, "CL_INVALID_EVENT"},
    CodeName{CL_INVALID_OPERATION, "CL_INVALID_OPERATION"},
    CodeName{CL_INVALID_BUFFER_SIZE, "CL_INVALID_BUFFER_SIZE",
             "choose a device with a larger CL_DEVICE_MAX_MEM_ALLOC_SIZE"},
    CodeName{CL_INVALID_GLOBAL_WORK_SIZE, "CL_INVALID_GLOBAL_WORK_SIZE"},
    CodeName{CL_INVALID_DEVICE_PARTITION_COUNT, "CL_INVALID_DEVICE_PARTITION_COUNT",
             "give the unit fewer cores"},
};

const CodeName* find(cl_int code) {
  const auto* it = std::ranges::find(kCodes, code, &CodeName::code);
  return it == kCodes.end() ? nullptr : it;
}

}  // namespace

cl::Platform platform_of(const cl::Device& device) {
  cl_platform_id platform = nullptr;  // of which newer headers make a cl::Platform by themselves
  device.getInfo(CL_DEVICE_PLATFORM, &platform);
  return cl::Platform(platform, true);
}

std::string error_name(cl_int code) {
  const CodeName* known = find(code);
  return known != nullptr ? std::string(known->name) : fmt::format("error {}", code);
}

std::string describe(const cl::Error& error) {
  const CodeName* known = find(error.err());
  std::string text = fmt::format("{}: {}", error.what(), error_name(error.err()));
  if (known != nullptr && !known->remedy.empty()) text += fmt::format("; {}", known->remedy);
  return text;
}

void throw_translated(std::string_view doing, const cl::Error& error) {
  throw_environment(fmt::format("opencl: {}: {}", doing, describe(error)));
}

}  // namespace pirt::opencl
