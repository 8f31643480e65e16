// Tuning files of the tests' own.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "workloads/backends/opencl/tuning/tuning_file.h"
#include "workloads/base/text/text.h"

namespace pirt::test {

/// The defaults, as an entry for @p device.
inline opencl::TunedDevice entry_for(const DeviceInfo& device) {
  return {.device = device.name,
          .platform = device.platform,
          .version = device.version,
          .pirt_version = "test",
          .date = "2026-01-02T03:04:05Z",
          .tuning = opencl::Tuning(device.is_cpu)};
}

/// PIRT_TUNING, back to what it was in the end.
class TuningVariable {
 public:
  explicit TuningVariable(const std::string& value) {
    if (const char* before = std::getenv("PIRT_TUNING")) before_ = before;
    ::setenv("PIRT_TUNING", value.c_str(), 1);
  }
  ~TuningVariable() { ::setenv("PIRT_TUNING", before_.c_str(), 1); }
  TuningVariable(const TuningVariable&) = delete;
  TuningVariable& operator=(const TuningVariable&) = delete;

 private:
  std::string before_ = "none";
};

/// A tuning file that devices are opened with as long as this lives.
class TuningInUse {
 public:
  explicit TuningInUse(std::vector<opencl::TunedDevice> devices)
      : TuningInUse(opencl::tuning_text({.devices = std::move(devices)})) {}
  explicit TuningInUse(const std::string& text) : variable_(path_.string()) {
    write_file(path_, text);
  }
  ~TuningInUse() { std::filesystem::remove(path_); }
  TuningInUse(const TuningInUse&) = delete;
  TuningInUse& operator=(const TuningInUse&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_ = std::filesystem::temp_directory_path() /
                                ("pirt_tuning_" + std::to_string(::getpid()) + ".json");
  TuningVariable variable_;
};

}  // namespace pirt::test
