// Keeps this test program out of the user's kernel cache: PoCL's goes beside the test binaries,
// where the next run finds it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "tests/support/paths.h"
#include "workloads/backends/opencl/opencl_backend.h"

/// LeakSanitizer asks for it, where it is linked. PoCL keeps its compiler and what it found out
/// about devices until the process ends.
extern "C" const char* __lsan_default_suppressions();   // NOLINT(bugprone-reserved-identifier)
extern "C" const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:libpocl\n";
}

namespace pirt {
namespace {

class KernelCacheInBuildFolder : public testing::Environment {
 public:
  /// Before the first test, hence before the first OpenCL call of the process.
  void SetUp() override {
    const auto folder =
        std::filesystem::path(test::kProgram).parent_path() / "tests" / "kernel_cache";
    std::filesystem::create_directories(folder);
    for (const auto& [variable, value] :
         make_opencl_backend()->kernel_cache_environment(folder.string())) {
      setenv(variable.c_str(), value.c_str(), /*overwrite=*/1);
    }
  }
};

// GoogleTest's own way to add an environment without a main().
[[maybe_unused]] const auto* const kEnvironment =
    testing::AddGlobalTestEnvironment(new KernelCacheInBuildFolder);

}  // namespace
}  // namespace pirt
