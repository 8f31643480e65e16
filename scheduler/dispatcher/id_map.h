// TaskId -> slot, without a search for the ids that drivers choose: their lower bits are small
// numbers that are used again, or rise one by one, so that each finds a cell of its own there. The
// few that do not are kept apart.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "scheduler/mix/task.h"

namespace pirt {

class IdMap {
 public:
  static constexpr std::uint32_t kAbsent = UINT32_MAX;

  IdMap() : cells_(kInitial) {}

  /// kAbsent if the id is not there.
  [[nodiscard]] std::uint32_t find(TaskId id) const {
    const Cell& cell = cells_[home(id)];
    if (cell.id == id) return cell.value;
    return apart_.empty() ? kAbsent : find_apart(id);
  }

  /// False, and nothing changed, if the id is there.
  bool insert(TaskId id, std::uint32_t value) {
    if (find(id) != kAbsent) return false;
    if (2 * ++size_ > cells_.size()) grow();
    put(id, value);
    return true;
  }

  /// @param id  Is there.
  void erase(TaskId id) {
    --size_;
    Cell& cell = cells_[home(id)];
    if (cell.id == id && cell.value != kAbsent) {
      cell.value = kAbsent;
    } else {
      apart_.erase(id);
    }
  }

 private:
  struct Cell {
    TaskId id = 0;
    std::uint32_t value = kAbsent;
  };
  static constexpr std::size_t kInitial = 64;  // A power of two, as all sizes.

  [[nodiscard]] std::size_t home(TaskId id) const { return id & (cells_.size() - 1); }

  [[nodiscard]] std::uint32_t find_apart(TaskId id) const {
    const auto found = apart_.find(id);
    return found == apart_.end() ? kAbsent : found->second;
  }

  void put(TaskId id, std::uint32_t value) {
    Cell& cell = cells_[home(id)];
    if (cell.value == kAbsent) {
      cell = {id, value};
    } else {
      apart_.emplace(id, value);
    }
  }

  void grow() {
    auto old = std::vector<Cell>(cells_.size() * 2);
    old.swap(cells_);
    auto apart = std::exchange(apart_, {});
    for (const Cell& cell : old) {
      if (cell.value != kAbsent) put(cell.id, cell.value);
    }
    for (const auto& [id, value] : apart) put(id, value);
  }

  std::vector<Cell> cells_;
  std::unordered_map<TaskId, std::uint32_t> apart_;
  std::size_t size_ = 0;
};

}  // namespace pirt
