// Which of many things happens first: a tournament over moments that lie side by side, so that a
// change asks as many of them as it has rounds.
#pragma once

#include <bit>
#include <compare>
#include <cstddef>
#include <cstdint>
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
      : moments_(std::bit_ceil(count + std::size_t{count == 0})), winners_(moments_.size()) {
    for (std::size_t node = moments_.size() - 1; node > 0; --node) winners_[node] = winner(node);
  }

  void set(std::size_t position, const Moment& moment) {
    moments_[position] = moment;
    for (std::size_t node = (moments_.size() + position) / 2; node > 0; node /= 2) {
      winners_[node] = winner(node);
    }
  }
  /// Of all; Moment{} if none ever happens.
  [[nodiscard]] const Moment& first() const { return moments_[first_position()]; }
  [[nodiscard]] std::size_t first_position() const {
    return moments_.size() == 1 ? 0 : winners_[1];
  }

 private:
  /// Of what is below a node: nodes 2n and 2n + 1, and last the moments.
  [[nodiscard]] std::uint32_t winner(std::size_t node) const {
    const std::uint32_t left = player(2 * node);
    const std::uint32_t right = player(2 * node + 1);
    const Moment& a = moments_[left];
    const Moment& b = moments_[right];
    return b.time < a.time || (b.time == a.time && b.sequence < a.sequence) ? right : left;
  }
  [[nodiscard]] std::uint32_t player(std::size_t node) const {
    return node < moments_.size() ? winners_[node]
                                  : static_cast<std::uint32_t>(node - moments_.size());
  }

  std::vector<Moment> moments_;         ///< As many as a power of two.
  std::vector<std::uint32_t> winners_;  ///< By node, from 1: positions in moments_.
};

}  // namespace pirt
