// TaskId -> slot: open addressing with linear probing, erased by shifting back, so that it never
// fills with leftovers.
#pragma once

#include <cstdint>
#include <vector>

#include "scheduler/mix/task.h"

namespace pirt {

class IdMap {
 public:
  static constexpr std::uint32_t kAbsent = UINT32_MAX;

  IdMap() : cells_(kInitial) {}

  /// Where the id is, or would be; true until the map changes.
  [[nodiscard]] std::size_t locate(TaskId id) const {
    std::size_t i = home(id);
    while (cells_[i].value != kAbsent && cells_[i].id != id) i = next(i);
    return i;
  }
  /// kAbsent if the id that was located is not there.
  [[nodiscard]] std::uint32_t at(std::size_t position) const { return cells_[position].value; }
  [[nodiscard]] std::uint32_t find(TaskId id) const { return at(locate(id)); }

  /// @param position  Of an id that is not there.
  void insert_at(std::size_t position, TaskId id, std::uint32_t value) {
    cells_[position] = {id, value};
    if (2 * ++size_ > cells_.size()) grow();
  }

  /// @param hole  Of an id that is there.
  void erase_at(std::size_t hole) {
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

  void grow() {
    auto old = std::vector<Cell>(cells_.size() * 2);
    old.swap(cells_);
    for (const Cell& cell : old) {
      if (cell.value != kAbsent) cells_[locate(cell.id)] = cell;
    }
  }

  std::vector<Cell> cells_;
  std::size_t size_ = 0;
};

}  // namespace pirt
