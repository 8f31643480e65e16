// What a task costs: submit, decide, queue, run an empty kernel, callback; beside StarPU and oneTBB
// where those are installed (libstarpu-dev, libtbb-dev), and mode by mode.
//
// Usage: runtime [tasks] [rounds]; default 65536 7. All in turns in each round; medians.
#include "scheduler/runtime/runtime.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "tests/bench/peers/tasks.h"

namespace {

using Clock = std::chrono::steady_clock;

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

pirt::RuntimeOptions two_units(const std::string& mode) {
  pirt::RuntimeOptions options;
  options.platform = pirt::parse_platform("bench", R"(
platform: bench
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  dsp: {backend: cpu, cores: all, slots: 1, active_w: 1}
)",
                                          {}, 2);
  options.mode = mode;
  const auto nothing = [](std::span<const pirt::Tensor>, std::span<pirt::Tensor>) {};
  options.own.push_back(
      {.name = "empty", .inputs = {}, .outputs = {}, .kernels = {{"cpu", nothing}}});
  return options;
}

double run(pirt::Runtime& runtime, int tasks, bool chain) {
  std::atomic<int> heard = 0;
  const auto hear = [&](const pirt::TaskFuture&, pirt::TaskEnd) { ++heard; };
  const auto begin = Clock::now();
  pirt::TaskFuture last;
  for (int i = 0; i < tasks; ++i) {
    pirt::TaskOptions options;
    if (chain && last.valid()) options.after.push_back(last);
    last = runtime.submit("empty", {}, std::move(options), hear);
  }
  runtime.wait_all();
  const double elapsed_s = std::chrono::duration<double>(Clock::now() - begin).count();
  if (heard != tasks) std::abort();
  return elapsed_s;
}

}  // namespace

int main(int argc, char** argv) {
  const int tasks = argc > 1 ? std::atoi(argv[1]) : 65'536;
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 7;
  std::map<std::string, std::unique_ptr<pirt::Runtime>> ours;
  for (const char* mode : {"olb", "latency", "throughput", "energy", "advanced"}) {
    ours[mode] = std::make_unique<pirt::Runtime>(two_units(mode));
  }
  const auto peers = pirt::bench::task_peers();
  bool good = true;
  for (const bool chain : {false, true}) {
    std::map<std::string, std::vector<double>> us;
    for (int round = 0; round < rounds; ++round) {
      for (auto& [mode, runtime] : ours)
        us[mode].push_back(run(*runtime, tasks, chain) * 1e6 / tasks);
      for (const auto& peer : peers) us[peer.name].push_back(peer.run(tasks, chain) * 1e6 / tasks);
    }
    const double olb = median(us["olb"]);
    fmt::print("{} {}, {} rounds in turn, us a task\n", tasks,
               chain ? "tasks in a chain" : "independent tasks", rounds);
    for (const auto& [name, values] : us) {
      fmt::print("  {:<18} {:6.3f} ({:.3f} to {:.3f}); {:.2f} of olb\n", name, median(values),
                 std::ranges::min(values), std::ranges::max(values), median(values) / olb);
      if (ours.contains(name)) good = good && median(values) <= 1.3 * olb;
      if (name.starts_with("StarPU")) good = good && olb <= median(values) / 3;
    }
  }
  fmt::print("goals: olb at most 1/3 of StarPU, the paper's modes at most 1.3 of olb: {}\n",
             good ? "met" : "missed");
  return good ? 0 : 1;
}
