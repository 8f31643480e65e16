// Memory whose own cost must not show in what is measured with it.
#pragma once

#include <fmt/core.h>
#include <sys/mman.h>

#include <cstddef>

#include "workloads/base/error.h"

namespace pirt {

/// Aligned, zero, and given by the system when it is first touched; in huge pages where it has any:
/// address translation is not what is measured, and a thousand pages less are given much faster.
class LargeMemory {
 public:
  /// @throws Error{kEnvironment} if there is not so much.
  explicit LargeMemory(std::size_t size_bytes) : size_(size_bytes) {
    data_ = ::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (data_ == MAP_FAILED) {
      throw_environment(fmt::format("cannot get {} MB of memory to measure with", size_ >> 20U));
    }
#ifdef MADV_HUGEPAGE
    ::madvise(data_, size_, MADV_HUGEPAGE);  // only a wish
#endif
  }
  ~LargeMemory() { ::munmap(data_, size_); }
  LargeMemory(const LargeMemory&) = delete;
  LargeMemory& operator=(const LargeMemory&) = delete;

  [[nodiscard]] std::size_t size_bytes() const { return size_; }
  template <typename T>
  [[nodiscard]] T* as() const {
    return static_cast<T*>(data_);
  }

 private:
  std::size_t size_;
  void* data_ = nullptr;
};

}  // namespace pirt
