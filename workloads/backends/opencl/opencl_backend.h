// The OpenCL backend: any OpenCL 1.2 device that the ICD loader finds; PoCL where there is none but
// the CPU.
#pragma once

#include <memory>

#include "workloads/model/backend.h"

namespace pirt {

[[nodiscard]] std::unique_ptr<const Backend> make_opencl_backend();

}  // namespace pirt
