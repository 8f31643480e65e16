#include "workloads/backends/cpu/peak_loops.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <utility>

#include "workloads/backends/cpu/onednn.h"
#include "workloads/backends/cpu/threads.h"
#include "workloads/base/error.h"
#include "workloads/base/math/peak_math.h"
#include "workloads/base/math/random.h"
#include "workloads/base/system/affinity.h"
#include "workloads/base/system/caches.h"
#include "workloads/base/system/control_groups.h"
#include "workloads/base/system/large_memory.h"

namespace pirt::cpu {
namespace {

using Cores = std::shared_ptr<CoreTeam>;

/// Short enough to be followed value by value when it is checked, long enough that its call costs
/// nothing: 20 us and more.
constexpr std::int64_t kIterations = 16'384;

class ChainPeak final : public PeakLoop {
 public:
  ChainPeak(const ChainLoop& loop, Cores team) : loop_(loop), team_(std::move(team)) {
    for (int i = 0; i < team_->size(); ++i) {
      values_.push_back(
          std::make_unique<LargeMemory>(sizeof(float) * static_cast<std::size_t>(loop.values)));
    }
  }

  [[nodiscard]] PeakKind kind() const override { return PeakKind::kF32; }
  [[nodiscard]] std::string variant() const override { return std::string(loop_.name); }
  [[nodiscard]] double work() const override {
    return 2.0 * static_cast<double>(kIterations) * loop_.values * team_->size();
  }

  void run(int repeats) override {
    team_->run([&](int index) {
      auto* const values = values_[static_cast<std::size_t>(index)]->as<float>();
      for (int r = 0; r < repeats; ++r) {
        for (int i = 0; i < loop_.values; ++i) {
          values[i] = peak_math::start_of(i % peak_math::kStarts);
        }
        loop_.run(values, kIterations);
      }
    });
  }

  [[nodiscard]] Verdict verify() const override {
    using peak_math::Rounding;
    Verdict verdict{.ok = false, .detail = "no way of rounding gives the values found"};
    for (const Rounding rounding : {Rounding::kOnce, Rounding::kTwice}) {
      std::array<float, peak_math::kStarts> expected{};
      for (int i = 0; i < peak_math::kStarts; ++i) {
        expected[static_cast<std::size_t>(i)] =
            peak_math::follow_chain(peak_math::start_of(i), kIterations, rounding);
      }
      if (holds(expected)) return {.ok = true, .detail = "every chain equals its scalar twin"};
    }
    return verdict;
  }

 private:
  [[nodiscard]] bool holds(const std::array<float, peak_math::kStarts>& expected) const {
    return std::ranges::all_of(values_, [&](const auto& memory) {
      for (int i = 0; i < loop_.values; ++i) {
        if (memory->template as<float>()[i] !=
            expected[static_cast<std::size_t>(i % peak_math::kStarts)])
          return false;
      }
      return true;
    });
  }

  const ChainLoop& loop_;
  Cores team_;
  std::vector<std::unique_ptr<LargeMemory>> values_;  ///< Of each core.
};

class DotPeak final : public PeakLoop {
 public:
  DotPeak(const DotLoop& loop, Cores team)
      : loop_(loop),
        team_(std::move(team)),
        data_(static_cast<std::size_t>(DotLoop::kRows * loop.lanes * 4)),
        weights_(static_cast<std::size_t>(loop.weights * loop.lanes * 4)) {
    for (int i = 0; i < DotLoop::kRows * loop.lanes * 4; ++i) {
      data_.as<std::uint8_t>()[i] =
          static_cast<std::uint8_t>(hash_u64(1, static_cast<std::uint64_t>(i)) % 128);
    }
    for (int i = 0; i < loop.weights * loop.lanes * 4; ++i) {
      const auto value = static_cast<int>(hash_u64(2, static_cast<std::uint64_t>(i)) % 128) - 64;
      weights_.as<std::int8_t>()[i] = static_cast<std::int8_t>(value);
    }
    for (int i = 0; i < team_->size(); ++i)
      sums_.push_back(std::make_unique<LargeMemory>(sums_bytes()));
  }

  [[nodiscard]] PeakKind kind() const override { return PeakKind::kInt8; }
  [[nodiscard]] std::string variant() const override { return std::string(loop_.name); }
  [[nodiscard]] double work() const override {
    return 2.0 * 4.0 * static_cast<double>(kIterations) * loop_.lanes * loop_.weights *
           team_->size();
  }

