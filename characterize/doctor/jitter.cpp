#include "characterize/doctor/jitter.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cassert>

#include "characterize/statistics/statistics.h"
#include "workloads/backends/cpu/core_team.h"
#include "workloads/backends/cpu/peak_loops.h"
#include "workloads/base/error.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"
#include "workloads/base/system/control_groups.h"
#include "workloads/base/system/large_memory.h"
#include "workloads/base/time.h"

namespace pirt {
namespace {

constexpr Nanos kPiece = std::chrono::milliseconds(2);

struct alignas(64) CacheLine {
  static constexpr std::size_t kValues = 16;
  std::array<float, kValues> values{};
};

/// The last is that with the widest vectors: a sibling thread slows it most. The first ones, which
/// are portable, are always available.
template <typename Loop>
const Loop& last_available(std::span<const Loop> loops) {
  return *std::find_if(loops.rbegin(), loops.rend(),
                       [](const Loop& loop) { return loop.available(); });
}

/// @param work  Does a number of equal steps.
template <typename Work>
std::vector<Nanos> time_pieces(Nanos duration, std::int64_t first_steps, const Work& work) {
  const MachineClock clock;
  const auto timed = [&](std::int64_t steps) {
    const Nanos start = clock.now();
    work(steps);
    return clock.now() - start;
  };
  const Nanos start = clock.now();
  std::int64_t steps = first_steps;
  // The shorter of two, so that an interruption does not look like work.
  while (std::min(timed(steps), timed(steps)) < kPiece) steps *= 2;
  std::vector<Nanos> pieces;
  while (pieces.empty() || clock.now() - start < duration) {
    const Nanos piece = timed(steps);
    if (clock.now() - start >= duration / 5) pieces.push_back(piece);
  }
  return pieces;
}

/// Multiply-adds on the calling thread.
std::vector<Nanos> time_arithmetic(Nanos duration) {
  constexpr std::int64_t kFirstSteps = 1024;
  const cpu::ChainLoop& loop = last_available(cpu::chain_loops());
  std::vector<CacheLine> values(static_cast<std::size_t>(loop.values) / CacheLine::kValues + 1);
  return time_pieces(duration, kFirstSteps,
                     [&](std::int64_t steps) { loop.run(values.front().values.data(), steps); });
}

/// Reading on the calling thread; a step is a stretch of memory, one after the other: twice what
/// the last cache holds, or as much as the system gives in a quarter of the time.
std::vector<Nanos> time_reading(Nanos duration) {
  constexpr std::size_t kStep = 16 * cpu::ReadLoop::kGrain;
  constexpr std::size_t kWords = kStep / sizeof(std::uint32_t);
  constexpr std::int64_t kWithoutCacheSizes = std::int64_t{64} << 20;
  const auto last = read_cache_sizes().last_bytes;
  const auto bytes = static_cast<std::size_t>(
      std::min(last ? 2 * *last : kWithoutCacheSizes, most_filled_bytes()));
  const LargeMemory memory(std::max(bytes, kStep));
  auto* const words = memory.as<std::uint32_t>();
  const MachineClock clock;
  const Nanos begin = clock.now();
  std::size_t stretches = 0;
  do {
    std::fill_n(words + stretches * kWords, kWords, 1U);
    ++stretches;
  } while ((stretches + 1) * kStep <= bytes && clock.now() - begin < duration / 4);
  const cpu::ReadLoop& loop = last_available(cpu::read_loops());
  std::size_t next = 0;
  volatile std::uint32_t sum = 0;  // so that the reading is done
  return time_pieces(duration - (clock.now() - begin), 1, [&](std::int64_t steps) {
    for (std::int64_t i = 0; i < steps; ++i) {
      sum = loop.sum(words + next * kWords, kStep);
      next = (next + 1) % stretches;
    }
  });
}

}  // namespace

Jitter measure_jitter(const std::vector<int>& cores, Nanos duration) {
  assert(!cores.empty());
  // A team goes on elsewhere where it cannot be bound: no figure of that core.
  const auto usable = current_cores();
  for (const int core : cores) {
    if (std::ranges::find(usable, core) == usable.end()) {
      throw_environment(
          fmt::format("core {} cannot be used; taskset -p $$ shows which the shell may use", core));
    }
  }
  Jitter found;
  found.cores.resize(cores.size());
  cpu::CoreTeam(cores).run([&](int i) {
    const auto at = static_cast<std::size_t>(i);
    found.cores[at] = {cores[at], time_arithmetic(duration / 2)};
  });
  cpu::CoreTeam({cores.front()}).run([&](int) { found.reading = time_reading(duration / 2); });
  return found;
}

JitterRange range_of(std::span<const Nanos> pieces) {
  const auto middle = static_cast<double>(std::max(Nanos(1), median(pieces)).count());
  return {static_cast<double>(percentile(pieces, 5).count()) / middle,
          static_cast<double>(percentile(pieces, 95).count()) / middle};
}

}  // namespace pirt
