// Tasks as the dispatcher and the policies see them: numbers and tags, no names and no durations.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// Given out by the dispatcher: a slot below, which is used again once nobody may name the task any
/// more, and above how often it was. Those of two tasks are never the same.
using TaskId = std::uint64_t;
using FiringId = std::uint64_t;  ///< Likewise.
inline constexpr TaskId kNoTask = ~TaskId{0};
[[nodiscard]] constexpr std::uint32_t slot_of(std::uint64_t id) {
  return static_cast<std::uint32_t>(id);
}
using UnitId = std::uint32_t;      ///< Position in Platform::units.
using WorkloadId = std::uint32_t;  ///< Position in the workloads of a run.
using StateId = std::uint32_t;     ///< Position in the states of a run; below kMaxStates.
/// The tasks of one place in a pipeline, firing after firing: position among those of a run that a
/// later firing may read; below kMaxSeries.
using SeriesId = std::uint32_t;
inline constexpr std::uint32_t kMaxStates = 1U << 20;
inline constexpr std::uint32_t kMaxSeries = 1U << 20;

/// A set of units, bit u for unit u.
using UnitMask = std::uint64_t;
inline constexpr std::size_t kMaxUnits = 64;
[[nodiscard]] constexpr UnitMask unit_bit(UnitId unit) { return UnitMask{1} << unit; }
[[nodiscard]] constexpr bool contains(UnitMask mask, UnitId unit) {
  return (mask & unit_bit(unit)) != 0;
}

/// The units that something holds of, by their position in a list of them.
/// @param is  bool(element).
template <typename Range, typename Is>
[[nodiscard]] UnitMask units_where(const Range& units, const Is& is) {
  UnitMask mask = 0;
  UnitId unit = 0;
  for (const auto& each : units) {
    if (std::invoke(is, each)) mask |= unit_bit(unit);
    ++unit;
  }
  return mask;
}

/// The unit of @p mask that is better than all before it; ties: the first. Absent if it is empty.
/// @param better  bool(UnitId a, UnitId b): whether @p a is better than @p b.
template <typename Better>
[[nodiscard]] std::optional<UnitId> first_best(UnitMask mask, const Better& better) {
  std::optional<UnitId> best;
  for (; mask != 0; mask &= mask - 1) {
    const auto unit = static_cast<UnitId>(std::countr_zero(mask));
    if (!best || better(unit, *best)) best = unit;
  }
  return best;
}

/// What a policy may look at. Tasks of one class are placed, and refused, alike.
struct TaskClass {
  WorkloadId workload = 0;
  UnitMask eligible = 0;  ///< Units that can serve the workload and are permitted to.
  bool real_time = true;
  bool image_input = false;
  std::uint32_t entry = 0;  ///< Of the plan, where the mode follows one; 0 otherwise.
  friend bool operator==(const TaskClass&, const TaskClass&) = default;
};

/// A task that has not completed on one of these units by then is taken back from there, wherever
/// it stands, and placed on the others: its latest safe start.
struct Recall {
  Nanos at{0};
  UnitMask from = 0;
};

struct Task {
  TaskClass kind;
  /// When it should be complete; for policies that look at it.
  std::optional<Nanos> deadline = {};
  /// Not started by then: expired, and its successors dropped.
  std::optional<Nanos> expires_at = {};
  std::optional<Recall> recall = {};
  /// Tasks of earlier submissions that have to complete first. One that is not known counts as
  /// complete; one that ended otherwise drops this task, as does kNoTask.
  std::span<const TaskId> after = {};
  /// The same of this submission: positions before the task's own.
  std::span<const std::uint32_t> after_own = {};
  /// What it holds while it runs. Tasks get a state one at a time, in the order in which they were
  /// submitted; one that ends in another way than by completing stops nobody behind it.
  std::optional<StateId> state = {};
  /// Of which it is the next; a later firing may read what it makes.
  std::optional<SeriesId> series = {};
  /// Of each it reads the newest task that was submitted before and completes: `@-1` in a mix. It
  /// waits until that is known; where there is none, it is dropped as kNoPredecessor.
  std::span<const SeriesId> reads = {};
};

