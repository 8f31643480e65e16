#include "workloads/backends/nats/worker/device_computer.h"

#include <algorithm>
#include <list>
#include <utility>

namespace pirt::cloud {
namespace {

class DeviceComputer : public Computer {
 public:
  DeviceComputer(const Backend& backend, const UnitRequest& request, std::uint64_t kept_bytes)
      : kept_bytes_(kept_bytes), device_(backend.open(request)) {}

  std::vector<Tensor> compute(const Workload& workload, const SharedTensors& parameters,
                              const Digest& content, std::span<const Tensor> inputs,
                              Nanos& took) override {
    Kernel& kernel = prepared(workload, parameters, content);
    std::vector<Tensor> outputs = make_tensors(workload.outputs);
    const Nanos begin = clock_.now();
    kernel.bind(inputs, outputs);
    kernel.upload();
    static_cast<void>(kernel.execute(1));
    kernel.download();
    kernel.unbind();
    took = clock_.now() - begin;
    return outputs;
  }

 private:
  struct Prepared {
    const Workload* workload = nullptr;
    Digest content;
    SharedTensors parameters;  ///< As long as the kernel, which may read them.
    std::uint64_t bytes = 0;
    std::unique_ptr<Kernel> kernel;
  };

  Kernel& prepared(const Workload& workload, const SharedTensors& parameters,
                   const Digest& content) {
    const auto known = std::ranges::find_if(prepared_, [&](const Prepared& each) {
      return each.workload == &workload && each.content == content;
    });
    if (known != prepared_.end()) {
      prepared_.splice(prepared_.begin(), prepared_, known);
      return *prepared_.front().kernel;
    }
    Prepared made{&workload, content, parameters, kLeastBytes, nullptr};
    const std::span<const Tensor> given =
        parameters != nullptr ? std::span<const Tensor>(*parameters) : std::span<const Tensor>();
    for (const Tensor& each : given) made.bytes += each.bytes().size();
    bytes_ += made.bytes;
    while (bytes_ > kept_bytes_ && !prepared_.empty()) {
      bytes_ -= prepared_.back().bytes;
      prepared_.pop_back();
    }
    made.kernel = device_->prepare(workload, given);
    prepared_.push_front(std::move(made));
    return *prepared_.front().kernel;
  }

  /// Of one without parameters: its buffers.
  static constexpr std::uint64_t kLeastBytes = std::uint64_t{4} << 20;

  std::uint64_t kept_bytes_;
  std::uint64_t bytes_ = 0;
  MachineClock clock_;
  std::unique_ptr<Device> device_;
  std::list<Prepared> prepared_;
};

}  // namespace

std::unique_ptr<Computer> make_device_computer(const Backend& backend, const UnitRequest& request,
                                               std::uint64_t kept_bytes) {
  return std::make_unique<DeviceComputer>(backend, request, kept_bytes);
}

}  // namespace pirt::cloud
