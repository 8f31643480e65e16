// What virtual time knows of a live task, and of what is to come; for the files of this room that
// make it up alone.
#pragma once

#include <compare>
#include <cstdint>
#include <stdexcept>

#include "scheduler/virtual/call_effects.h"
#include "scheduler/virtual/moments.h"
#include "scheduler/virtual/virtual_time.h"

namespace pirt {

struct VirtualTime::Job {
  TaskId id = 0;
  std::uint32_t plan = 0;
  UnitId unit = 0;
  std::uint32_t step = 0;   ///< Position in steps_.
  std::uint32_t tries = 0;  ///< Before this one.
  bool computing = false;   ///< By the executor.
  Nanos started_at{0};
  Nanos dispatched_at{0};
  Nanos takes{0};      ///< Server time of its step,
  Nanos powered{0};    ///< the part of it that draws the unit's active_w,
  double own_w = 0;    ///< and what it draws beside that, of the call's own joules.
  Nanos preparing{0};  ///< What this try has spent on it.
  Nanos handover{0};   ///< Until its first step on its unit; then zero.
  // Of a step with slices: all of it, and what follows the slice that is served.
  Nanos whole{0}, whole_powered{0}, rest{0};
  std::uint32_t slice = 0;
  // Of a task that was suspended between two slices.
  bool suspended = false;  ///< It is,
  Nanos suspended_at{0};   ///< since then,
  Nanos paused{0};         ///< and was before for so long.
  CallEffects::Rest effects = {};

  /// The task is submitted. What else is here is set where it comes to that.
  void begin(TaskId task, std::uint32_t its_plan) {
    id = task;
    plan = its_plan;
    tries = 0;
    computing = suspended = false;
  }
};

struct VirtualTime::Timer {
  Moment moment;
  TimerKind kind = TimerKind::kFires;
  std::uint32_t index = 0;  ///< Of the pipeline, the job or the draw.
  friend auto operator<=>(const Timer&, const Timer&) = default;
};

/// What the dispatcher refuses here would be this driver's mistake.
inline void must(bool taken) {
  if (!taken) throw std::logic_error("the dispatcher refused an input of virtual time");
}

}  // namespace pirt
