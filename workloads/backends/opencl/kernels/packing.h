// Layouts of weights that vector loads want.
#pragma once

#include <concepts>
#include <span>
#include <vector>

namespace pirt::opencl {

/// How many blocks of @p size hold @p count.
template <std::integral Count>
[[nodiscard]] constexpr Count blocks(Count count, int size) {
  return (count + size - 1) / size;
}

/// [out_c, ...] -> [blocks of channels, ..., channels of a block], so that a vector load takes the
/// channels of one tap; the last block's missing channels are 0. Also for a bias, where ... is
/// empty.
[[nodiscard]] std::vector<float> interleave_channels(std::span<const float> weights, int out_c,
                                                     int channels_per_block);

}  // namespace pirt::opencl
