#include "workloads/catalog/specs.h"

#include <algorithm>
#include <iterator>

#include "workloads/catalog/workload_list.h"
#include "workloads/dnn/dnn.h"
#include "workloads/mapping/specs.h"
#include "workloads/model/host_function.h"
#include "workloads/model/own_operation.h"
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

std::vector<double> slices_of(const Workload& workload) {
  if (const OwnOperation* const own = own_operation(workload)) return own->slices;
  const auto* function = dynamic_cast<const HostFunction*>(workload.operation.get());
  return function != nullptr ? function->slices : dnn::slices_of(workload);
}

WorkloadSpec spec_of(const Workload& workload) {
  return {.name = workload.name,
          .inputs = workload.inputs,
          .outputs = workload.outputs,
          .state = workload.state,
          .ops = workload.ops,
          .bytes = workload.bytes(),
          .slices = slices_of(workload)};
}

}  // namespace

std::vector<std::string> workload_names() { return all_specs().names(); }

std::optional<WorkloadSpec> try_find_spec(std::string_view name) {
  const Workload* workload = all_specs().try_find(name);
  return workload == nullptr ? std::nullopt : std::optional(spec_of(*workload));
}

std::vector<std::string> files_of(const std::vector<std::string>& names) {
  std::vector<std::string> files;
  for (const std::string& name : names) {
    const Workload* const workload = all_specs().try_find(name);
    const OwnOperation* const own = workload == nullptr ? nullptr : own_operation(*workload);
    if (own == nullptr || std::ranges::find(files, own->source) != files.end()) continue;
    files.push_back(own->source);
  }
  return files;
}

bool is_foreign(std::string_view name) {
  const auto dot = name.find('.');
  return dot != std::string_view::npos && dot > 0 && dot + 1 < name.size();
}

WorkloadSpec find_spec(const std::string& name) {
  static const std::vector<TensorSpec> no_tensors;
  static const std::optional<StateSpec> no_state;
  if (const Workload* const known = all_specs().try_find(name)) return spec_of(*known);
  if (is_foreign(name)) {
    return {.name = name,
            .inputs = no_tensors,
            .outputs = no_tensors,
            .state = no_state,
            .ops = std::nullopt,
            .bytes = 0};
  }
  return spec_of(all_specs().find(name));
}

}  // namespace pirt
