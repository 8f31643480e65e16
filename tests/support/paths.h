// Where this build has what tests run and read. Only paths.cpp is compiled with the paths, so that
// no other object of the tests depends on where its clone lies, and a compiler cache serves them
// all.
#pragma once

namespace pirt::test {

extern const char* const kSourceFolder;  ///< The root of the source tree.
extern const char* const kProgram;       ///< pirt itself.
extern const char* const kTestWorker;    ///< characterize/worker_main.cc: a worker on its own.
/// characterize/nvml_stand_in.cc, as it is and as an old driver's.
extern const char* const kNvmlStandIn;
extern const char* const kNvmlStandInOld;
extern const char* const kGpuStandIn;       ///< workloads/backends/opencl/gpu_stand_in.cc
extern const char* const kMeddlingLibrary;  ///< cli/meddling_library.cc
extern const char* const kExampleModule;    ///< examples/module/mine.cpp
extern const char* const kFastModule;       ///< examples/module/fast.cpp
extern const char* const kSpoiltModule;     ///< workloads/own/spoilt_module.cc
extern const char* const kHostileModule;    ///< workloads/own/hostile_module.cc

}  // namespace pirt::test
