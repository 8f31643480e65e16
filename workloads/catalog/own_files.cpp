#include "workloads/catalog/own_files.h"

#include "workloads/catalog/own_list.h"
#include "workloads/own/own.h"

namespace pirt {

std::vector<own::Definition> load_workloads(const std::filesystem::path& file) {
  auto definitions = own::load(file);
  std::vector<Workload> workloads;
  for (const own::Definition& each : definitions) workloads.push_back(own::to_workload(each));
  make_known(std::move(workloads));
  return definitions;
}

}  // namespace pirt
