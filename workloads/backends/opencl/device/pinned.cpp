#include "workloads/backends/opencl/device/pinned.h"

#include <new>
#include <utility>

namespace pirt::opencl {

bool shares_memory(const cl::Device& device) {
  return device.getInfo<CL_DEVICE_HOST_UNIFIED_MEMORY>() == CL_TRUE;
}

PinnedMemory::PinnedMemory(const cl::CommandQueue& queue, std::size_t size_bytes)
    : queue_(queue),
      buffer_(queue.getInfo<CL_QUEUE_CONTEXT>(), CL_MEM_READ_WRITE | CL_MEM_ALLOC_HOST_PTR,
              size_bytes),
      data_(static_cast<std::byte*>(
          queue_.enqueueMapBuffer(buffer_, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE, 0, size_bytes))),
      size_bytes_(size_bytes) {}

PinnedMemory::~PinnedMemory() {
  clEnqueueUnmapMemObject(queue_(), buffer_(), data_, 0, nullptr, nullptr);
  clFinish(queue_());
}

std::shared_ptr<std::byte> PinnedPool::take(std::size_t size_bytes) {
  size_bytes = (size_bytes + Tensor::kAlignment - 1) / Tensor::kAlignment * Tensor::kAlignment;
  if (size_bytes == 0 || size_bytes > kMost) return nullptr;
  std::unique_ptr<PinnedMemory> memory;
  decltype(kept_) dropped;  // For another size; freed without the lock.
  {
    const std::lock_guard lock(mutex_);
    if (auto kept = kept_.extract(size_bytes)) {
      memory = std::move(kept.mapped());
    } else {
      while (size_bytes > kMost - given_bytes_) {
        if (kept_.empty()) return nullptr;
        all_.erase(kept_.begin()->second->bytes().data());
        given_bytes_ -= kept_.begin()->first;
        dropped.insert(kept_.extract(kept_.begin()));
      }
      given_bytes_ += size_bytes;
    }
  }
  dropped.clear();
  if (memory == nullptr) {
    try {
      memory = std::make_unique<PinnedMemory>(queue_, size_bytes);
    } catch (const cl::Error&) {  // Less than what is allowed: the heap has some.
      const std::lock_guard lock(mutex_);
      given_bytes_ -= size_bytes;
      return nullptr;
    }
    const std::lock_guard lock(mutex_);
    all_.emplace(memory->bytes().data(), size_bytes);
  }
  std::byte* const data = memory->bytes().data();
  return {data, [pool = shared_from_this(), held = memory.release()](std::byte*) {
            pool->give_back(std::unique_ptr<PinnedMemory>(held));
          }};
}

bool PinnedPool::holds(const std::byte* data) const {
  const std::lock_guard lock(mutex_);
  const auto after = all_.upper_bound(data);
  return after != all_.begin() && data < std::prev(after)->first + std::prev(after)->second;
}

void PinnedPool::give_back(std::unique_ptr<PinnedMemory> memory) noexcept {
  const std::lock_guard lock(mutex_);
  const auto bytes = memory->bytes();
  try {
    kept_.emplace(bytes.size(), nullptr)->second = std::move(memory);
  } catch (const std::bad_alloc&) {  // Not kept, then.
    all_.erase(bytes.data());
    given_bytes_ -= bytes.size();
  }
}

}  // namespace pirt::opencl
