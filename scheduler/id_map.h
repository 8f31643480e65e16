// TaskId -> slot: open addressing with linear probing, erased by shifting back, so that it never
// fills with leftovers.
#pragma once

#include <cstdint>
#include <vector>

#include "scheduler/task.h"

namespace pirt {

class IdMap {
 public:
  static constexpr std::uint32_t kAbsent = UINT32_MAX;

  IdMap() : cells_(kInitial) {}

  [[nodiscard]] std::uint32_t find(TaskId id) const {
    for (std::size_t i = home(id);; i = next(i)) {
      if (cells_[i].value == kAbsent) return kAbsent;
      if (cells_[i].id == id) return cells_[i].value;
    }
  }

  /// The id must not be there.
  void insert(TaskId id, std::uint32_t value) {
    if (2 * ++size_ > cells_.size()) grow();
    place({id, value});
  }

  /// The id must be there.
  void erase(TaskId id) {
    std::size_t hole = home(id);
    while (cells_[hole].id != id || cells_[hole].value == kAbsent) hole = next(hole);
    // Whoever probed past the hole moves into it, as long as its home is not behind it.
    for (std::size_t i = next(hole); cells_[i].value != kAbsent; i = next(i)) {
      const std::size_t from_home = (i - home(cells_[i].id)) & (cells_.size() - 1);
      const std::size_t from_hole = (i - hole) & (cells_.size() - 1);
      if (from_home < from_hole) continue;
      cells_[hole] = cells_[i];
      hole = i;
    }
    cells_[hole] = {};
    --size_;
  }

 private:
  struct Cell {
    TaskId id = 0;
    std::uint32_t value = kAbsent;
  };
  static constexpr std::size_t kInitial = 64;  // A power of two, as all sizes.

  [[nodiscard]] std::size_t home(TaskId id) const {
    return static_cast<std::size_t>((id * 0x9e3779b97f4a7c15ULL) >> 32) & (cells_.size() - 1);
  }
  [[nodiscard]] std::size_t next(std::size_t i) const { return (i + 1) & (cells_.size() - 1); }

  void place(Cell cell) {
    std::size_t i = home(cell.id);
    while (cells_[i].value != kAbsent) i = next(i);
    cells_[i] = cell;
  }

  void grow() {
    auto old = std::vector<Cell>(cells_.size() * 2);
    old.swap(cells_);
    for (const Cell& cell : old) {
      if (cell.value != kAbsent) place(cell);
    }
  }

  std::vector<Cell> cells_;
  std::size_t size_ = 0;
};

}  // namespace pirt
