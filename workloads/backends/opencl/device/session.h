// What the kernels of an open unit share: device, context, queue.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "workloads/backends/opencl/device/api.h"
#include "workloads/backends/opencl/device/pinned.h"
#include "workloads/backends/opencl/tuning/tuning.h"

namespace pirt::opencl {

/// What was built for a device, by options and source: plans share it.
struct Programs {
  std::mutex mutex;
  std::map<std::string, cl::Program> built;
};

/// Handles that count their references: a copy keeps the device's objects alive.
struct DeviceSession {
  cl::Device device;
  cl::Context context;
  cl::CommandQueue queue;  ///< In order, with profiling.
  bool is_cpu = false;
  int lanes = 0;        ///< Floats of one of the device's vectors.
  Tuning tuning{true};  ///< Of this kind of device.
  /// The local size in x of every launch (1 in y) whose kernel takes as much. PoCL compiles a
  /// kernel anew for each local size that it meets, so that more than one would cost set-up time.
  /// At most what the device takes, whatever the tuning says.
  std::size_t local_x = 8;
  bool has_clock = true;    ///< Whether the stamps of events tell the time.
  std::string remark = {};  ///< DeviceInfo::remark.
  std::shared_ptr<Programs> programs = std::make_shared<Programs>();
  /// Null where the device works on the host's memory.
  std::shared_ptr<PinnedPool> pinned = nullptr;

  /// What a kernel is to be computed with.
  [[nodiscard]] int value(Parameter parameter) const {
    return for_vectors(tuning, lanes)[parameter];
  }
};

/// The most work items along x that a group can have on the device, whatever the kernel.
[[nodiscard]] std::size_t most_items(const cl::Device& device);

/// Whether its context does nothing any more, not even the least.
[[nodiscard]] bool is_lost(const DeviceSession& session);

/// Builds OpenCL C 1.2 source, once a session, with the parameters of the session's tuning that it
/// has as definitions (definitions_of), and the embedded .cl files that it includes.
/// @param name  Of the source: "dnn.cl".
/// @param definitions  Further ones, each with a blank before it.
/// @throws Error{kEnvironment} with the first lines of the build log if it does not build.
[[nodiscard]] cl::Program build_program(const DeviceSession& session, std::string_view name,
                                        std::string_view source,
                                        const std::string& definitions = {});

/// The same of somebody else's source, without definitions of the tuning and embedded files; its
/// kernels tell of their arguments.
/// @param file  For messages.
[[nodiscard]] cl::Program build_own_program(const DeviceSession& session, const std::string& file,
                                            const std::string& source, const std::string& options);

}  // namespace pirt::opencl
