#include "characterize/jitter.h"

#include <algorithm>
#include <array>
#include <exception>
#include <thread>

#include "characterize/measure.h"
#include "characterize/statistics.h"
#include "workloads/base/affinity.h"
#include "workloads/cpu/peak_loops.h"

namespace pirt {
namespace {

constexpr Nanos kPiece = std::chrono::milliseconds(5);
constexpr std::int64_t kFirstSteps = 1024;

struct alignas(64) CacheLine {
  static constexpr std::size_t kValues = 16;
  std::array<float, kValues> values{};
};

/// The loop with the widest vectors: a sibling thread slows it most.
const cpu::ChainLoop& widest_loop() {
  const auto loops = cpu::chain_loops();
  const auto last = std::find_if(loops.rbegin(), loops.rend(),
                                 [](const cpu::ChainLoop& loop) { return loop.available(); });
  return *last;  // the portable ones always are
}

/// On the calling thread.
std::vector<Nanos> time_pieces(Nanos duration) {
  const cpu::ChainLoop& loop = widest_loop();
  const std::size_t count = static_cast<std::size_t>(loop.values) / CacheLine::kValues + 1;
  std::vector<CacheLine> values(count);
  const MachineClock clock;
  const auto timed = [&](std::int64_t steps) {
    const Nanos start = clock.now();
    loop.run(values.front().values.data(), steps);
    return clock.now() - start;
  };
  const Nanos start = clock.now();
  std::int64_t steps = kFirstSteps;
  // The shorter of two, so that an interruption does not look like work.
  while (std::min(timed(steps), timed(steps)) < kPiece) steps *= 2;
  std::vector<Nanos> pieces;
  while (pieces.empty() || clock.now() - start < duration) {
    const Nanos piece = timed(steps);
    if (clock.now() - start >= duration / 5) pieces.push_back(piece);
  }
  return pieces;
}

}  // namespace

std::vector<CoreJitter> measure_jitter(const std::vector<int>& cores, Nanos duration) {
  std::vector<CoreJitter> found(cores.size());
  std::vector<std::exception_ptr> failed(cores.size());
  std::vector<std::jthread> threads;
  threads.reserve(cores.size());
  for (std::size_t i = 0; i < cores.size(); ++i) {
    threads.emplace_back([&, i] {
      try {
        bind_to_cores({&cores[i], 1}, "the jitter check");
        found[i] = {cores[i], time_pieces(duration)};
      } catch (...) {
        failed[i] = std::current_exception();
      }
    });
  }
  threads.clear();  // joins
  for (const auto& error : failed) {
    if (error) std::rethrow_exception(error);
  }
  return found;
}

JitterRange range_of(std::span<const Nanos> pieces) {
  const auto middle = static_cast<double>(std::max(Nanos(1), median(pieces)).count());
  return {static_cast<double>(percentile(pieces, 5).count()) / middle,
          static_cast<double>(percentile(pieces, 95).count()) / middle};
}

}  // namespace pirt
