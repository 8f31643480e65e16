#include "workloads/backends/nats/wire/own_sizes.h"

#include <fmt/core.h>

#include <algorithm>

#include "workloads/vision/vision.h"

namespace pirt::cloud {
namespace {

// A picture's; what is larger would be no camera's.
constexpr std::int64_t kLeastSide = 64, kMostSide = 16384;
constexpr std::int64_t kMostPixels = std::int64_t{1} << 26;
/// Kept, since kernels refer to them.
constexpr std::size_t kMostMade = 64;

}  // namespace

std::vector<std::int64_t> sizes_of(const Workload& workload) {
  const auto* const image = dynamic_cast<const vision::ImageOperation*>(workload.operation.get());
  if (image == nullptr || !workload.variant.empty() || workload.batch > 1) return {};
  return {image->width, image->height};
}

OwnSizes::Found OwnSizes::find(const std::string& kind, std::span<const std::int64_t> sizes,
                               const Digest& spec) const {
  constexpr std::size_t kSides = 2;
  const auto is_side = [](std::int64_t side) { return side >= kLeastSide && side <= kMostSide; };
  if (sizes.size() != kSides || !std::ranges::all_of(sizes, is_side) ||
      sizes[0] * sizes[1] > kMostPixels) {
    return {nullptr, kind + ": no sizes of a picture"};
  }
  const auto width = static_cast<int>(sizes[0]), height = static_cast<int>(sizes[1]);
  const std::lock_guard lock(mutex_);
  auto at = made_.find({kind, {sizes.begin(), sizes.end()}});
  if (at == made_.end()) {
    if (made_.size() >= kMostMade) {
      return {nullptr, fmt::format("{} of {} x {}: {} other sizes are known already", kind, width,
                                   height, kMostMade)};
    }
    for (const vision::Entry& entry : vision::entries()) {
      // What others' makers take, nobody asked.
      if (entry.make(entry.width, entry.height).name != kind) continue;
      Workload made = entry.make(width, height);
      if (made.state) break;
      at = made_.emplace(std::pair(kind, std::vector(sizes.begin(), sizes.end())), std::move(made))
               .first;
      break;
    }
  }
  if (at == made_.end()) return {nullptr, kind + ": made in one size only"};
  if (spec_digest(at->second) != spec) {
    return {nullptr, kind + " is something else here: another version of pirt"};
  }
  return {&at->second, ""};
}

}  // namespace pirt::cloud
