// Keeps this test program out of the user's kernel cache: the drivers' goes beside the program,
// where the next run finds it.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

#include "workloads/backends/opencl/opencl_backend.h"

/// LeakSanitizer asks for it, where it is linked. PoCL keeps its compiler and what it found out
/// about devices until the process ends.
extern "C" const char* __lsan_default_suppressions();   // NOLINT(bugprone-reserved-identifier)
extern "C" const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:libpocl\n";
}

namespace pirt {
namespace {

/// A folder for a cache in @p folder; where nobody may write there, in one of the process's own.
std::filesystem::path cache_in(const std::filesystem::path& folder) {
  auto cache = folder / "kernel_cache";
  std::error_code failed;
  std::filesystem::create_directories(cache, failed);
  if (failed || ::access(cache.c_str(), W_OK) != 0) {
    cache = std::filesystem::path(testing::TempDir()) / "kernel_cache";
    std::filesystem::create_directories(cache);
  }
  return cache;
}

class KernelCacheBesideTheProgram : public testing::Environment {
 public:
  /// Before the first test, hence before the first OpenCL call of the process.
  void SetUp() override {
    // Not where it was built: tests/bench/gpu runs it wherever it is unpacked.
    const auto program = std::filesystem::read_symlink("/proc/self/exe");
    for (const auto& [variable, value] : make_opencl_backend()->kernel_cache_environment(
             cache_in(program.parent_path()).string())) {
      setenv(variable.c_str(), value.c_str(), /*overwrite=*/1);
    }
  }
};

// GoogleTest's own way to add an environment without a main().
[[maybe_unused]] const auto* const kEnvironment =
    testing::AddGlobalTestEnvironment(new KernelCacheBesideTheProgram);

TEST(OpenClKernelCache, LiesInAFolderThatMayBeWritten) {
  const std::filesystem::path own = testing::TempDir();
  EXPECT_EQ(cache_in(own / "beside").string(), (own / "beside" / "kernel_cache").string());
  EXPECT_EQ(cache_in("/proc/nope").string(), (own / "kernel_cache").string());
  EXPECT_TRUE(std::filesystem::is_directory(own / "kernel_cache"));
}

}  // namespace
}  // namespace pirt
