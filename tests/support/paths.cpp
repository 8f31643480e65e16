#include "tests/support/paths.h"

namespace pirt::test {

const char* const kSourceFolder = PIRT_SOURCE_FOLDER;
const char* const kProgram = PIRT_PROGRAM;
const char* const kTestWorker = PIRT_TEST_WORKER;
const char* const kNvmlStandIn = PIRT_NVML_STAND_IN;
const char* const kGpuStandIn = PIRT_GPU_STAND_IN;
const char* const kNvmlStandInOld = PIRT_NVML_STAND_IN_OLD;
const char* const kMeddlingLibrary = PIRT_MEDDLING_LIBRARY;
const char* const kExampleModule = PIRT_EXAMPLE_MODULE;
const char* const kFastModule = PIRT_FAST_MODULE;
const char* const kSpoiltModule = PIRT_SPOILT_MODULE;
const char* const kHostileModule = PIRT_HOSTILE_MODULE;

}  // namespace pirt::test
