#include "workloads/vision/vision.h"

namespace pirt::vision {

std::vector<Entry> entries() {
  return {
#define PIRT_TABLE1(name, width, height) {make_##name, width, height, true},
#define PIRT_VISION(name, width, height) {make_##name, width, height, false},
#include "workloads/vision/workloads.inc"
  };
}

std::vector<Workload> all() {
  std::vector<Workload> all;
  for (const Entry& entry : entries()) {
    all.push_back(entry.make(entry.width, entry.height));
    all.back().at_size = entry.make;
    if (entry.in_table1) all.back().tags.insert(all.back().tags.begin(), "table1");
  }
  return all;
}

}  // namespace pirt::vision