  void run(int repeats) override {
    team_->run([&](int index) {
      auto* const sums = sums_[static_cast<std::size_t>(index)]->as<std::int32_t>();
      for (int r = 0; r < repeats; ++r) {
        std::memset(sums, 0, sums_bytes());
        loop_.run(data_.as<std::uint8_t>(), weights_.as<std::int8_t>(), sums, kIterations);
      }
    });
  }

  [[nodiscard]] Verdict verify() const override {
    static_assert(kIterations % DotLoop::kRows == 0);
    for (int w = 0; w < loop_.weights; ++w) {
      for (int lane = 0; lane < loop_.lanes; ++lane) {
        const std::int64_t expected = kIterations / DotLoop::kRows * dot_of_all_rows(w, lane);
        for (const auto& sums : sums_) {
          const std::int32_t found = sums->as<std::int32_t>()[w * loop_.lanes + lane];
          if (found == expected) continue;
          return {.ok = false, .detail = fmt::format("a sum is {} instead of {}", found, expected)};
        }
      }
    }
    return {.ok = true, .detail = "every sum is exact"};
  }

 private:
  [[nodiscard]] std::size_t sums_bytes() const {
    return sizeof(std::int32_t) * static_cast<std::size_t>(loop_.weights * loop_.lanes);
  }
  [[nodiscard]] std::int64_t dot_of_all_rows(int weight, int lane) const {
    std::int64_t sum = 0;
    for (int row = 0; row < DotLoop::kRows; ++row) {
      for (int k = 0; k < 4; ++k) {
        sum += std::int64_t{data_.as<std::uint8_t>()[(row * loop_.lanes + lane) * 4 + k]} *
               weights_.as<std::int8_t>()[(weight * loop_.lanes + lane) * 4 + k];
      }
    }
    return sum;
  }

  const DotLoop& loop_;
  Cores team_;
  LargeMemory data_, weights_;                      ///< Shared; only read.
  std::vector<std::unique_ptr<LargeMemory>> sums_;  ///< Of each core.
};

/// Memory of each core, filled by that core (which puts it near the core), in stretches one of
/// which a read is, with their sums.
struct Slices {
  std::size_t size_bytes = 0;  ///< Of one slice.
  std::size_t stretch_bytes = 0;
  std::vector<std::unique_ptr<LargeMemory>> memory;
  std::vector<std::vector<std::uint32_t>> sums;  ///< Of each core's stretches.

  Slices(CoreTeam& team, std::size_t slice_bytes, std::size_t most_bytes)
      : size_bytes(slice_bytes),
        stretch_bytes(std::min(slice_bytes, most_bytes)),
        sums(static_cast<std::size_t>(team.size())) {
    for (int i = 0; i < team.size(); ++i) {
      memory.push_back(std::make_unique<LargeMemory>(slice_bytes));
    }
    team.run([&](int index) {
      const auto i = static_cast<std::size_t>(index);
      for (std::size_t s = 0; s < size_bytes / stretch_bytes; ++s) {
        sums[i].push_back(peak_math::fill_words(
            {stretch(i, s), stretch_bytes / sizeof(std::uint32_t)}, hash_u64(i + 1, s)));
      }
    });
  }

  [[nodiscard]] std::uint32_t* stretch(std::size_t core, std::size_t at) const {
    return memory[core]->as<std::uint32_t>() + at * stretch_bytes / sizeof(std::uint32_t);
  }
};

/// One stretch after the other, also from run to run: of the ones before next to nothing is in a
/// cache when they come again, if it is smaller than the slices.
class ReadPeak final : public PeakLoop {
 public:
  ReadPeak(const ReadLoop& loop, PeakKind kind, Cores team, std::shared_ptr<const Slices> slices)
      : loop_(loop), kind_(kind), team_(std::move(team)), slices_(std::move(slices)) {
    read_.resize(slices_->sums.size());
  }

  [[nodiscard]] PeakKind kind() const override { return kind_; }
  [[nodiscard]] std::string variant() const override {
    return fmt::format("{}, {} kB a core", loop_.name, slices_->size_bytes / 1024);
  }
  [[nodiscard]] double work() const override {
    return static_cast<double>(slices_->stretch_bytes) * team_->size();
  }

  void run(int repeats) override {
    team_->run([&](int index) {
      const auto i = static_cast<std::size_t>(index);
      Read read{.next = read_[i].next};
      for (int r = 0; r < repeats; ++r) {
        read.found += loop_.sum(slices_->stretch(i, read.next), slices_->stretch_bytes);
        read.expected += slices_->sums[i][read.next];
        read.next = (read.next + 1) % slices_->sums[i].size();
      }
      read_[i] = read;
    });
    ran_ = repeats > 0;
  }

