// One fresh process of one program, as `pirt sample` answers it: the time of each phase of a cell.
//
// This is what two versions of pirt have to agree on to be compared, so that it stays as it is: a
// newer version may add fields, and takes nothing away.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "characterize/platform/platform.h"
#include "characterize/worker/injection.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// A workload on a unit; "scheduler" on no unit stands for planning itself.
struct DuetCell {
  std::string workload, unit;
  friend auto operator<=>(const DuetCell&, const DuetCell&) = default;
};
inline constexpr std::string_view kSchedulerCell = "scheduler";
/// The cell of a comparison of any two commands, whose figures have names of their own.
inline constexpr std::string_view kCommandCell = "command";
/// "sobel on cpu", "scheduler".
[[nodiscard]] std::string to_string(const DuetCell& cell);

enum class SampleKind : std::uint8_t {
  kSetup,     ///< Set up, and time that alone.
  kTimed,     ///< Set up and repeat calls, all of it timed.
  kVerified,  ///< The same, compared with the reference; tells what was computed.
};

struct SampleRequest {
  DuetCell cell;
  SampleKind kind = SampleKind::kTimed;
  std::uint64_t seed = 1;
  Nanos work = std::chrono::milliseconds(50);  ///< That calls are repeated for, after warming up.
  Injection injection;
};

/// What a figure is in, where it is no time in seconds.
struct Measure {
  std::string unit;
  bool higher_is_better = false;
};

struct Sample {
  std::string version;        ///< Of the program.
  std::string device;         ///< Name; what is compared has to run on the same.
  std::string driver;         ///< Versions of libraries and drivers, which may be what changed.
  std::string inputs;         ///< Hash of what was computed on; only if kVerified.
  std::optional<bool> right;  ///< What verifying found, with `detail`.
  std::string detail;
  bool contended = false;
  /// By phase, medians of calls; of a command by the name of the figure, in what `measures` says.
  std::map<std::string, double> seconds;
  std::map<std::string, Measure> measures;  ///< Of those that are no seconds where less is better.
  /// Of a command's first process: contents of the files that the command names and leaves as they
  /// are, by path.
  std::map<std::string, std::string> files;
  double wall_s = 0;  ///< Of the process, from start to end; 0 = not known.
};

/// Sets up, runs and times a cell in this process, which must be fresh: set-up is timed too.
/// @throws Error{kBadInput}: no such workload or unit; Error{kEnvironment}: it cannot be done here.
[[nodiscard]] Sample take_sample(const Platform& platform, const SampleRequest& request);

[[nodiscard]] Json to_json(const Sample& sample);
/// @throws Error{kBadInput} if @p text is not what `pirt sample` prints.
[[nodiscard]] Sample sample_from_json(const std::string& text);

}  // namespace pirt
