// The kernels of one unit of platform host through Google Benchmark, as its users would write it: a
// call (upload, execute, download) in the timed loop. Peer of tests/bench/aa, which runs it.
//
// Usage: aa_google UNIT [--benchmark_...]
#include <benchmark/benchmark.h>

#include <cstdio>
#include <memory>

#include "characterize/platform/platform.h"
#include "characterize/platform/unit_request.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/player.h"

namespace {

using namespace pirt;  // NOLINT: a program of one page

void call(benchmark::State& state, Device& device, const Workload& workload) {
  const auto images = generated_images(1);
  const Data data = workload.make_data({1, images.get()});
  Player player(device.prepare(workload, data.parameters), workload, std::span(&data, 1));
  player.call();  // which ends `prepare`: drivers compile a kernel when it first runs
  for (auto unused : state) player.call();
}

int run(int argc, char** argv) {
  if (argc < 2) {
    std::fputs("usage: aa_google UNIT [--benchmark_...]\n", stderr);
    return kExitBadInput;
  }
  const auto platform = load_platform("host");
  const auto& unit = platform.unit(argv[1]);
  const auto& backend = find_backend(unit.backend);
  const auto request = make_unit_request(platform, unit);
  const auto device = backend.open(request);
  for (const Workload& workload : catalog()) {
    if (!backend.supports_on(request, workload).ok) continue;
    benchmark::RegisterBenchmark(workload.name.c_str(), [&device,
                                                         &workload](benchmark::State& state) {
      call(state, *device, workload);
    })->UseRealTime();
  }
  int rest = argc - 1;
  benchmark::Initialize(&rest, argv + 1);
  return benchmark::RunSpecifiedBenchmarks() > 0 ? 0 : kExitBadInput;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const Error& error) {
    std::fprintf(stderr, "aa_google: %s\n", error.what());
    return exit_code(error.code());
  }
}
