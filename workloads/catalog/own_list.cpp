#include "workloads/catalog/own_list.h"

#include <algorithm>
#include <deque>
#include <mutex>

#include "workloads/base/error.h"
#include "workloads/model/own_operation.h"

namespace pirt {
namespace {

struct OwnList {
  std::mutex mutex;
  std::deque<Workload> all;            ///< Never fewer: whoever has found one keeps it.
  std::vector<const Workload*> found;  ///< The last of each name.
};

OwnList& own_list() {
  static auto& list = *new OwnList;  // Never destroyed, as in catalog.cpp.
  return list;
}

}  // namespace

void make_known(std::vector<Workload> workloads) {
  OwnList& list = own_list();
  const std::lock_guard lock(list.mutex);
  for (Workload& each : workloads) {
    const Workload* const made = &list.all.emplace_back(std::move(each));
    const auto before = std::ranges::find(list.found, made->name, &Workload::name);
    if (before != list.found.end()) {
      *before = made;
    } else {
      list.found.push_back(made);
    }
  }
}

const Workload* try_find_own(std::string_view name) {
  OwnList& list = own_list();
  const std::lock_guard lock(list.mutex);
  const auto found = std::ranges::find(list.found, name, &Workload::name);
  return found == list.found.end() ? nullptr : *found;
}

void check_code_is_here(const Workload& workload) {
  const OwnOperation* const own = own_operation(workload);
  if (own == nullptr || workload.make_data) return;
  throw_bad_input("to compute '" + workload.name + "' takes its code; give it with --workloads " +
                  own->source + " (RuntimeOptions::workloads)");
}

std::vector<const Workload*> own_workloads() {
  OwnList& list = own_list();
  const std::lock_guard lock(list.mutex);
  return list.found;
}

}  // namespace pirt