  [[nodiscard]] Verdict verify() const override {
    if (!ran_) return {.ok = false, .detail = "nothing was read yet"};
    for (const Read& read : read_) {
      if (read.found == read.expected) continue;
      return {.ok = false,
              .detail = fmt::format("a sum is {} instead of {}", read.found, read.expected)};
    }
    return {.ok = true, .detail = "every sum is exact"};
  }

 private:
  /// Of one core.
  struct alignas(64) Read {
    std::uint32_t found = 0, expected = 0;  ///< Of the last run.
    std::size_t next = 0;
  };

  const ReadLoop& loop_;
  PeakKind kind_;
  Cores team_;
  std::shared_ptr<const Slices> slices_;
  std::vector<Read> read_;  ///< By core.
  bool ran_ = false;
};

void add_reads(PeakKind kind, std::size_t slice_bytes, const Cores& team, PeakLoops& all) {
  constexpr std::size_t kMostAtOnce = std::size_t{1} << 20U;  // 0.1 ms of a core's: a few a sample
  const auto slices = std::make_shared<const Slices>(*team, slice_bytes, kMostAtOnce);
  for (const ReadLoop& loop : read_loops()) {
    if (loop.available()) all.loops.push_back(std::make_unique<ReadPeak>(loop, kind, team, slices));
  }
}

std::size_t rounded_down(std::int64_t bytes) {
  const auto grain = static_cast<std::int64_t>(ReadLoop::kGrain);
  return static_cast<std::size_t>(std::max(bytes / grain, std::int64_t{1}) * grain);
}

/// Half a core's L2: what else is in use finds room beside it.
void add_l2_reads(const CacheSizes& caches, const Cores& team, PeakLoops& all) {
  if (!caches.l2_bytes) {
    all.unavailable[PeakKind::kBandwidthL2] = "the machine does not say how large its caches are";
    return;
  }
  add_reads(PeakKind::kBandwidthL2, rounded_down(*caches.l2_bytes / 2), team, all);
}

void add_memory_reads(const Cores& team, PeakLoops& all) {
  const auto total = memory_read_bytes(all_last_cache_bytes(), most_filled_bytes());
  if (!total) {
    all.unavailable[PeakKind::kBandwidthMemory] =
        "this process has too little memory to exceed the machine's caches";
    return;
  }
  add_reads(PeakKind::kBandwidthMemory, rounded_down(*total / team->size()), team, all);
}

void add_matmul(PeakKind kind, int threads, PeakLoops& all) {
  try {
    all.loops.push_back(make_matmul_loop(kind, threads));
  } catch (const dnnl::error& error) {
    // Then the other loops stand alone; without any, this is why.
    all.unavailable[kind] =
        fmt::format("oneDNN has no product of such matrices here ({})", error.what());
  }
}

}  // namespace

std::optional<std::int64_t> memory_read_bytes(std::optional<std::int64_t> caches,
                                              std::int64_t most) {
  constexpr std::int64_t kWithoutCacheSizes = std::int64_t{128} << 20;
  constexpr std::int64_t kSoon = std::int64_t{1} << 30;
  if (!caches) return std::min(kWithoutCacheSizes, most);
  const std::int64_t total = std::min(std::max(2 * *caches, std::min(4 * *caches, kSoon)), most);
  return total < 2 * *caches ? std::nullopt : std::optional(total);
}

PeakLoops make_peak_loops(int threads) {
  const auto cores = current_cores();
  const auto team = std::make_shared<CoreTeam>(cores);
  const CacheSizes caches = read_cache_sizes(cores.front());
  PeakLoops all;
  for (const ChainLoop& loop : chain_loops()) {
    if (loop.available()) all.loops.push_back(std::make_unique<ChainPeak>(loop, team));
  }
  for (const DotLoop& loop : dot_loops()) {
    if (loop.available()) all.loops.push_back(std::make_unique<DotPeak>(loop, team));
  }
  add_matmul(PeakKind::kF32, threads, all);
  add_matmul(PeakKind::kInt8, threads, all);
  add_l2_reads(caches, team, all);
  add_memory_reads(team, all);
  for (const auto& loop : all.loops) all.unavailable.erase(loop->kind());
  return all;
}

}  // namespace pirt::cpu
