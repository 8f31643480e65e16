// `pirt tune`: the parameters of a platform's OpenCL units, searched on the devices at hand through
// worker processes, one at a time. A driver that crashes or hangs costs one candidate.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/platform/selection.h"
#include "characterize/tune/search.h"
#include "characterize/worker/job.h"
#include "workloads/model/backend.h"

namespace pirt {

struct TuneOptions {
  Platform platform;
  std::vector<std::string> units;  ///< Empty = all with backend opencl.
  std::string filter;              ///< Of the workloads that parameters are judged by; empty = all.
  Nanos max_time = std::chrono::minutes(15);  ///< After that nothing more is measured.
  std::uint64_t seed = 1;                     ///< Of inputs, weights and the order of measuring.
  std::filesystem::path output;               ///< The file of tuned parameters; need not exist.
  std::filesystem::path program = "/proc/self/exe";  ///< Started as `PROGRAM worker`.
  Nanos job_limit = std::chrono::seconds(60);        ///< A process that takes longer is killed.
  const std::atomic<bool>* stop = nullptr;           ///< Set it to end the search; may be null.
};

/// What will be searched on one unit.
struct TuneUnit {
  const UnitModel* unit = nullptr;  ///< Of the options' platform.
  DeviceInfo device;
  opencl::Tuning start{true};  ///< What is stored for the device, or the defaults.
  std::vector<TuneStep> steps;
  std::vector<std::string> remarks;  ///< Why a parameter has no step.
};

struct TunePlan {
  std::vector<TuneUnit> units;
  std::vector<Skip> skipped;
};

struct TunedUnit {
  std::string unit;
  DeviceInfo device;
  TuneOutcome outcome;
  std::vector<std::string> remarks;
};

/// Checks all arguments, among them the file at options.output, and probes each unit.
/// @throws Error{kBadInput} if an argument is malformed; Error{kEnvironment} if a unit that was
/// named is not available, or none is.
[[nodiscard]] TunePlan plan_tuning(const TuneOptions& options);

/// Processes that a plan takes at most, confirmations and what is looked at again excluded.
[[nodiscard]] std::int64_t expected_processes(const TuneUnit& unit, const TuneRules& rules);

/// What a choice of parameters is judged by: the median of launch and execute together. Absent
/// where it has no times above 0.
[[nodiscard]] std::optional<Nanos> time_of(const JobResult& result);

/// Searches one unit's parameters. Reads and writes nothing of the user's.
/// @param progress  "conv_pixels=8, conv2, round 1"
/// @param time_up   Whether to measure nothing more.
[[nodiscard]] TunedUnit tune_unit(const TuneOptions& options, const TuneUnit& unit,
                                  const std::function<void(const std::string&)>& progress,
                                  const std::function<bool()>& time_up);

/// Puts what was found into the file at options.output, whole or not at all, beside what it has of
/// other devices and parameters.
/// @param date  ISO 8601, UTC.
/// @throws Error{kBadInput} if it cannot be written.
void store_tuning(const TuneOptions& options, const TunedUnit& tuned, const std::string& date);

/// Makes the folder of options.output, so that a place that cannot be written to is known before
/// anything is measured.
/// @throws Error{kBadInput} naming the path and the system's reason.
void check_output(const std::filesystem::path& output);

}  // namespace pirt
