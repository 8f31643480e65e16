// Workloads that are functions of this library and nothing else: backend cpu calls them, and no
// other backend has a kernel of theirs.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "workloads/model/function_kernel.h"
#include "workloads/model/workload.h"

namespace pirt {

struct HostFunction : Operation {
  /// What one prepared kernel calls. It may keep from call to call what saves work and changes no
  /// output. Used by one thread at a time.
  std::function<KernelFunction(std::span<const Tensor> parameters)> prepare;
  /// The parts of a call, of usual data, after each of which but the last it can be left
  /// (slices.h), as shares of its time; empty = it cannot.
  std::vector<double> slices;

  [[nodiscard]] std::string_view host_only() const override { return kHostFunction; }
};

/// For a spec, which computes nothing.
[[nodiscard]] inline std::shared_ptr<const HostFunction> host_function(std::vector<double> slices) {
  auto function = std::make_shared<HostFunction>();
  function->slices = std::move(slices);
  return function;
}

}  // namespace pirt
