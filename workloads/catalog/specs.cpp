#include "workloads/catalog/specs.h"

#include <algorithm>
#include <iterator>

#include "workloads/catalog/workload_list.h"
#include "workloads/mapping/specs.h"
#include "workloads/planning/specs.h"
#include "workloads/recognition/specs.h"
#include "workloads/slam/workload/specs.h"

namespace pirt {
namespace {

std::vector<Workload> others() {
  auto all = slam::specs();
  std::ranges::move(planning::specs(), std::back_inserter(all));
  std::ranges::move(mapping::specs(), std::back_inserter(all));
  std::ranges::move(recognition::specs(), std::back_inserter(all));
  return all;
}

const WorkloadList& all_specs() {
  static const auto& all = *new WorkloadList(others());  // Never destroyed, as in catalog.cpp.
  return all;
}

WorkloadSpec spec_of(const Workload& workload) {
  return {.name = workload.name,
          .inputs = workload.inputs,
          .outputs = workload.outputs,
          .state = workload.state,
          .ops = workload.ops,
          .bytes = workload.bytes()};
}

}  // namespace

std::vector<std::string> workload_names() { return all_specs().names(); }

std::optional<WorkloadSpec> try_find_spec(std::string_view name) {
  const Workload* workload = all_specs().try_find(name);
  return workload == nullptr ? std::nullopt : std::optional(spec_of(*workload));
}

WorkloadSpec find_spec(std::string_view name) { return spec_of(all_specs().find(name)); }

}  // namespace pirt
