// A mix run live: the dispatcher, the firings and the models of virtual time, driven by the
// machine's clock and by threads that compute.
//
// Units that have a backend run real kernels, each on a thread of its own, on data that travels
// along the ports of the mix; inputs that no port feeds are made by the workload from the seed, the
// same for each firing of a sequence. Units that have none are paced: their stages pass through the
// servers of virtual time when the clock says so, and make no data; who takes some of theirs gets
// the workload's own instead.
//
// Threads: all that decides is behind one mutex. A unit's thread that ends a call says so to the
// dispatcher itself and goes on with what it is handed; the calling thread fires pipelines and
// paces units.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scheduler/dispatcher/dispatcher.h"
#include "scheduler/record/tally.h"
#include "scheduler/runtime/kernel_unit.h"
#include "scheduler/services/scenario.h"
#include "scheduler/virtual/virtual_time.h"

namespace pirt {

/// Outputs of a task that completed. Called behind the run's mutex: it must be quick, and not call
/// the run.
using OutputSink =
    std::function<void(const Firings::TaskPlace& place, std::span<const Tensor> outputs)>;

/// Single calls that completed, of each workload on each unit that computes; of many, some
/// thousands that are evenly spread over the run.
struct LiveCalls {
  struct Unit {
    std::string unit;
    DeviceInfo device;
  };
  struct Series {
    std::string workload, unit;
    std::vector<CallTimes> calls;
  };
  std::vector<Unit> units;
  std::vector<Series> series;
};

struct LiveOptions {
  /// Devices are opened and kernels prepared before the first firing; otherwise kernels are
  /// prepared by the first task that needs them.
  bool prepare_first = true;
  /// Of each call; a unit whose call takes longer is out of service from then on. Absent = by what
  /// the call is expected to take, see time_limit.h.
  std::optional<Nanos> time_limit = {};
  /// How often somebody wanted the run to stop: once, nothing fires any more and what has fired is
  /// finished; twice, nothing more is waited for but the calls that units have. Empty = never.
  std::function<int()> stop = {};
  OutputSink sink;                                   ///< Empty = nobody takes them.
  std::function<void(LiveCalls)> calls;              ///< At the end; empty = nobody wants them.
  std::function<void(const std::string&)> progress;  ///< One line; empty = nobody reads it.
};

struct LiveResult {
  Tally tally;
  Nanos set_up{0};                    ///< Until the first firing.
  std::optional<Nanos> first_call;    ///< Of the first computed task that completed.
  std::vector<std::string> problems;  ///< Calls that failed, by name; the first few.
  std::int64_t failed_calls = 0;
  bool stopped = false;  ///< Before its time, by LiveOptions::stop.
  /// Units that tell time by a clock of their own: here it is the machine's.
  std::vector<std::string> own_clocks;
  /// By unit that computes elsewhere: the way there at the end of the run.
  std::map<std::string, LinkEstimate> links;
  std::vector<std::string> out_of_reach;  ///< Those of them that were, then.
};

/// @param observer  Null = none; called behind the mutex.
/// @throws Error{kEnvironment} if a device cannot be opened or a kernel not be prepared.
[[nodiscard]] LiveResult run_live(const Scenario& scenario, Dispatcher& dispatcher,
                                  const LiveOptions& options, RunObserver* observer = nullptr);

}  // namespace pirt
