// Who follows a run: a trace, in virtual time and live.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "scheduler/mix/task.h"
#include "workloads/base/time.h"

namespace pirt {

/// Hears of what a run does beyond what its dispatcher is asked. Must not throw.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  /// The dispatcher has taken the task; nothing has been done yet that follows from that.
  virtual void submitted(TaskId /*task*/, std::size_t /*pipeline*/, std::size_t /*position*/,
                         std::uint64_t /*firing*/) {}
  /// A step arrives at, and departs from, the servers of a unit, or of a link.
  /// @param servers_index  Units in order, then links.
  /// @param job      Unique among those that have arrived and not departed.
  /// @param power_w  Drawn while a server works on it at full rate.
  virtual void arrived(std::size_t servers_index, std::uint32_t job, double power_w) = 0;
  virtual void departed(std::size_t servers_index, std::uint32_t job) = 0;
  /// One that has arrived draws so much from now on while a server works on it.
  virtual void draws(std::size_t /*servers_index*/, std::uint32_t /*job*/, double /*power_w*/) {}
  /// Beside what its servers do, the unit or link draws so much more from now on, or less.
  virtual void drawing(std::size_t /*servers_index*/, double /*by_w*/) {}
  /// The unit of @p task, which it has begun, prepares its kernel from @p now on, which takes that
  /// long: a unit with contexts that holds another, or a live one that has not prepared it before.
  virtual void preparing(TaskId /*task*/, Nanos /*now*/, Nanos /*takes*/) {}
  /// All that happens at once at this moment has happened; more may follow at the same time.
  /// @param waiting  Tasks that wait: by unit those in its queue, then those that are in none.
  virtual void settled(Nanos now, std::span<const int> waiting) = 0;
};

}  // namespace pirt
