// Kernels that launch plans.
#pragma once

#include <string>
#include <vector>

#include "workloads/backends/opencl/plan/plan.h"
#include "workloads/backends/opencl/plan/transfers.h"
#include "workloads/model/backend.h"
#include "workloads/model/device_memory.h"

namespace pirt::opencl {

/// What all of them share: how a call is computed, once or more, with stamps or without.
class LaunchingKernel : public Kernel, public DeviceMemory {
 public:
  /// @param workload  Its name, for messages.
  LaunchingKernel(DeviceSession session, std::string workload, std::size_t buffers_bytes)
      : session_(std::move(session)),
        workload_(std::move(workload)),
        buffers_bytes_(static_cast<std::int64_t>(buffers_bytes)) {}

  [[nodiscard]] std::int64_t device_memory_bytes() const override { return buffers_bytes_; }
  std::optional<Nanos> execute(int repeats) override;
  std::optional<Nanos> stamped_launch() override;
  /// Computes once more; what the device stamps of it, where it has a clock and all commands are
  /// pirt's.
  [[nodiscard]] std::optional<LaunchSum> stamped();

 protected:
  [[nodiscard]] const DeviceSession& session() const { return session_; }
  [[nodiscard]] const std::string& workload() const { return workload_; }

 private:
  /// Enqueues one call; may wait for parts of it.
  virtual void compute(Launches& launches) = 0;

  DeviceSession session_;
  std::string workload_;
  std::int64_t buffers_bytes_;
};

/// The kernel of a workload that the device computes entirely.
class PlanKernel : public LaunchingKernel {
 public:
  PlanKernel(DeviceSession session, std::string workload, Plan plan)
      : LaunchingKernel(std::move(session), std::move(workload), plan.size_bytes),
        plan_(std::move(plan)),
        transfers_(this->session()) {}

  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override;
  void upload() override;
  void download() override;
  void scribble(std::byte with) override;
  void bind_state(std::span<const Tensor> current, std::span<Tensor> next) override;
  void upload_state() override;
  void commit_state() override;

 protected:
  [[nodiscard]] const Plan& plan() const { return plan_; }
  [[nodiscard]] Transfers& transfers() { return transfers_; }
  [[nodiscard]] std::span<Tensor> host_outputs() const { return outputs_; }

 private:
  void compute(Launches& launches) override;

  Plan plan_;
  Transfers transfers_;
  std::span<const Tensor> inputs_;
  std::span<Tensor> outputs_;
  std::span<const Tensor> current_;
  std::span<Tensor> next_;
};

}  // namespace pirt::opencl
