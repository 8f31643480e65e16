// What the workloads of the catalog take and make, for whoever computes none of them: a scheduler
// in virtual time needs no library that does.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "workloads/model/tensor.h"
#include "workloads/model/workload.h"

namespace pirt {

/// As Workload; refers to what stays to the end of the process, or, of a foreign workload, to the
/// name that it was asked for with.
struct WorkloadSpec {
  const std::string& name;
  const std::vector<TensorSpec>& inputs;
  const std::vector<TensorSpec>& outputs;
  const std::optional<StateSpec>& state;
  std::optional<std::int64_t> ops;
  std::int64_t bytes = 0;
  /// The parts of a call, of usual data, after each of which but the last it can be left
  /// (model/slices.h), as shares of its time; empty = it cannot.
  std::vector<double> slices = {};
};

/// Whether anybody here knows what a call takes and makes; false of a foreign workload of which
/// nobody has said it.
[[nodiscard]] inline bool moves_tensors(const WorkloadSpec& workload) {
  return !workload.inputs.empty() || !workload.outputs.empty();
}

/// In the catalog's order, without variants and batches.
[[nodiscard]] std::vector<std::string> workload_names();
/// Of the catalog, a variant or a batch; absent if there is none of that name.
[[nodiscard]] std::optional<WorkloadSpec> try_find_spec(std::string_view name);
/// Whether @p name is of something that is not pirt's, "ncnn.alexnet", "mine.sobel": what it takes
/// and makes is known here once somebody has said so (own_list.h). Names of the catalog have no
/// '.'.
[[nodiscard]] bool is_foreign(std::string_view name);
/// The file that somebody else's workloads come from, for `--workloads`, each once.
[[nodiscard]] std::vector<std::string> files_of(const std::vector<std::string>& names);
/// As try_find_spec, or that of a foreign workload of which nothing is known, nor of this size of
/// it, which has neither inputs nor outputs.
/// @throws Error{kBadInput} with the nearest names, or that there are no other sizes.
[[nodiscard]] WorkloadSpec find_spec(const std::string& name);
WorkloadSpec find_spec(std::string&& name) = delete;

}  // namespace pirt
