// Records in slots that are used again, so that memory follows what is live, not what was.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pirt {

/// Of a record in a SlotTable: small enough to be the half of an id.
using Slot = std::uint32_t;

inline constexpr Slot kNoSlot = UINT32_MAX;

/// Free records stay as they were when they were given back, and so does their memory.
template <typename Record>
class SlotTable {
 public:
  [[nodiscard]] Record& operator[](Slot slot) { return records_[slot]; }
  [[nodiscard]] const Record& operator[](Slot slot) const { return records_[slot]; }

  /// The slot that was given back last, or a new one. References to records end here.
  [[nodiscard]] Slot take() {
    if (free_.empty()) {
      records_.emplace_back();
      return static_cast<Slot>(records_.size() - 1);
    }
    const Slot slot = free_.back();
    free_.pop_back();
    return slot;
  }
  void give_back(Slot slot) { free_.push_back(slot); }

  /// In use.
  [[nodiscard]] std::size_t used() const { return records_.size() - free_.size(); }
  /// All, the free ones too, in order of their slots.
  [[nodiscard]] const std::vector<Record>& records() const { return records_; }

 private:
  std::vector<Record> records_;
  std::vector<Slot> free_;
};

}  // namespace pirt
