// Which programs of this machine answer this process: what they compute for it is part of what it
// measures, and no other's load.
#pragma once

#include <filesystem>
#include <map>
#include <set>

#include "workloads/base/time.h"

namespace pirt {

struct ProcessTime {
  int parent = 0;
  Nanos used{0};  ///< Of all its threads, in the kernel's ticks; without its children.
};
/// By process id: all that /proc shows.
using ProcessTimes = std::map<int, ProcessTime>;

/// @param root  Where /proc is found; another folder in tests.
[[nodiscard]] ProcessTimes read_process_times(const std::filesystem::path& root = "/");

/// Who is at the other end of this process' TCP connections, who else is connected to the same, and
/// what these have started: a server, its workers, and what computes for them. Programs of another
/// user's are not found, unless this one is root's.
/// @source proc_net(5), proc_pid_fd(5), proc_pid_stat(5).
[[nodiscard]] std::set<int> answering_processes(const ProcessTimes& all,
                                                const std::filesystem::path& root = "/");

/// What those of @p which used from @p before to @p after; of one that began meanwhile, all.
[[nodiscard]] Nanos used_by(const std::set<int>& which, const ProcessTimes& before,
                            const ProcessTimes& after);

}  // namespace pirt
