// Eight numbers at a time, in registers of whatever a processor has.
#pragma once

namespace pirt {

/// In an order that any width of registers can keep, so that all give the same bits.
/// @tparam Lanes  A vector of eight (gnu::vector_size).
template <typename Lanes>
[[gnu::always_inline]] inline auto sum_of_eight(const Lanes& lanes) {
  return ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) +
         ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]));
}

}  // namespace pirt
