// Measuring one workload on one unit through worker processes, and judging what came back.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "characterize/database.h"
#include "characterize/job_runner.h"
#include "characterize/platform.h"
#include "workloads/backend.h"
#include "workloads/workload.h"

namespace pirt {

struct CellRequest {
  const Platform& platform;
  const UnitModel& unit;
  const Backend& backend;
  const Workload& workload;
  Job job;  ///< Everything but its kind.
  Provenance provenance =
      Provenance::kMeasured;  ///< Of rows whose worker did not get as far as opening the device.
  int setup_repeats = 2;      ///< Cold ones, and as many warm ones.
  std::filesystem::path
      scratch;  ///< Folder for kernel caches; what is made in it is removed again.
  std::function<void(std::string_view step)> on_step;  ///< "cold set-up 1/2"; never empty.
};

/// Cold set-ups (fresh process, empty kernel cache), warm ones (the cache filled), then sampling,
/// which is repeated once if its first and second half differ. The first failure ends the cell: its
/// rows say why.
/// @return Nothing if the runner was stopped.
[[nodiscard]] std::optional<CellRecord> measure_cell(const CellRequest& request,
                                                     const JobRunner& runner);

/// The record of a cell that could not be measured at all: every row of the backend's phases,
/// without samples.
[[nodiscard]] CellRecord failed_cell(const CellRequest& request, const std::string& error);

}  // namespace pirt
