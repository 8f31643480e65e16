// What the coordinator asks of a worker process, and what the worker reports: the two records that
// cross the pipe.
//
// The job is one JSON document on the worker's standard input. The worker writes lines "pirt-record
// {...}" on its standard output; each holds everything that is known so far, so that the last
// complete line is the result, however the worker ended. Lines "pirt-progress TEXT" between them
// say that a device which is slow on this machine goes on. Other lines are a library's chatter.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/energy/metered_calls.h"
#include "characterize/machine/host_load.h"
#include "characterize/profile/condition.h"
#include "characterize/worker/measure.h"
#include "characterize/worker/peaks.h"
#include "workloads/model/backend.h"

namespace pirt {

enum class JobKind : std::uint8_t {
  kProbe,      ///< Is the backend there, and which device does the unit get?
  kReference,  ///< Compute the workload's reference into a file.
  kSetup,      ///< Time device_init and prepare.
  kSample,     ///< The same, then verify, time calls, verify.
  kMeter,      ///< The same, with energy meters around the calls in place of the clock.
  kPeaks,      ///< Measure the unit's limits.
  kDescribe,   ///< What workloads has the file `own`?
  kDevices,    ///< Is the backend there, and which devices has it?
};

struct Job {
  JobKind kind = JobKind::kProbe;
  std::string backend;
  UnitRequest unit;
  std::string workload;  ///< Not for kProbe, kPeaks, kDescribe and kDevices.
  /// The file of somebody else's that has it (workloads/own/own.h), which is loaded before anything
  /// else is done; empty = it is pirt's.
  std::string own;
  std::string own_digest;  ///< Of what that has to hold; empty = whatever it does.
  std::uint64_t seed = 1;
  std::string images;  ///< Path for images_from; empty = generated.
  std::string images_topic;
  std::string reference;  ///< File that kReference writes and kSample reads.
  /// File that kReference writes what is computed on to, unless that is large, and the others read
  /// if it is there; empty = none, each makes it.
  std::string inputs;
  /// Verify before timing as well as after it: a wrong computation is then not timed.
  bool verifies_first = true;
  SamplingOptions sampling;
  MeterRequest metering;  ///< For kMeter.
  /// The cores of each unit that shares the unit's memory, beside which calls are sampled as well.
  std::vector<std::vector<int>> neighbours = {};
};

/// Executions under another condition than kSteady.
struct ConditionSamples {
  Condition condition = Condition::kColdCache;
  PhaseSamples samples;
};

/// How the device that a worker opened accounts for one phase.
struct PhaseAccount {
  Phase phase = Phase::kCall;
  Accounting accounting;
};

struct JobResult {
  bool done = false;  ///< The worker did all that it was asked for.
  std::string step;   ///< What it was doing when the record was written: "opening the device".
  std::string error;  ///< Empty unless it failed.
  std::optional<DeviceInfo> device;
  Provenance provenance = Provenance::kMeasured;  ///< Of phases that `accounts` has not.
  std::vector<PhaseAccount> accounts;
  bool own_clock = false;  ///< The device has one, which tells the phases that are not measured.
  bool deterministic = false;  ///< Device::is_deterministic
  ClockQuality clock;          ///< That of phases that are measured.
  std::optional<Nanos> device_init, prepare;
  std::string verification;  ///< What the last comparison with the reference found; empty if none
                             ///< took place.
  bool wrong_output = false;
  Interference during_setup;       ///< From before the device was opened until it was prepared.
  Interference during_calls;       ///< While they were timed.
  std::vector<std::string> notes;  ///< Of the data: "input_resized", "sequence of 8 frames".
  /// Of a call, the mean over a sequence, where they are not the workload's own.
  std::optional<std::int64_t> ops, bytes;
  /// What the process has had at most for preparing and calling, and what the kernel has counted
  /// on its device; absent where nobody knows it.
  std::optional<std::int64_t> host_memory_bytes, device_memory_bytes;
  std::vector<PhaseSamples> phases;
  std::vector<ConditionSamples> conditions;
  std::optional<MeteredCalls> metered;
  std::vector<PeakFigure> peaks;
  std::string definitions;     ///< Of kDescribe: a list of own::to_json.
  std::optional<Probe> found;  ///< Of kDevices.

  /// Of a phase other than the call.
  [[nodiscard]] Accounting accounting(Phase phase) const;
  /// Of the call, and of preparing, which ends with one, the sum of its parts'.
  [[nodiscard]] Origin origin(Phase phase) const;
  /// Why nobody knows the time of @p phase; of the call, that of one of its phases.
  [[nodiscard]] std::string unknown(Phase phase) const;
  /// Whether `clock` told @p phase, or a part of it.
  [[nodiscard]] bool is_measured(Phase phase) const;
  /// Whether the figure of @p phase is the same in every call and every process.
  [[nodiscard]] bool repeats(Phase phase) const;
};

[[nodiscard]] std::string to_json(const Job& job);
/// @throws Error{kBadInput} if it is not a job of this version.
[[nodiscard]] Job job_from_json(const std::string& text);

/// One line without its end.
[[nodiscard]] std::string to_record(const JobResult& result);
/// A line that says that the worker goes on with @p what, so that its limit begins anew.
[[nodiscard]] std::string progress_record(const std::string& what);
/// The last complete one among the lines of @p output; empty if there is none.
[[nodiscard]] std::string last_progress(std::string_view output);
/// The last record among the lines of @p output; a result with nothing done if there is none.
/// @throws Error{kBadInput} if it is none of this version.
[[nodiscard]] JobResult last_record(std::string_view output);

}  // namespace pirt
