// The loops behind measured peaks compute what they say, and notice when they do not.
#include "workloads/backends/cpu/peak_loops.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <numeric>

#include "tests/support/few_threads.h"
#include "tests/support/optional_backend.h"
#include "workloads/backends/cpu/core_team.h"
#include "workloads/backends/registry.h"
#include "workloads/base/math/peak_math.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"

namespace pirt {
namespace {

template <typename T>
struct Aligned {
  explicit Aligned(std::size_t count) : memory(count * sizeof(T) + 64) {
    void* at = memory.data();
    std::size_t space = memory.size();
    data = static_cast<T*>(std::align(64, count * sizeof(T), at, space));
  }
  std::vector<std::byte> memory;
  T* data;
};

/// Every loop of a backend: wrong before it ran, right after one and after several repeats.
void check_all_loops(std::string_view backend) {
  const Backend& found = find_backend(backend);
  if (!found.probe().available) GTEST_SKIP() << found.probe().reason;
  const auto device = found.open({.unit = "test", .cores = {}, .device = {}, .script = {}});
  const PeakLoops all = device->peak_loops();
  ASSERT_GE(all.loops.size(), 4U);
  for (const auto& loop : all.loops) {
    EXPECT_FALSE(all.unavailable.contains(loop->kind())) << loop->variant();
    EXPECT_FALSE(loop->verify().ok) << loop->variant() << " is right before it ran";
    EXPECT_GT(loop->work(), 0);
    for (const int repeats : {1, 3}) {
      loop->run(repeats);
      const Verdict verdict = loop->verify();
      EXPECT_TRUE(verdict.ok) << loop->variant() << ": " << verdict.detail;
    }
  }
  for (const PeakKind kind : kAllPeakKinds) {
    const bool has =
        std::ranges::any_of(all.loops, [&](const auto& l) { return l->kind() == kind; });
    EXPECT_NE(has, all.unavailable.contains(kind)) << to_string(kind);
  }
}

TEST(PeakLoops, OfTheCpuLeaveWhatTheirWorkLeaves) { check_all_loops("cpu"); }
TEST(PeakLoops, OfOpenClLeaveWhatTheirWorkLeaves) {
  PIRT_BACKEND_OR_SKIP("opencl")
  check_all_loops("opencl");
}

TEST(PeakLoops, ChainsTakeExactlyTheStepsAskedFor) {
  using peak_math::Rounding;
  for (const auto& loop : cpu::chain_loops()) {
    if (!loop.available()) continue;
    for (const std::int64_t steps : {0, 1, 2, 1000}) {
      Aligned<float> values(static_cast<std::size_t>(loop.values));
      for (int i = 0; i < loop.values; ++i) values.data[i] = 1.0F + static_cast<float>(i) / 512;
      loop.run(values.data, steps);
      for (int i = 0; i < loop.values; ++i) {
        const float start = 1.0F + static_cast<float>(i) / 512;
        const float once = peak_math::follow_chain(start, steps, Rounding::kOnce);
        const float twice = peak_math::follow_chain(start, steps, Rounding::kTwice);
        EXPECT_TRUE(values.data[i] == once || values.data[i] == twice) << loop.name << " " << i;
      }
    }
  }
}

TEST(PeakLoops, AChainThatStopsEarlyIsTold) {
  // What verify() compares with: one step in 16384 less is another value.
  const auto full = peak_math::follow_chain(1.5F, 16'384, peak_math::Rounding::kOnce);
  EXPECT_NE(full, peak_math::follow_chain(1.5F, 16'383, peak_math::Rounding::kOnce));
  EXPECT_NEAR(full, 0.75 + 0.75 * std::exp(-16'384 / 131'072.0), 1e-4);
}

TEST(PeakLoops, DotsAreThoseOfFourBytes) {
  for (const auto& loop : cpu::dot_loops()) {
    if (!loop.available()) continue;
    const auto lanes = static_cast<std::size_t>(loop.lanes);
    const auto registers = static_cast<std::size_t>(loop.weights);
    Aligned<std::uint8_t> data(cpu::DotLoop::kRows * lanes * 4);
    Aligned<std::int8_t> weights(registers * lanes * 4);
    Aligned<std::int32_t> sums(registers * lanes);
    // The largest magnitudes: what saturates somewhere shows here.
    std::fill_n(data.data, cpu::DotLoop::kRows * lanes * 4, std::uint8_t{127});
    std::fill_n(weights.data, registers * lanes * 4, std::int8_t{-64});
    std::fill_n(sums.data, registers * lanes, 5);
    loop.run(data.data, weights.data, sums.data, 4);
    for (std::size_t i = 0; i < registers * lanes; ++i) {
      EXPECT_EQ(sums.data[i], 5 - 4 * 4 * 127 * 64) << loop.name;
    }
  }
}

TEST(PeakLoops, ReadsTakeEveryWordOnce) {
  for (const auto& loop : cpu::read_loops()) {
    if (!loop.available()) continue;
    for (const std::size_t grains : {1U, 3U, 16U}) {
      const std::size_t size_bytes = grains * cpu::ReadLoop::kGrain;
      Aligned<std::uint32_t> words(size_bytes / 4);
      const auto expected = peak_math::fill_words({words.data, size_bytes / 4}, grains);
      EXPECT_EQ(expected, std::accumulate(words.data, words.data + size_bytes / 4, 0U));
      EXPECT_EQ(loop.sum(words.data, size_bytes), expected) << loop.name;
      words.data[size_bytes / 8] ^= 1U;  // each word counts
      EXPECT_NE(loop.sum(words.data, size_bytes), expected) << loop.name;
    }
  }
}

TEST(PeakLoops, ReadNoMoreOfTheMemoryThanTheProcessMayFill) {
  constexpr std::int64_t kMega = std::int64_t{1} << 20, kMuch = std::int64_t{1} << 40;
  EXPECT_EQ(cpu::memory_read_bytes(32 * kMega, kMuch), 128 * kMega);
  EXPECT_EQ(cpu::memory_read_bytes(400 * kMega, kMuch), 1024 * kMega);
  EXPECT_EQ(cpu::memory_read_bytes(800 * kMega, kMuch), 1600 * kMega);
  EXPECT_EQ(cpu::memory_read_bytes(32 * kMega, 64 * kMega), 64 * kMega);
  EXPECT_EQ(cpu::memory_read_bytes(32 * kMega, 63 * kMega), std::nullopt);
  EXPECT_EQ(cpu::memory_read_bytes(std::nullopt, kMuch), 128 * kMega);
  EXPECT_EQ(cpu::memory_read_bytes(std::nullopt, 50 * kMega), 50 * kMega);
}

TEST(CoreTeam, RunsOnEachOfItsCoresAndAgain) {
  const auto cores = current_cores();
  cpu::CoreTeam team(cores);
  std::vector<std::vector<int>> ran_on(cores.size());
  std::atomic<int> calls = 0;
  for (int round = 0; round < 3; ++round) {
    team.run([&](int index) {
      ran_on[static_cast<std::size_t>(index)] = current_cores();
      ++calls;
    });
  }
  EXPECT_EQ(calls, 3 * team.size());
  for (std::size_t i = 0; i < cores.size(); ++i) EXPECT_EQ(ran_on[i], std::vector{cores[i]});
}

TEST(CoreTeam, EndsWhenOneOfItsThreadsCannotStart) {
  const std::vector<int> cores(3, current_cores().front());
  for (const int threads : {0, 1, 2}) {
    EXPECT_EQ(test::with_threads(threads, [&] { cpu::CoreTeam team(cores); }),
              "cannot start a thread")
        << threads;
  }
  EXPECT_EQ(test::with_threads(3, [&] { cpu::CoreTeam team(cores); }), "nothing");
}

TEST(PeakKinds, AreWrittenAsInTheDatabase) {
  for (const PeakKind kind : kAllPeakKinds) {
    EXPECT_EQ(peak_kind_from_string(to_string(kind)), kind);
  }
  EXPECT_EQ(to_string(PeakKind::kBandwidthMemory), "bandwidth_memory");
  EXPECT_EQ(peak_kind_from_string("f64"), std::nullopt);
}

}  // namespace
}  // namespace pirt
