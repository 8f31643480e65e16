// Runs jobs in worker processes, one at a time, and turns however they end into a JobResult.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/worker/job.h"

namespace pirt {

class JobRunner {
 public:
  /// @param program  A pirt: it is started with the one argument `worker`.
  /// @param limit    What a job may take before it is killed, without a sign of a slow device going
  ///                 on; a reference for each of its images.
  /// @param stop     Ends the running job and all later ones when set; may be null.
  /// @param over     Asked before each job, which does not begin if it says so; may be empty.
  JobRunner(std::filesystem::path program, Nanos limit, const std::atomic<bool>* stop,
            std::function<bool()> over = {})
      : program_(std::move(program)), limit_(limit), stop_(stop), over_(std::move(over)) {}

  /// @param environment  Variables on top of this process' own.
  /// @param on_progress  Told what a worker whose device is slow on this machine does; the limit
  ///                     begins anew each time. May be empty.
  /// @return Nothing if stopped or not begun. Otherwise a result that is done, or has an error:
  /// what the worker said, or how it died ("worker crashed
  ///         (SIGABRT) while sampling: last words"), in one line.
  /// @throws Error{kEnvironment} if no process can be started.
  [[nodiscard]] std::optional<JobResult> run(
      const Job& job, const std::vector<std::pair<std::string, std::string>>& environment = {},
      const std::function<void(std::string_view)>& on_progress = {}) const;

 private:
  std::filesystem::path program_;
  Nanos limit_;
  const std::atomic<bool>* stop_;
  std::function<bool()> over_;
};

/// Makes known what workloads are in a module or a workload file, which a process of its own loads:
/// here they are specs, which compute nothing.
/// @throws Error{kBadInput} with what that process says of the file; as probe_unit.
void learn_workloads(const JobRunner& runner, const std::filesystem::path& file);

/// Which devices the backend has, asked in a process of its own: a driver that ends whoever asks,
/// or never answers, is the reason why it is not available.
/// @param program  As JobRunner's.
/// @throws Error{kEnvironment} if no process can be started.
[[nodiscard]] Probe probe_backend(const std::filesystem::path& program, const Backend& backend);

/// Opens the unit's device, in a process of its own: which it is, or the error.
/// @throws Error{kEnvironment} if stopped, or as JobRunner::run.
[[nodiscard]] JobResult probe_unit(
    const JobRunner& runner, const Platform& platform, const UnitModel& unit,
    const std::vector<std::pair<std::string, std::string>>& environment = {});

}  // namespace pirt
