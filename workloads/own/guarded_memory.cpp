#include "workloads/own/guarded_memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>

#include "workloads/base/error.h"

namespace pirt::own {
namespace {

constexpr auto kMark = std::byte{0xA5};

std::size_t up_to(std::size_t bytes, std::size_t step) { return (bytes + step - 1) / step * step; }

}  // namespace

std::shared_ptr<std::byte> GuardedMemory::take(std::size_t size_bytes) {
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  const std::size_t aligned = up_to(std::max<std::size_t>(size_bytes, 1), Tensor::kAlignment);
  const std::size_t pages = up_to(aligned, page);
  void* const place =
      ::mmap(nullptr, pages + page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (place == MAP_FAILED) return nullptr;
  auto* const all = static_cast<std::byte*>(place);
  if (::mprotect(all + pages, page, PROT_NONE) != 0) {
    ::munmap(place, pages + page);
    return nullptr;
  }
  std::byte* const begin = all + pages - aligned;
  std::fill(begin + size_bytes, begin + aligned, kMark);
  std::shared_ptr<std::byte> data(begin, [=](std::byte*) { ::munmap(place, pages + page); });
  const std::lock_guard lock(mutex_);
  std::erase_if(blocks_, [](const Block& block) { return block.data.expired(); });
  blocks_.push_back({.data = data, .begin = begin, .used = size_bytes, .all = aligned});
  return data;
}

bool GuardedMemory::holds(const std::byte* data) const {
  const std::lock_guard lock(mutex_);
  return std::ranges::any_of(blocks_, [data](const Block& block) {
    return !block.data.expired() && block.begin <= data && data < block.begin + block.all;
  });
}

void GuardedMemory::check() const {
  const std::lock_guard lock(mutex_);
  for (const Block& block : blocks_) {
    const auto data = block.data.lock();
    if (data == nullptr) continue;
    const auto* const end = block.begin + block.all;
    const auto* const written =
        std::find_if(block.begin + block.used, end, [](std::byte b) { return b != kMark; });
    if (written == end) continue;
    throw_environment("the kernel wrote byte " + std::to_string(written - block.begin) +
                      " of an output of " + std::to_string(block.used) + " bytes");
  }
}

}  // namespace pirt::own
