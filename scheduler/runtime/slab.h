// Records that are used again: any thread takes one, and any gives it back, without a lock and
// without the memory manager. They stay where they are, and go when their owner has gone and the
// last has come back.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>

#include "scheduler/runtime/threads.h"

namespace pirt::runtime {

/// @tparam Record  Has `SlabPlace place` for the slab; otherwise it comes as it was given back.
template <typename Record>
class Slab {
 public:
  struct Place {
    Slab* slab = nullptr;
    std::uint32_t index = 0;
    Atomic<std::uint32_t> next_free = 0;
  };

  /// Of an owner, who says when it goes by close().
  static Slab& make() { return *new Slab; }
  Slab(const Slab&) = delete;
  Slab& operator=(const Slab&) = delete;

  Record& take() {
    Record* const free = take_free();
    return free != nullptr ? *free : grow();
  }

  void give_back(Record& record) {
    std::uint64_t head = head_.load();
    do {
      record.place.next_free.store(first(head), std::memory_order_relaxed);
    } while (!head_.compare_exchange_weak(head, changed(head, record.place.index)));
    // Nobody takes one any more, so that each comes back once.
    if ((head & kClosed) != 0 && out_.fetch_sub(1) == 1) delete this;
  }

  /// Its owner needs none any more.
  void close() {
    std::uint64_t head = head_.load();
    while (!head_.compare_exchange_weak(head, changed(head, kNone) | kClosed)) continue;
    std::int64_t out = made_;
    for (std::uint32_t each = first(head); each != kNone;
         each = at(each).place.next_free.load(std::memory_order_relaxed)) {
      --out;
    }
    // Those that came back since then have been taken from 0.
    if (out_.fetch_add(out) == -out) delete this;
  }

  [[nodiscard]] Record& at(std::uint32_t index) {
    const std::uint32_t chunk = chunk_of(index);
    return chunks_[chunk].load(std::memory_order_acquire)[index - first_of(chunk)];
  }

 private:
  /// Null if none is free.
  Record* take_free() {
    std::uint64_t head = head_.load();
    while (first(head) != kNone) {
      Record& record = at(first(head));
      // Of one that another thread takes meanwhile this may be anything; then the head is another.
      const std::uint32_t next = record.place.next_free.load(std::memory_order_relaxed);
      if (head_.compare_exchange_weak(head, changed(head, next))) return &record;
    }
    return nullptr;
  }

  // The head of the list of free records: which is first, how often that changed, so that no thread
  // takes an old one for it, and whether the owner has gone.
  static constexpr std::uint32_t kNone = UINT32_MAX;
  static constexpr std::uint64_t kClosed = 1;
  static constexpr std::uint64_t kOneChange = 2;
  static std::uint32_t first(std::uint64_t head) { return static_cast<std::uint32_t>(head >> 32); }
  static std::uint64_t changed(std::uint64_t head, std::uint32_t first) {
    return std::uint64_t{first} << 32 | static_cast<std::uint32_t>(head + kOneChange);
  }

  // Each chunk is as large as all before it.
  static constexpr std::uint32_t kSmallest = 64;
  static constexpr std::size_t kChunks = 26;
  static std::uint32_t chunk_of(std::uint32_t index) {
    return static_cast<std::uint32_t>(std::bit_width(index / kSmallest));
  }
  static std::uint32_t first_of(std::uint32_t chunk) {
    return chunk == 0 ? 0 : kSmallest << (chunk - 1);
  }

  Slab() = default;
  ~Slab() {
    for (auto& chunk : chunks_) delete[] chunk.load();
  }

  /// One of a new chunk; the others are free.
  Record& grow() {
    const std::lock_guard lock(growing_);
    // Who waited for the lock may find what another has made.
    if (Record* const free = take_free()) return *free;
    const std::uint32_t chunk = chunk_of(made_);
    const std::uint32_t begin = made_, size = std::max(kSmallest, made_);
    auto* const records = new Record[size];
    for (std::uint32_t i = 0; i < size; ++i) {
      records[i].place.slab = this;
      records[i].place.index = begin + i;
      records[i].place.next_free = begin + i + 1;
    }
    chunks_.at(chunk).store(records, std::memory_order_release);
    made_ += size;
    Record& last = records[size - 1];
    std::uint64_t head = head_.load();
    do {
      last.place.next_free.store(first(head), std::memory_order_relaxed);
    } while (!head_.compare_exchange_weak(head, changed(head, begin + 1)));
    return records[0];
  }

  Atomic<std::uint64_t> head_ = std::uint64_t{kNone} << 32;
  std::array<Atomic<Record*>, kChunks> chunks_ = {};
  Mutex growing_;
  std::uint32_t made_ = 0;        ///< Records, with growing_.
  Atomic<std::int64_t> out_ = 0;  ///< Since it was closed: those that are to come back.
};

}  // namespace pirt::runtime
