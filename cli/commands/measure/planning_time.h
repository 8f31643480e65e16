// What scheduling itself takes, as a program's own time: for comparing two builds of the scheduler.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "workloads/base/time.h"

namespace pirt::cli {

/// Schedules mix table1-robot on platform `fake` in virtual time, over and over in turns of the
/// paper's modes for @p work.
/// @param after_each  Runs within what is timed, after each schedule; may be empty. It is given the
/// shortest time that the mode's schedule took before.
/// @return  Seconds a scheduled task by "schedule <mode>": medians.
[[nodiscard]] std::map<std::string, double> time_planning(
    const Clock& clock, Nanos work, const std::function<void(Nanos)>& after_each = {});

}  // namespace pirt::cli
