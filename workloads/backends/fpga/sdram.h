// The board's SDRAM and its controller, cycle by cycle of its own clock: bursts of several streams,
// each of which has a bank of its own and a queue of bytes on the way to or from a core.
//
// Modelled: rows are opened and closed, reads have their latency, the bus turns around, cells are
// refreshed. Not modelled: how a controller could hide these behind bursts of other banks, which
// makes it slower than the best, never faster.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace pirt::fpga {

/// In cycles of its clock where nothing else is said.
/// @source ISSI, IS42S16320D data sheet, grade -7 (the DE1-SoC has one, 32 M x 16): 143 MHz at CAS
/// latency 3; tRCD 15 ns, tRP 15 ns, tRC 60 ns, tDPL 14 ns, each rounded up; 8192 rows of 1024
/// words, each refreshed in 64 ms.
struct SdramTiming {
  std::int64_t clock_hz = 143'000'000;
  int cas_latency = 3;
  int activate = 3;          ///< tRCD
  int precharge = 3;         ///< tRP
  int recovery = 2;          ///< tDPL, from the last word written to the row's end.
  int refresh = 9;           ///< tRC, for each of the refreshes.
  int refresh_every = 1117;  ///< 64 ms / 8192
  int turnaround = 1;        ///< Between the last word read and the first written.
  int row_words = 1024;
  int burst_words = 64;  ///< What the controller moves for a stream before it looks at the others.
};

/// Bytes that go in order from the memory to a core or back. The queue holds kQueue of them: two
/// blocks of on-chip memory.
class Stream {
 public:
  static constexpr std::size_t kQueue = 2048;

  static Stream reading(std::span<const std::byte> from) { return Stream(from, {}); }
  static Stream writing(std::span<std::byte> to) { return Stream({}, to); }

  [[nodiscard]] bool reads() const { return reads_; }
  /// Bytes in the queue.
  [[nodiscard]] std::size_t queued() const { return tail_ - head_; }
  /// Whether all of its bytes have arrived: in the memory, or at the core.
  [[nodiscard]] bool is_done() const { return head_ == size(); }
  /// The core's side: takes @p bytes, least significant first; as many are queued.
  std::uint64_t take(int bytes);
  [[nodiscard]] std::uint64_t peek(int bytes) const;
  /// The core's side: gives @p bytes; there is room.
  void give(std::uint64_t value, int bytes);
  [[nodiscard]] bool has_room(int bytes) const {
    return queued() + static_cast<std::size_t>(bytes) <= kQueue;
  }

 private:
  friend class Sdram;
  Stream(std::span<const std::byte> from, std::span<std::byte> to)
      : reads_(to.empty()), from_(from), to_(to) {}
  [[nodiscard]] std::size_t size() const { return reads_ ? from_.size() : to_.size(); }

  bool reads_;
  std::span<const std::byte> from_;
  std::span<std::byte> to_;
  // Positions in the memory's bytes: of a reader [head, tail) has been fetched and not taken, of a
  // writer [head, tail) has been given and not been stored.
  std::size_t head_ = 0, tail_ = 0;
  std::byte queue_[kQueue] = {};
};

class Sdram {
 public:
  /// @param streams  At most 4, one a bank; they outlive this.
  Sdram(const SdramTiming& timing, std::span<Stream> streams);

  /// One cycle of its clock.
  void clock();
  /// What it moved, of 2 bytes a cycle at most.
  [[nodiscard]] std::int64_t words() const { return words_; }

 private:
  [[nodiscard]] int wanted_words(const Stream& stream) const;
  void choose();
  void move_word(Stream& stream);

  SdramTiming timing_;
  std::span<Stream> streams_;
  std::vector<std::int64_t> open_row_;  ///< Of each stream's bank; -1 = none.
  std::size_t current_ = 0;
  int wait_ = 0, words_left_ = 0, words_in_turn_ = 0;
  bool was_reading_ = false, was_writing_ = false;
  int until_refresh_;
  std::int64_t words_ = 0;
};

}  // namespace pirt::fpga
