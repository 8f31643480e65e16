#include "scheduler/record/histogram.h"

#include <algorithm>
#include <bit>
#include <cassert>

namespace pirt {
namespace {

constexpr int kBits = 9;  // 512 buckets an octave.
constexpr std::uint64_t kPerOctave = std::uint64_t{1} << kBits;

std::size_t bucket_of(std::uint64_t value) {
  if (value < 2 * kPerOctave) return value;
  const int shift =
      static_cast<int>(std::bit_width(value)) - kBits - 1;  // value >> shift is in [512, 1024).
  return static_cast<std::size_t>(static_cast<std::uint64_t>(shift) * kPerOctave +
                                  (value >> shift));
}

/// The middle of a bucket.
std::uint64_t value_of(std::size_t bucket) {
  if (bucket < 2 * kPerOctave) return bucket;
  const auto shift = bucket / kPerOctave - 1;
  const std::uint64_t low = (bucket - shift * kPerOctave) << shift;
  return low + (((std::uint64_t{1} << shift) - 1) / 2);
}

}  // namespace

void Histogram::add(Nanos value) {
  assert(value >= Nanos::zero());
  const std::size_t bucket = bucket_of(static_cast<std::uint64_t>(value.count()));
  // What is below wraps to far above.
  if (bucket - first_ >= counts_.size()) cover(bucket, bucket);
  ++counts_[bucket - first_];
  ++count_;
  sum_ns_ += static_cast<double>(value.count());
  min_ = std::min(min_, value);
  max_ = std::max(max_, value);
}

void Histogram::add(const Histogram& other) {
  if (other.counts_.empty()) return;
  cover(other.first_, other.first_ + other.counts_.size() - 1);
  for (std::size_t i = 0; i < other.counts_.size(); ++i) {
    counts_[other.first_ - first_ + i] += other.counts_[i];
  }
  count_ += other.count_;
  sum_ns_ += other.sum_ns_;
  min_ = std::min(min_, other.min_);
  max_ = std::max(max_, other.max_);
}

/// Makes room for the buckets from @p low to @p high, in steps, so that values that come one by one
/// seldom do.
void Histogram::cover(std::size_t low, std::size_t high) {
  constexpr std::size_t kStep = 64;
  low = low / kStep * kStep;
  high = (high / kStep + 1) * kStep;
  if (counts_.empty()) first_ = low;
  if (low < first_) {
    counts_.insert(counts_.begin(), first_ - low, 0);
    first_ = low;
  }
  if (high > first_ + counts_.size()) counts_.resize(high - first_);
}

std::optional<Nanos> Histogram::mean() const {
  if (count_ == 0) return std::nullopt;
  return Nanos(std::llround(sum_ns_ / static_cast<double>(count_)));
}

std::optional<Nanos> Histogram::percentile(double fraction) const {
  assert(fraction > 0 && fraction <= 1);
  if (count_ == 0) return std::nullopt;
  const auto rank = std::max<std::int64_t>(
      1, static_cast<std::int64_t>(std::ceil(fraction * static_cast<double>(count_))));
  std::int64_t seen = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    seen += counts_[i];
    if (seen < rank) continue;
    return std::clamp(Nanos(static_cast<std::int64_t>(value_of(first_ + i))), min_, max_);
  }
  return max_;
}

}  // namespace pirt
