// PoCL without a folder to keep compiled kernels in has no devices, or builds nothing, and does not
// say why.
#pragma once

#include <string>

#include "workloads/backends/opencl/device/api.h"

namespace pirt::opencl {

/// Why there is no device, with the remedy.
[[nodiscard]] std::string why_no_device();

/// What keeps PoCL from writing its kernel cache, with the remedy; empty if nothing does, and for
/// other drivers. Makes the folder as PoCL would.
[[nodiscard]] std::string kernel_cache_complaint(const cl::Platform& platform);

}  // namespace pirt::opencl
