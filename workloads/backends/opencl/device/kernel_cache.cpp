#include "workloads/backends/opencl/device/kernel_cache.h"

#include <fmt/core.h>
#include <stdlib.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <system_error>
#include <vector>

namespace pirt::opencl {
namespace {

namespace fs = std::filesystem;

std::optional<fs::path> folder_in(const char* variable) {
  const char* const value = std::getenv(variable);
  return value != nullptr && *value != '\0' ? std::optional(fs::path(value)) : std::nullopt;
}

/// @source PoCL 3.1, lib/CL/pocl_cache.c.
std::optional<fs::path> kernel_cache() {
  if (auto own = folder_in("POCL_CACHE_DIR")) return own;
  const fs::path below = fs::path("pocl") / "kcache";
  if (const auto caches = folder_in("XDG_CACHE_HOME")) return *caches / below;
  if (const auto home = folder_in("HOME")) return *home / ".cache" / below;
  return std::nullopt;
}

/// Why no file can be made in @p folder; no error if one can. The rights of a folder do not tell:
/// root has all of them, also where the file system takes nothing.
std::error_code writing_error(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return error;
  std::string name = (folder / "pirt-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) return {errno, std::generic_category()};
  fs::remove(name, error);
  return error;
}

}  // namespace

std::string kernel_cache_complaint(const cl::Platform& platform) {
  if (platform.getInfo<CL_PLATFORM_NAME>() != "Portable Computing Language") return "";
  const auto folder = kernel_cache();
  if (!folder) return "";
  const std::error_code error = writing_error(*folder);
  if (!error) return "";
  return fmt::format(
      "PoCL cannot write its kernel cache '{}' ({}); set POCL_CACHE_DIR to a folder that can be "
      "written",
      folder->string(), error.message());
}

std::string why_no_device() {
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    // No driver at all.
  }
  for (const cl::Platform& platform : platforms) {
    const std::string complaint = kernel_cache_complaint(platform);
    if (!complaint.empty()) return "no OpenCL device: " + complaint;
  }
  return fmt::format("no OpenCL device; {}", kInstallDriver);
}

}  // namespace pirt::opencl
