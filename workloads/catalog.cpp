// The list of all workloads; a new family adds one line here.
#include "workloads/catalog.h"

#include <algorithm>
#include <iterator>

#include "workloads/base/error.h"
#include "workloads/base/text.h"
#include "workloads/dnn/dnn.h"
#include "workloads/vision/vision.h"

namespace pirt {
namespace {

std::vector<Workload> make_catalog() {
  std::vector<Workload> all = vision::table1();
  std::ranges::move(dnn::table1(), std::back_inserter(all));
  std::ranges::move(dnn::pools(), std::back_inserter(all));
  all.push_back(dnn::make_alexnet());
  return all;
}

}  // namespace

std::span<const Workload> catalog() {
  static const std::vector<Workload> all = make_catalog();
  return all;
}

std::vector<std::string> workload_names() {
  std::vector<std::string> names;
  for (const auto& workload : catalog()) names.push_back(workload.name);
  return names;
}

const Workload* try_find_workload(std::string_view name) {
  const auto all = catalog();
  const auto it = std::ranges::find(all, name, &Workload::name);
  return it == all.end() ? nullptr : &*it;
}

const Workload& find_workload(std::string_view name) {
  if (const auto* found = try_find_workload(name)) return *found;
  throw_bad_input("there is no workload '" + std::string(name) + "'" +
                  suggestion(name, workload_names()) + "; `pirt list workloads` shows all");
}

}  // namespace pirt
