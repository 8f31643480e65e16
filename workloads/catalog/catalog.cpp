#include "workloads/catalog/catalog.h"

#include <algorithm>
#include <iterator>

#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/workload_list.h"
#include "workloads/mapping/workloads.h"
#include "workloads/planning/workloads.h"
#include "workloads/recognition/workloads.h"
#include "workloads/slam/workload/workloads.h"

namespace pirt {
namespace {

std::vector<Workload> others() {
  auto all = slam::all();
  std::ranges::move(planning::all(), std::back_inserter(all));
  std::ranges::move(mapping::all(), std::back_inserter(all));
  std::ranges::move(recognition::all(), std::back_inserter(all));
  return all;
}

const WorkloadList& all_workloads() {
  // Never destroyed: a unit that hangs may still compute one of them while the process ends.
  static const auto& all = *new WorkloadList(others());
  return all;
}

}  // namespace

std::vector<const Workload*> workloads_in_variant(std::string_view name) {
  const auto all = variants();
  const auto found = std::ranges::find(all, name, &Variant::name);
  if (found == all.end()) {
    std::vector<std::string> known;
    for (const Variant& variant : all) known.emplace_back(variant.name);
    throw_bad_input("there is no variant '" + std::string(name) + "'" + suggestion(name, known));
  }
  std::vector<const Workload*> workloads;
  const auto at = static_cast<std::size_t>(found - all.begin());
  for (const Workload& each : all_workloads().in_variants()[at]) workloads.push_back(&each);
  return workloads;
}

std::span<const Workload> workloads_in_batch(int batch) {
  if (batch < kSmallestBatch || batch > kLargestBatch) {
    throw_bad_input("a batch of " + std::to_string(batch) + " images is not between " +
                    std::to_string(kSmallestBatch) + " and " + std::to_string(kLargestBatch) +
                    "; the plain workloads have one");
  }
  return all_workloads().in_batch(batch);
}

std::span<const Workload> catalog() { return all_workloads().plain(); }

const Workload* try_find_workload(std::string_view name) { return all_workloads().try_find(name); }

const Workload& find_workload(std::string_view name) { return all_workloads().find(name); }

}  // namespace pirt
