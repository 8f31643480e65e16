// What a task costs: submit, decide, queue, run an empty kernel, callback; beside StarPU and oneTBB
// where those are installed (libstarpu-dev, libtbb-dev), mode by mode, and from several threads.
// What it takes until a unit that sleeps has begun a task, beside a bare futex; and how often a
// runtime with nothing to do wakes.
//
// Usage: runtime [tasks] [rounds]; default 65536 7. All in turns in each round; medians.
#include "scheduler/runtime/runtime.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "scheduler/runtime/threads.h"
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
  options.workloads.emplace_back(pirt::OwnWorkload{
      .name = "empty", .inputs = {}, .outputs = {}, .kernels = {{"cpu", nothing}}});
  return options;
}

double run(pirt::Runtime& runtime, int tasks, bool chain) {
  std::atomic<int> heard = 0;
  const auto hear = [&](const pirt::TaskFuture&, pirt::TaskEnd) { ++heard; };
  const auto begin = Clock::now();
  const auto empty = runtime.workload("empty");
  pirt::TaskFuture last;
  for (int i = 0; i < tasks; ++i) {
    pirt::TaskOptions options;
    if (chain && last.valid()) options.after.push_back(last);
    last = runtime.submit(empty, {}, std::move(options), hear);
  }
  runtime.wait_all();
  const double elapsed_s = std::chrono::duration<double>(Clock::now() - begin).count();
  if (heard != tasks) std::abort();
  return elapsed_s;
}

/// Independent tasks, of which each thread submits its share.
double run_from(pirt::Runtime& runtime, int tasks, int threads) {
  const auto empty = runtime.workload("empty");
  const auto begin = Clock::now();
  {
    std::vector<std::jthread> submitting;
    for (int i = 0; i < threads; ++i) {
      submitting.emplace_back([&] {
        for (int task = 0; task < tasks / threads; ++task) runtime.submit(empty, {});
      });
    }
  }
  runtime.wait_all();
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

double us_between(Clock::time_point begin, Clock::time_point end) {
  return std::chrono::duration<double, std::micro>(end - begin).count();
}

/// From submit to the beginning of the kernel, and from a bare wake to the end of a bare wait, each
/// after such a sleep.
struct WakeUps {
  double task_us = 0, futex_us = 0;
};
WakeUps wake_ups(std::chrono::microseconds sleep, int samples) {
  auto options = two_units("olb");
  options.spin = pirt::Nanos(0);
  Clock::time_point begun;
  std::get<pirt::OwnWorkload>(options.workloads.front()).kernels = {
      {"cpu", [&](auto, auto) { begun = Clock::now(); }}};
  pirt::Runtime runtime(std::move(options));
  const auto task = runtime.workload("empty");

  pirt::runtime::FutexWord word = 0;
  pirt::runtime::FutexWord answers = 0;
  std::atomic<bool> stop = false;
  Clock::time_point woken;
  std::jthread sleeper([&] {
    for (std::uint32_t seen = 0; !stop; ++seen) {
      while (word == seen) pirt::runtime::futex_wait(word, seen);
      woken = Clock::now();
      ++answers;
      pirt::runtime::futex_wake(answers, 1);
    }
  });
  std::vector<double> task_us, futex_us;
  for (int i = 0; i < samples; ++i) {
    std::this_thread::sleep_for(sleep);
    auto begin = Clock::now();
    runtime.submit(task, {}).wait();
    task_us.push_back(us_between(begin, begun));
    std::this_thread::sleep_for(sleep);
    const std::uint32_t seen = answers;
    begin = Clock::now();
    ++word;
    pirt::runtime::futex_wake(word, 1);
    while (answers == seen) pirt::runtime::futex_wait(answers, seen);
    futex_us.push_back(us_between(begin, woken));
  }
  stop = true;
  ++word;
  pirt::runtime::futex_wake(word, 1);
  return {median(task_us), median(futex_us)};
}

/// How often threads of this process but the calling one have gone to sleep so far.
long sleeps() {
  long total = 0;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
    if (thread.path().filename() == std::to_string(::gettid())) continue;
    std::ifstream status(thread.path() / "status");
    for (std::string key; status >> key; status.ignore(4096, '\n')) {
      if (long count = 0; key == "voluntary_ctxt_switches:" && status >> count) total += count;
    }
  }
  return total;
}

/// Of a runtime that has computed and has nothing to do.
double wake_ups_a_second() {
  pirt::Runtime runtime(two_units("olb"));
  run(runtime, 1000, false);
  std::this_thread::sleep_for(std::chrono::seconds(8));  // It looks after calls once more.
  const long before = sleeps();
  constexpr int kSeconds = 5;
  std::this_thread::sleep_for(std::chrono::seconds(kSeconds));
  return static_cast<double>(sleeps() - before) / kSeconds;
}

}  // namespace

int main(int argc, char** argv) {
  const int tasks = argc > 1 ? std::atoi(argv[1]) : 65'536;
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 7;
  // Before others have threads.
  const double idle = wake_ups_a_second();
  fmt::print("a runtime with nothing to do: {} wake-ups a second\n", idle);
  bool good = idle == 0;
  for (const int ms10 : {1, 100}) {
    const auto sleep = std::chrono::microseconds(100 * ms10);
    const WakeUps us = wake_ups(sleep, 200);
    fmt::print(
        "after {:.1f} ms of sleep: a task begins in {:.1f} us, a bare futex in {:.1f}; {:.2f}\n",
        0.1 * ms10, us.task_us, us.futex_us, us.task_us / us.futex_us);
    good = good && us.task_us <= 1.2 * us.futex_us;
  }
  std::map<std::string, std::unique_ptr<pirt::Runtime>> ours;
  for (const char* mode : {"olb", "latency", "throughput", "energy", "advanced"}) {
    ours[mode] = std::make_unique<pirt::Runtime>(two_units(mode));
  }
  const auto peers = pirt::bench::task_peers();
  {
    std::map<int, std::vector<double>> us;
    for (int round = 0; round < rounds; ++round) {
      for (const int threads : {1, 2, 4}) {
        us[threads].push_back(run_from(*ours["olb"], tasks, threads) * 1e6 / tasks);
      }
    }
    const double one = median(us[1]);
    for (const auto& [threads, values] : us) {
      fmt::print("{} tasks from {} threads: {:.3f} us a task; {:.2f} of one\n", tasks, threads,
                 median(values), median(values) / one);
      good = good && median(values) <= 1.3 * one;
    }
  }
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
      if (name.starts_with("oneTBB") && !chain) good = good && olb <= 2.5 * median(values);
    }
  }
  fmt::print(
      "goals: no wake-up, a task at most 1.2 of a futex, several threads and the paper's modes at "
      "most 1.3 of one and of olb, olb at most 2.5 of oneTBB: {}\n",
      good ? "met" : "missed");
  return good ? 0 : 1;
}
