// Memory of the host's that a device with memory of its own reads and writes without a copy of the
// driver's in between.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "workloads/backends/opencl/device/api.h"
#include "workloads/model/tensor.h"

namespace pirt::opencl {

/// Whether the device works on the host's memory.
[[nodiscard]] bool shares_memory(const cl::Device& device);

class PinnedMemory {
 public:
  PinnedMemory(const cl::CommandQueue& queue, std::size_t size_bytes);
  ~PinnedMemory();
  PinnedMemory(const PinnedMemory&) = delete;
  PinnedMemory& operator=(const PinnedMemory&) = delete;

  [[nodiscard]] std::span<std::byte> bytes() const { return {data_, size_bytes_}; }

 private:
  cl::CommandQueue queue_;  ///< Also of a unit that is gone: it holds the context.
  cl::Buffer buffer_;
  std::byte* data_ = nullptr;
  std::size_t size_bytes_ = 0;
};

/// For tensors. What is given back is kept for others of its size, until one of another has no
/// room.
class PinnedPool final : public TensorMemory, public std::enable_shared_from_this<PinnedPool> {
 public:
  /// Of all that it gave: pinned memory is taken from the whole machine.
  static constexpr std::size_t kMost = std::size_t{256} << 20;

  explicit PinnedPool(cl::CommandQueue queue) : queue_(std::move(queue)) {}

  [[nodiscard]] std::shared_ptr<std::byte> take(std::size_t size_bytes) override;
  [[nodiscard]] bool holds(const std::byte* data) const override;

 private:
  void give_back(std::unique_ptr<PinnedMemory> memory) noexcept;

  cl::CommandQueue queue_;
  mutable std::mutex mutex_;
  std::size_t given_bytes_ = 0;                  ///< Those that are kept included.
  std::map<const std::byte*, std::size_t> all_;  ///< Where they begin, and their bytes.
  std::multimap<std::size_t, std::unique_ptr<PinnedMemory>> kept_;
};

}  // namespace pirt::opencl
