// The loops that reach for the limits of an OpenCL device (kernels/peaks.cl).
#pragma once

#include "workloads/backends/opencl/device/session.h"
#include "workloads/model/peak.h"

namespace pirt::opencl {

/// The largest cache before the device's memory: the host's own where the device computes on it.
[[nodiscard]] std::optional<std::int64_t> cache_bytes(const cl::Device& device, bool is_cpu);

/// @param session  Is copied into the loops.
/// @throws Error{kEnvironment} or cl::Error if the device cannot.
[[nodiscard]] PeakLoops make_peak_loops(const DeviceSession& session);

}  // namespace pirt::opencl
