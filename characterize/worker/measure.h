// Timing the phases of prepared kernels, in one process: batches, warm-up, when to stop.
//
// A sample is one call, or a batch's time over its calls where one call is so short that the clock
// would show. Knows nothing of processes, files or validity; see worker.h, cell.h.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "workloads/base/time.h"
#include "workloads/model/backend.h"
#include "workloads/model/phase.h"

namespace pirt {

/// What reading a clock costs and how finely it counts. A simulated clock costs nothing and counts
/// single nanoseconds.
struct ClockQuality {
  double cost_ns = 0;
  Nanos resolution{1};

  /// By so much an interval may be off.
  [[nodiscard]] double doubt_ns() const {
    return std::max(cost_ns, static_cast<double>(resolution.count()));
  }
};

/// Median cost of a reading over 21 rounds of 500, and the smallest step seen. Takes less than a
/// millisecond on a usual machine; where most rounds see no step (a clock of 4 or 10 ms), until two
/// were seen. The cost is never 0, which is a simulated clock's.
[[nodiscard]] ClockQuality measure_clock(const Clock& clock);

/// What one process samples. It does not look at the precision: that is a matter of several
/// processes (cell.h).
struct SamplingOptions {
  Nanos warm_up = std::chrono::milliseconds(30);  ///< At least this long and warm_up_calls; on a
                                                  ///< simulated clock at most 1000 calls.
  Nanos slice = std::chrono::milliseconds(120);   ///< At least this long and min_samples.
  Nanos limit = std::chrono::seconds(60);  ///< Of the machine's time; ends sampling whatever there
                                           ///< is.
  std::int64_t warm_up_calls = 2;          ///< At least.
  std::int64_t min_samples = 5;
  std::int64_t max_samples = 1'000;
  /// Besides, executions under each other condition (condition.h); 0 = none.
  std::int64_t condition_samples = 0;
  bool cold_memory = false;  ///< That of kColdMemory, too, which takes the longest.
};

/// Samples of one phase, with what else is needed to judge them.
struct PhaseSamples {
  Phase phase = Phase::kCall;
  std::vector<Nanos> samples;  ///< A call each.
  std::int64_t batch = 1;      ///< Calls between two readings of the clock.
  /// The median of what the calls say that the phase takes at least; absent where they do not.
  std::optional<Nanos> bound = {};
  /// The processor time of each sample's call; empty where PhaseClocks::processor is null, and of
  /// phases that are not timed as calls.
  std::vector<Nanos> cpu = {};
  /// Besides, executions whose stamps of the device say that launching took longer than all of it:
  /// they are no samples of launch and execute.
  std::int64_t odd_stamps = 0;
};

/// Processor time of this process, all threads.
class ProcessorClock : public Clock {
 public:
  [[nodiscard]] Nanos now() const override;
};

/// Which clock tells the time of which phase.
struct PhaseClocks {
  const Clock& clock;  ///< The device's own, or the machine's.
  ClockQuality quality;
  /// The machine's, which limits go by; null = `clock`.
  const Clock* machine = nullptr;
  ClockQuality machine_quality = {};
  std::set<Phase> measured = {};  ///< Beside an own clock: those that the machine's clock tells.
  std::set<Phase> unknown = {};   ///< Those that nobody knows the time of; then there is no call.
  const Clock* processor = nullptr;  ///< Of calls on the host's cores, beside their time.
  /// After each sample, and each call before the first, with how many there are; may be empty.
  std::function<void(std::int64_t)> on_sample = {};

  [[nodiscard]] bool is_measured(Phase phase) const { return measured.contains(phase); }
};

/// How the calls of a played sequence follow each other; by default one call is repeated.
struct PlayedCalls {
  /// Between two samples, and not timed: the kernel was called, and is to be bound to the next
  /// frame.
  std::function<void()> next;
  std::int64_t frames = 1;
};

/// Times @p kernel, which is bound, prepared and right, for options.slice. Afterwards the outputs
/// are those of a timed call. Of a sequence each frame has as many samples, unless options.limit or
/// max_samples ended it; the calls of a batch are all on one frame and commit no state, and are no
/// more than the clock's cost asks for.
///
/// @param clocks   The slice is one of `clock`, so that simulated devices repeat exactly, unless
/// the machine's says that it took 40 times as long.
/// @param phases   What the backend's calls have; other phases get no samples. `launch` comes from
/// the device's stamps, and `execute` is
///                 the wall time of one execution without it.
/// @return One entry for each per-call phase that was found, in the order of @p phases. On a
/// simulated clock a phase that takes no time at
///         all does not exist. A call that several clocks tell is the sum of its phases.
/// @throws Error{kEnvironment} if more than half of the device's stamps contradict the clock;
/// whatever the kernel throws.
[[nodiscard]] std::vector<PhaseSamples> sample_calls(Kernel& kernel, const PhaseClocks& clocks,
                                                     std::span<const Phase> phases,
                                                     const SamplingOptions& options,
                                                     const PlayedCalls& sequence = {});
/// The same where one clock tells all.
[[nodiscard]] std::vector<PhaseSamples> sample_calls(Kernel& kernel, const Clock& clock,
                                                     const ClockQuality& quality,
                                                     std::span<const Phase> phases,
                                                     const SamplingOptions& options,
                                                     const PlayedCalls& sequence = {});

/// Times @p samples executions of @p kernel, each a call of its own after @p before, which runs
/// once the inputs are there and is not timed; of a sequence one a frame.
[[nodiscard]] PhaseSamples sample_executions(Kernel& kernel, const Clock& clock,
                                             std::int64_t samples,
                                             const std::function<void()>& before,
                                             const PlayedCalls& sequence = {});

/// Calls a batch so that it takes 1 ms or more, and so much that a slow or coarse clock does not
/// show (is_clock_bound): 1 for calls of at least that, at most 100000.
[[nodiscard]] std::int64_t batch_size(Nanos one_call, const ClockQuality& quality = {});

/// Whether the larger of the clock's cost and step is more than 1 % of the interval between the two
/// readings behind a typical sample; never of a simulated clock.
[[nodiscard]] bool is_clock_bound(Nanos median_sample, std::int64_t batch,
                                  const ClockQuality& quality);

}  // namespace pirt
