#include <algorithm>

#include "workloads/dsp/kernels.h"

namespace pirt::dsp {

const KernelEntry* find_kernel(std::string_view kernel) {
  const auto table = vision_kernels();
  const auto it = std::ranges::find(table, kernel, &KernelEntry::kernel);
  return it == table.end() ? nullptr : &*it;
}

}  // namespace pirt::dsp
