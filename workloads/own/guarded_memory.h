// Memory of tensors that whoever writes beyond their end is found out by: the next page cannot be
// written, and the bytes up to it are looked at.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "workloads/model/tensor.h"

namespace pirt::own {

class GuardedMemory final : public TensorMemory {
 public:
  /// Ends at a page that nobody may touch, but for what Tensor::kAlignment needs; not aligned to a
  /// page.
  [[nodiscard]] std::shared_ptr<std::byte> take(std::size_t size_bytes) override;
  [[nodiscard]] bool holds(const std::byte* data) const override;
  /// @throws Error{kEnvironment} if a byte behind one of the tensors that are there was written.
  void check() const;

 private:
  struct Block {
    std::weak_ptr<std::byte> data;
    const std::byte* begin = nullptr;
    std::size_t used = 0, all = 0;  ///< Bytes.
  };
  mutable std::mutex mutex_;
  std::vector<Block> blocks_;
};

}  // namespace pirt::own
