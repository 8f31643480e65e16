// The file that keeps tuned parameters by device: found, read, written. What is not exactly the
// device that was tuned (name, platform, driver version) gets the defaults; a file that cannot be
// trusted is an error and never other parameters.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "workloads/backends/opencl/tuning/tuning.h"
#include "workloads/model/backend.h"

namespace pirt::opencl {

/// One device's entry.
struct TunedDevice {
  std::string device;        ///< DeviceInfo::name,
  std::string platform;      ///< ::platform
  std::string version;       ///< and ::version: the identity.
  std::string pirt_version;  ///< Of the pirt that tuned it.
  std::string date;          ///< ISO 8601, UTC: "2026-11-21T12:00:00Z".
  Tuning tuning{true};
  friend bool operator==(const TunedDevice&, const TunedDevice&) = default;
};

struct TuningFile {
  std::vector<TunedDevice> devices;  ///< Each identity once.

  /// The entry with exactly this identity; null if there is none.
  [[nodiscard]] const TunedDevice* find(const DeviceInfo& device) const;
  /// Adds an entry, or puts it in the place of the one with the same identity.
  void put(TunedDevice entry);
};

/// Where tuned parameters are kept: PIRT_TUNING if set; otherwise pirt/opencl-tuning.json in
/// $XDG_CONFIG_HOME or ~/.config. Nothing if PIRT_TUNING is "none" or there is no home.
[[nodiscard]] std::optional<std::filesystem::path> tuning_path();

/// @param path  For messages.
/// @throws Error{kBadInput} with the path and a remedy if it is not such a file of this version, or
/// has a parameter or value that this version does not know.
[[nodiscard]] TuningFile parse_tuning(const std::filesystem::path& path, const std::string& text);
[[nodiscard]] std::string tuning_text(const TuningFile& file);

/// The file at @p path; empty if there is none.
/// @throws Error{kBadInput} as parse_tuning(), or if it cannot be read.
[[nodiscard]] TuningFile load_tuning(const std::filesystem::path& path);

/// The file at tuning_path().
/// @throws Error{kBadInput} as load_tuning(), and if PIRT_TUNING names a file that is not there.
[[nodiscard]] TuningFile load_tuning();

/// The parameters that @p device is opened with.
/// @throws Error{kBadInput} as load_tuning().
[[nodiscard]] Tuning tuning_for(const DeviceInfo& device);

}  // namespace pirt::opencl
