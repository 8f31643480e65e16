// A function as a kernel, for those that compute on the host's tensors where they are.
#pragma once

#include <functional>
#include <span>
#include <utility>

#include "workloads/model/backend.h"

namespace pirt {

/// One call: computes outputs, which have the specs of its workload, of inputs; sets the rows of
/// lists. What it throws fails the task.
using KernelFunction =
    std::function<void(std::span<const Tensor> inputs, std::span<Tensor> outputs)>;

class FunctionKernel final : public Kernel {
 public:
  explicit FunctionKernel(KernelFunction function) : function_(std::move(function)) {}
  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    inputs_ = inputs;
    outputs_ = outputs;
  }
  std::optional<Nanos> execute(int repeats) override {
    for (int i = 0; i < repeats; ++i) function_(inputs_, outputs_);
    return std::nullopt;
  }

 private:
  KernelFunction function_;
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
};

}  // namespace pirt
