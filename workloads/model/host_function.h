// Workloads that are functions of this library and nothing else: backend cpu calls them, and no
// other backend has a kernel of theirs.
#pragma once

#include <functional>
#include <span>

#include "workloads/model/function_kernel.h"
#include "workloads/model/workload.h"

namespace pirt {

struct HostFunction : Operation {
  /// What one prepared kernel calls. It may keep from call to call what saves work and changes no
  /// output. Used by one thread at a time.
  std::function<KernelFunction(std::span<const Tensor> parameters)> prepare;

  [[nodiscard]] std::string_view host_only() const override { return kHostFunction; }
};

}  // namespace pirt
