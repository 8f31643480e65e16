// A benchmark of Google Benchmark that `pirt regress --reads gbench` compares with itself, with
// more work or without.
//
// Usage: benchmark [--work=FACTOR] [--benchmark_...]
#include <benchmark/benchmark.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <utility>
#include <vector>

namespace {

double work = 1;

std::int64_t steps(std::int64_t count) {
  return static_cast<std::int64_t>(static_cast<double>(count) * work);
}

/// A chain of multiplications: as long as it has steps.
void chain(benchmark::State& state) {
  for (auto _ : state) {
    std::uint64_t value = 1;
    for (std::int64_t i = 0; i < steps(state.range(0)); ++i) {
      value = value * 6364136223846793005U + 1;
    }
    benchmark::DoNotOptimize(value);
  }
}
BENCHMARK(chain)->Arg(20'000)->MinTime(0.05);

void sum(benchmark::State& state) {
  const std::vector<std::uint32_t> values(static_cast<std::size_t>(steps(state.range(0))), 3);
  for (auto _ : state) {
    benchmark::DoNotOptimize(std::accumulate(values.begin(), values.end(), std::uint64_t{0}));
  }
}
BENCHMARK(sum)->Arg(50'000)->MinTime(0.05);

}  // namespace

int main(int argc, char** argv) {
  constexpr const char* kWork = "--work=";
  if (argc > 1 && std::strncmp(argv[1], kWork, std::strlen(kWork)) == 0) {
    work = std::strtod(argv[1] + std::strlen(kWork), nullptr);
    std::swap(argv[0], argv[1]);
    ++argv;
    --argc;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
