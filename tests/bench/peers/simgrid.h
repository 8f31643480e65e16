// SimGrid S4U as a peer of virtual time: the same work in its terms. It allows one engine a
// process, so each call runs in a child.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace pirt::bench {

/// Units of SimGrid: hosts. Times in seconds of simulated time.
struct PeerStage {
  std::optional<std::size_t> unit;  ///< Absent = delay.
  double time_s = 0;
};

struct PeerUnit {
  int cores = 1;
  bool shared = false;  ///< Processor sharing; otherwise one job at a time, in order of arrival.
};

struct PeerTask {
  std::size_t unit = 0;  ///< That it is dispatched to, and completes on.
  std::vector<PeerStage> stages;
};

/// Tasks that start together: at time 0, or when a unit has completed its nth task.
struct PeerStart {
  std::optional<std::size_t> unit;
  std::size_t completions = 0;
  std::vector<std::size_t> tasks;
};

/// @return  By unit, when its tasks completed, in order; seconds.
/// @throws Error{kEnvironment} if the child fails.
[[nodiscard]] std::vector<std::vector<double>> simgrid_completions(
    const std::vector<PeerUnit>& units, const std::vector<PeerTask>& tasks,
    const std::vector<PeerStart>& starts);

struct PeerRun {
  double makespan_s = 0;  ///< Simulated.
  double elapsed_s = 0;   ///< Of the engine's run, without its set-up.
};

/// A closed loop of @p tasks equal tasks under Algorithm 2: one actor a unit executes what is
/// queued there, and a completion dispatches the next task to the first unit with room.
/// @param time_s    Service time by unit.
/// @param weights   Room by unit: queued and running.
[[nodiscard]] PeerRun simgrid_closed_loop(const std::vector<double>& time_s,
                                          const std::vector<int>& weights, std::int64_t tasks);

}  // namespace pirt::bench