enum class Outcome : std::uint8_t {
  kCompleted,
  kFailed,
  /// The unit could not, and gives the task back: it is placed anew on the others, kMostTries times
  /// at most in all. Where no other may take it, it has failed.
  kReturned,
};
/// How often a task is started.
inline constexpr int kMostTries = 3;

enum class UnitState : std::uint8_t {
  kUp,
  kDraining,  ///< Starts nothing new; what waits for it goes elsewhere; what runs completes.
  kGone,      ///< As draining, for good: tasks that no other unit can take have failed.
};

/// A task that may start now.
struct Start {
  TaskId task = 0;
  UnitId unit = 0;
  Nanos dispatched_at{0};  ///< When it was given to the unit's queue: latency counts from here.
  Nanos ready_at{0};       ///< When its predecessors were complete: waiting counts from here.
  /// In the place of a task of the unit that has been suspended between two slices: where that
  /// runs, before it is resumed.
  bool let_in = false;
};

/// How a task ended, for good; what a unit says of one try is an Outcome.
enum class TaskEnd : std::uint8_t {
  kCompleted,
  kFailed,         ///< Its kernel threw, or there is no unit any more that could take it.
  kDropped,        ///< A task that it comes after did not complete.
  kExpired,        ///< It had not started in time.
  kCancelled,      ///< By whoever submitted it; the dispatcher says kDropped.
  kNoPredecessor,  ///< Dropped: no earlier firing made what it reads, or what it comes after.
};
inline constexpr std::array<std::string_view, 6> kTaskEnds = {
    "completed", "failed", "dropped", "expired", "cancelled", "no_predecessor"};
[[nodiscard]] constexpr std::string_view to_string(TaskEnd end) {
  return kTaskEnds[static_cast<std::size_t>(end)];
}

/// A task that ended otherwise than by its unit's word just now.
struct Ended {
  TaskId task = 0;
  TaskEnd how = TaskEnd::kDropped;
  friend bool operator==(const Ended&, const Ended&) = default;
};

/// A task that runs and is wanted back from its unit: whoever drives the unit completes it there as
/// kReturned, unless it has ended otherwise by then.
struct Recalled {
  TaskId task = 0;
  UnitId unit = 0;
};

/// A task that is suspended between two slices, or resumed.
struct Sliced {
  TaskId task = 0;
  UnitId unit = 0;
  friend bool operator==(const Sliced&, const Sliced&) = default;
};

/// What a call of the dispatcher brought about; calls append.
struct Effects {
  std::vector<TaskId> submitted;  ///< In the order in which they were given.
  std::vector<Start> started;
  std::vector<Ended> ended;
  std::vector<Recalled> recalled;
  std::vector<Sliced> suspended;  ///< It keeps its unit; what starts there comes first.
  std::vector<Sliced> resumed;    ///< The last one of its unit that was suspended.
  [[nodiscard]] bool empty() const {
    return started.empty() && ended.empty() && recalled.empty() && suspended.empty() &&
           resumed.empty();
  }
  void clear() {
    submitted.clear();
    started.clear();
    ended.clear();
    recalled.clear();
    suspended.clear();
    resumed.clear();
  }
};

/// submitted = completed + dropped + expired + failed + queued, always.
struct TaskCounts {
  std::int64_t submitted = 0;
  std::int64_t completed = 0;
  std::int64_t dropped = 0;
  std::int64_t expired = 0;
  std::int64_t failed = 0;
  std::int64_t no_predecessor = 0;  ///< Of `dropped`.
  std::int64_t returned = 0;        ///< How often a task was given back.
  std::int64_t suspended = 0;       ///< How often one was, between two slices.
  [[nodiscard]] std::int64_t queued() const {
    return submitted - completed - dropped - expired - failed;
  }
};

}  // namespace pirt
