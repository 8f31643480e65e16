// What the harness adds to a sample: the same work timed by sample_calls, through the virtual
// calls, batches and clock readings of a campaign, and by a bare loop, in turns. Goal: below 0.5 %.
//
// Usage: harness [PAIRS]   pairs of samples for each length of a call; default 400
#include <fmt/format.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "characterize/statistics/statistics.h"
#include "characterize/worker/measure.h"

namespace {

using pirt::Nanos;

/// Work that no compiler shortens: a chain of dependent multiplications.
std::uint64_t work(std::int64_t steps) {
  static volatile std::uint64_t seed = 88172645463325252ULL;
  std::uint64_t x = seed;
  for (std::int64_t i = 0; i < steps; ++i) x = x * 6364136223846793005ULL + 1442695040888963407ULL;
  seed = x;
  return x;
}

class WorkKernel : public pirt::Kernel {
 public:
  explicit WorkKernel(std::int64_t steps) : steps_(steps) {}
  void bind(std::span<const pirt::Tensor>, std::span<pirt::Tensor>) override {}
  void upload() override {}
  std::optional<Nanos> execute(int) override {
    work(steps_);
    return std::nullopt;
  }
  void download() override {}

 private:
  std::int64_t steps_;
};

/// One sample of `call`, and its batch.
struct Sample {
  double ns = 0;
  std::int64_t batch = 1;
};

Sample sampled(WorkKernel& kernel, const pirt::Clock& clock, const pirt::ClockQuality& quality) {
  constexpr std::array kPhases = {pirt::Phase::kExecute, pirt::Phase::kCall};
  pirt::SamplingOptions once;
  once.warm_up = once.slice = Nanos(0);
  once.min_samples = once.max_samples = 1;
  const auto phases = pirt::sample_calls(kernel, clock, quality, kPhases, once);
  return {static_cast<double>(phases.back().samples.front().count()), phases.back().batch};
}

double bare(std::int64_t steps, std::int64_t calls, const pirt::Clock& clock) {
  const Nanos start = clock.now();
  for (std::int64_t i = 0; i < calls; ++i) work(steps);
  const Nanos end = clock.now();
  return static_cast<double>((end - start).count()) / static_cast<double>(calls);
}

/// Median of sampled / bare - 1 over pairs in turns (first one, then the other, and back).
double overhead(std::int64_t steps, int pairs, const pirt::Clock& clock,
                const pirt::ClockQuality& quality) {
  WorkKernel kernel(steps);
  std::vector<Nanos> ratios;  // in parts per thousand million, for the median of integers
  std::int64_t batch = sampled(kernel, clock, quality).batch;
  for (int i = 0; i < pairs; ++i) {
    double loop = 0;
    if (i % 2 == 0) loop = bare(steps, batch, clock);
    const Sample sample = sampled(kernel, clock, quality);
    if (i % 2 != 0) loop = bare(steps, sample.batch, clock);
    batch = sample.batch;
    ratios.emplace_back(static_cast<std::int64_t>(1e9 * sample.ns / loop));
  }
  return static_cast<double>(pirt::median(ratios).count()) * 1e-9 - 1;
}

}  // namespace

int main(int argc, char** argv) {
  const int pairs = argc > 1 ? std::atoi(argv[1]) : 400;
  if (pairs < 10) {
    std::fputs("usage: harness [PAIRS]   at least 10\n", stderr);
    return 2;
  }
  const pirt::MachineClock clock;
  const pirt::ClockQuality quality = pirt::measure_clock(clock);
  const double step_ns = bare(1'000'000, 20, clock) / 1e6;
  fmt::print("clock: {:.1f} ns a reading\n", quality.cost_ns);
  double worst = 0;
  for (const double call_us : {1.0, 10.0, 100.0, 1'000.0, 5'000.0}) {
    const auto steps = static_cast<std::int64_t>(call_us * 1e3 / step_ns);
    const double found = overhead(steps, pairs, clock, quality);
    worst = std::max(worst, found);
    fmt::print("call of {:>6} us: {:+.3f} % of a sample ({} pairs)\n", call_us, 100 * found, pairs);
  }
  fmt::print("largest: {:.3f} %, goal: below 0.5 %\n", 100 * worst);
  return worst < 0.005 ? 0 : 1;
}
