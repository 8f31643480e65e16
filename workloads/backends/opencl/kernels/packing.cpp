#include "workloads/backends/opencl/kernels/packing.h"

#include <algorithm>
#include <cstddef>

namespace pirt::opencl {

std::vector<float> interleave_channels(std::span<const float> weights, int out_c,
                                       int channels_per_block) {
  const auto channels = static_cast<std::size_t>(out_c);
  const auto block = static_cast<std::size_t>(channels_per_block);
  const std::size_t taps = weights.size() / channels;
  std::vector<float> packed(static_cast<std::size_t>(blocks(out_c, channels_per_block)) * taps *
                            block);
  // Written in order; what is read is a line of each of the block's channels.
  for (std::size_t first = 0; first < channels; first += block) {
    const std::size_t here = std::min(block, channels - first);
    float* to = packed.data() + first * taps;
    for (std::size_t t = 0; t < taps; ++t, to += block) {
      for (std::size_t c = 0; c < here; ++c) to[c] = weights[(first + c) * taps + t];
    }
  }
  return packed;
}

}  // namespace pirt::opencl
