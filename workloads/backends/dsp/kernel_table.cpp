#include <algorithm>

#include "workloads/backends/dsp/kernels.h"

namespace pirt::dsp {

const DspKernelEntry* find_kernel(std::string_view kernel) {
  for (const auto table : {vision_kernels(), dnn_kernels()}) {
    const auto it = std::ranges::find(table, kernel, &DspKernelEntry::kernel);
    if (it != table.end()) return &*it;
  }
  return nullptr;
}

}  // namespace pirt::dsp
