#include "characterize/campaign/precision_plan.h"

#include <algorithm>
#include <iterator>
#include <numeric>

namespace pirt {

std::vector<std::size_t> within_reach(std::span<const std::optional<Nanos>> needed, Nanos left) {
  std::vector<std::size_t> all(needed.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::vector<std::size_t> nearest;
  std::ranges::copy_if(all, std::back_inserter(nearest),
                       [&](std::size_t i) { return needed[i].has_value(); });
  std::ranges::stable_sort(nearest, {}, [&](std::size_t i) { return *needed[i]; });
  std::vector<std::size_t> chosen;
  for (const std::size_t i : nearest) {
    left -= *needed[i];
    if (left < Nanos(0)) break;
    chosen.push_back(i);
  }
  if (chosen.empty()) return all;
  std::ranges::sort(chosen);
  return chosen;
}

}  // namespace pirt
