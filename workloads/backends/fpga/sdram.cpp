#include "workloads/backends/fpga/sdram.h"

#include <algorithm>
#include <stdexcept>

namespace pirt::fpga {

std::uint64_t Stream::peek(int bytes) const {
  std::uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) {
    const std::byte byte = queue_[(head_ + static_cast<std::size_t>(i)) % kQueue];
    value |= std::to_integer<std::uint64_t>(byte) << (8 * i);
  }
  return value;
}

std::uint64_t Stream::take(int bytes) {
  const std::uint64_t value = peek(bytes);
  head_ += static_cast<std::size_t>(bytes);
  return value;
}

void Stream::give(std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) {
    queue_[tail_++ % kQueue] = static_cast<std::byte>(value >> (8 * i) & 0xff);
  }
}

Sdram::Sdram(const SdramTiming& timing, std::span<Stream> streams)
    : timing_(timing),
      streams_(streams),
      open_row_(streams.size(), -1),
      until_refresh_(timing.refresh_every) {
  if (streams.empty() || streams.size() > 4) throw std::logic_error("an SDRAM has 4 banks");
}

/// How long a burst of the stream could be now; 0 = it has to wait for a core.
int Sdram::wanted_words(const Stream& stream) const {
  const auto burst = static_cast<std::size_t>(2 * timing_.burst_words);
  const std::size_t left = stream.size() - (stream.reads() ? stream.tail_ : stream.head_);
  const std::size_t bytes = std::min(left, burst);
  const std::size_t possible = stream.reads() ? Stream::kQueue - stream.queued() : stream.queued();
  return bytes == 0 || possible < bytes ? 0 : static_cast<int>((bytes + 1) / 2);
}

void Sdram::choose() {
  if (until_refresh_ <= 0) {
    until_refresh_ += timing_.refresh_every;
    wait_ = (was_writing_ ? timing_.recovery : 0) + timing_.precharge + timing_.refresh;
    std::ranges::fill(open_row_, -1);
    was_reading_ = was_writing_ = false;
    return;
  }
  // The stream that had the last burst goes on while it can, so that the bus turns seldom, up to a
  // queue: a core that takes all that comes would keep its own results waiting.
  const bool is_long = words_in_turn_ >= static_cast<int>(Stream::kQueue / 2);
  const std::size_t first = current_ + (is_long ? 1 : 0);
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    const std::size_t candidate = (first + i) % streams_.size();
    Stream& stream = streams_[candidate];
    int words = wanted_words(stream);
    if (words == 0) continue;
    const std::size_t position = stream.reads() ? stream.tail_ : stream.head_;
    const auto row = static_cast<std::int64_t>(position / 2) / timing_.row_words;
    const auto in_row =
        static_cast<int>(position / 2 % static_cast<std::size_t>(timing_.row_words));
    words = std::min(words, timing_.row_words - in_row);
    wait_ = 0;
    if (open_row_[candidate] != row) {
      if (open_row_[candidate] >= 0) {
        wait_ += timing_.precharge + (stream.reads() ? 0 : timing_.recovery);
      }
      wait_ += timing_.activate;
      open_row_[candidate] = row;
    }
    if (stream.reads() && (!was_reading_ || wait_ > 0)) wait_ += timing_.cas_latency;
    if (!stream.reads() && was_reading_) wait_ += timing_.turnaround;
    was_reading_ = stream.reads();
    was_writing_ = !stream.reads();
    if (candidate != current_ || is_long) words_in_turn_ = 0;
    words_in_turn_ += words;
    current_ = candidate;
    words_left_ = words;
    return;
  }
  was_reading_ = false;  // the next read waits for its first word again
}

void Sdram::move_word(Stream& stream) {
  const std::size_t bytes =
      std::min<std::size_t>(2, stream.size() - (stream.reads() ? stream.tail_ : stream.head_));
  for (std::size_t i = 0; i < bytes; ++i) {
    if (stream.reads()) {
      stream.queue_[stream.tail_ % Stream::kQueue] = stream.from_[stream.tail_];
      ++stream.tail_;
    } else {
      stream.to_[stream.head_] = stream.queue_[stream.head_ % Stream::kQueue];
      ++stream.head_;
    }
  }
  ++words_;
}

void Sdram::clock() {
  --until_refresh_;
  if (wait_ == 0 && words_left_ == 0) choose();
  if (wait_ > 0) {
    --wait_;
  } else if (words_left_ > 0) {
    move_word(streams_[current_]);
    --words_left_;
  }
}

}  // namespace pirt::fpga
