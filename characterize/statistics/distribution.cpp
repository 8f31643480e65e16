#include "characterize/statistics/distribution.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace pirt {

Distribution Distribution::of(std::vector<Nanos> samples) {
  assert(!samples.empty());
  const auto [low, high] = std::ranges::minmax(samples);
  return {.kind = Kind::kSamples,
          .low = low,
          .high = high,
          .samples = std::make_shared<const std::vector<Nanos>>(std::move(samples))};
}

Nanos Distribution::mean() const {
  if (kind != Kind::kSamples) return low + (high - low) / 2;
  double sum = 0;
  for (const Nanos each : *samples) sum += static_cast<double>(each.count());
  return Nanos(std::llround(sum / static_cast<double>(samples->size())));
}

Nanos Distribution::draw(std::uint64_t random) const {
  switch (kind) {
    case Kind::kConstant:
      return low;
    case Kind::kUniform: {
      const auto range = static_cast<std::uint64_t>((high - low).count()) + 1;
      return low + Nanos(static_cast<std::int64_t>(random % range));
    }
    case Kind::kSamples:
      return (*samples)[random % samples->size()];
  }
  return low;
}

}  // namespace pirt
