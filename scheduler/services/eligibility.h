// Which units may serve which task of a mix, and the errors for those that nobody can serve.
#pragma once

#include <string>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/mix/mix.h"
#include "scheduler/mix/task.h"

namespace pirt {

/// The workloads of the mix, each once, in order of first appearance: the position is the
/// WorkloadId.
[[nodiscard]] std::vector<std::string> workloads_of(const Mix& mix);

/// Which tasks a mode may give to the cloud.
enum class CloudUse : std::uint8_t { kNone, kNotRealTime, kAll };

[[nodiscard]] UnitMask cloud_units(const Platform& platform);

/// "mix m: pipelines.p: task", for messages.
[[nodiscard]] std::string task_name(const Mix& mix, const Pipeline& pipeline, const MixTask& task);
/// What measures the workloads into @p database, with the files of those that are not pirt's; for
/// messages.
/// @param unit  Empty = all.
[[nodiscard]] std::string measure_command(const Platform& platform, const std::string& unit,
                                          const std::vector<std::string>& workloads,
                                          const std::string& database);
/// "cpu, gpu", for messages.
[[nodiscard]] std::string unit_list(const Platform& platform, UnitMask mask);

}  // namespace pirt
