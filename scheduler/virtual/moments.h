// Which of many things happens first: a tournament over moments that lie side by side, so that a
// change asks as many of them as it has rounds.
#pragma once

#include <bit>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "workloads/base/time.h"

namespace pirt {

/// A moment in virtual time; ties break by the order in which things were set going.
struct Moment {
  Nanos time = Nanos::max();  ///< Nanos::max() = never.
  std::uint64_t sequence = 0;
  friend auto operator<=>(const Moment&, const Moment&) = default;
};

class Moments {
 public:
  /// All of them never.
  explicit Moments(std::size_t count)
      : moments_(std::bit_ceil(count + std::size_t{count == 0})), winners_(2 * moments_.size()) {
    for (std::uint32_t i = 0; i < moments_.size(); ++i) winners_[moments_.size() + i] = i;
    for (std::size_t node = moments_.size() - 1; node > 0; --node) winners_[node] = winner(node);
  }

  void set(std::size_t position, const Moment& moment) {
    moments_[position] = moment;
    for (std::size_t node = (moments_.size() + position) / 2; node > 0; node /= 2) {
      const std::uint32_t before = std::exchange(winners_[node], winner(node));
      // Who has won against it, and still does, wins above as well.
      if (before == winners_[node] && before != position) break;
    }
  }
  /// Of all; Moment{} if none ever happens.
  [[nodiscard]] const Moment& first() const { return moments_[first_position()]; }
  [[nodiscard]] std::size_t first_position() const { return winners_[1]; }

 private:
  /// Of what is below a node: nodes 2n and 2n + 1.
  [[nodiscard]] std::uint32_t winner(std::size_t node) const {
    const std::uint32_t left = winners_[2 * node];
    const std::uint32_t right = winners_[2 * node + 1];
    const Moment& a = moments_[left];
    const Moment& b = moments_[right];
    return b.time < a.time || (b.time == a.time && b.sequence < a.sequence) ? right : left;
  }
  std::vector<Moment> moments_;  ///< As many as a power of two.
  /// By node, from 1: positions in moments_; last those of the moments themselves.
  std::vector<std::uint32_t> winners_;
};

}  // namespace pirt
