// The kernel of a workload that the device computes entirely.
#pragma once

#include <string>
#include <vector>

#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/model/backend.h"

namespace pirt::opencl {

class PlanKernel : public Kernel {
 public:
  /// @param workload  Its name, for messages.
  PlanKernel(DeviceSession session, std::string workload, Plan plan)
      : session_(std::move(session)), workload_(std::move(workload)), plan_(std::move(plan)) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override;
  void upload() override;
  std::optional<Nanos> execute(int repeats) override;
  void download() override;
  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override;
  void upload_state() override;
  void commit_state() override;

 protected:
  [[nodiscard]] const DeviceSession& session() const { return session_; }
  [[nodiscard]] const std::string& workload() const { return workload_; }
  [[nodiscard]] const Plan& plan() const { return plan_; }
  [[nodiscard]] std::span<Tensor> host_outputs() const { return outputs_; }

 private:
  DeviceSession session_;
  std::string workload_;
  Plan plan_;
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
  std::span<const Tensor> current_;
  std::span<Tensor> next_;
};

}  // namespace pirt::opencl
