// What would spoil a measurement on this machine, and what to do about it.
//
// A check reads what the kernel says of itself and judges it; all files are found below a root, so
// that recorded machines can be judged as well. Address space randomization is not checked: several
// fresh processes sample each cell, so that it averages out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/doctor/jitter.h"
#include "characterize/energy/nvml.h"
#include "characterize/machine/environment.h"
#include "characterize/machine/host_load.h"
#include "characterize/platform/platform.h"
#include "workloads/model/backend.h"

namespace pirt {

enum class Level : std::uint8_t {
  kGood,     ///< As it should be.
  kUnknown,  ///< The machine does not say; why is in `found`.
  kNote,     ///< Figures are right, but mean less or come with less beside them.
  kSpoils,   ///< Figures would be wrong, or differ from run to run.
  kBlocks,   ///< Nothing can be measured.
};

/// "good", "unknown", "note", "spoils", "blocks".
[[nodiscard]] std::string_view to_string(Level level);

struct Finding {
  std::string check;  ///< "governor"
  Level level = Level::kGood;
  std::string found;   ///< "powersave on cores 0,1"
  std::string why;     ///< What it does to figures; empty if good.
  std::string remedy;  ///< The command or step; empty if good or if there is none.
};

/// Counters at one moment; absent where the machine does not count.
struct DoctorSnapshot {
  HostCounters host;                          ///< Of the usable cores.
  std::optional<std::int64_t> swapped_pages;  ///< Moved to and from swap since the start.
  std::optional<Nanos> memory_stall;          ///< Time that some task waited for memory.
};

/// A unit of the platform, as a worker process found it.
struct UnitProbe {
  std::string unit;
  std::string device;  ///< Empty if it could not be opened.
  std::string error;   ///< Why, with the remedy; empty if it could.
  std::vector<int> cores;
};

/// Free space where something will be written.
struct DiskSpace {
  std::string folder;
  std::optional<std::int64_t> free_bytes;  ///< Absent if the system does not say.
};

struct DoctorInput {
  std::filesystem::path root = "/";
  std::vector<int> cores;  ///< That pirt may use.
  DoctorSnapshot before;
  std::optional<DoctorSnapshot> after;          ///< Some time later; absent for a recorded machine.
  std::optional<Jitter> jitter;                 ///< Between the two; absent if nothing computed.
  Environment build;                            ///< build_environment().
  std::optional<std::vector<UnitProbe>> units;  ///< Absent if they were not probed.
  std::optional<std::vector<DeviceInfo>> devices;  ///< Of OpenCL; absent for a recorded machine.
  std::optional<NvmlFacts> nvml;                   ///< Likewise.
  std::vector<DiskSpace> disks;
  std::optional<Environment>
      inherited;            ///< inherited_environment(); absent for a recorded machine.
  std::string no_new_code;  ///< no_new_code() of where scratch files go.
  /// Whether a file may be read by this user.
  std::function<bool(const std::filesystem::path&)> readable;
};

[[nodiscard]] DoctorSnapshot read_doctor_snapshot(const std::vector<int>& cores,
                                                  const std::filesystem::path& root = "/");

/// The cores that a recorded machine has: those of its /sys, or of its /proc/cpuinfo.
[[nodiscard]] std::vector<int> recorded_cores(const std::filesystem::path& root);

/// Opens each measured unit of the platform in a worker process.
/// @param program  A pirt, started as `PROGRAM worker`.
/// @throws Error{kBadInput} if the platform has none; Error{kEnvironment} if no worker can be
/// started.
[[nodiscard]] std::vector<UnitProbe> probe_units(const Platform& platform,
                                                 const std::filesystem::path& program);

[[nodiscard]] DiskSpace free_space(const std::filesystem::path& folder);

/// What spoils what is about to be measured on input.cores: findings of kSpoils. They compute for
/// @p duration meanwhile, as `pirt doctor` has them do. What this process and the children that it
/// has waited for computed since input.before is no load.
/// @param input  Without `after` and `jitter`.
[[nodiscard]] std::vector<Finding> look_before_measuring(DoctorInput input, Nanos duration);
/// Those of kSpoils.
[[nodiscard]] std::vector<Finding> spoiling(std::vector<Finding> findings);

/// Every check's finding, in a fixed order.
[[nodiscard]] std::vector<Finding> diagnose(const DoctorInput& input);

/// kBlocks if nothing can be measured, kSpoils if some finding spoils, otherwise kGood.
[[nodiscard]] Level verdict(const std::vector<Finding>& findings);

}  // namespace pirt
