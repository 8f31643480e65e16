// One case of a task's cost alone, for a tool that counts instructions
// (tests/bench/instructions.sh) or a stopwatch.
//
// Usage: task_cost CASE TASKS; without arguments it names the cases.
#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>

#include "scheduler/runtime/runtime.h"
#include "scheduler/schedule.h"

namespace {

using Clock = std::chrono::steady_clock;
/// Makes what the case needs, and returns what does it.
using Case = std::function<std::function<void()>(int tasks)>;

constexpr const char* kThreeUnits = R"(
platform: three
units:
  gpu: {slots: 1}
  dsp: {slots: 1}
  cpu: {slots: 1}
workloads:
  convolution:
    gpu: [{on: gpu, ms: 1.3}]
    dsp: [{on: dsp, ms: 3.7}]
    cpu: [{on: cpu, ms: 2.9}]
modes:
  throughput: {weights: {gpu: 2, cpu: 2, dsp: 2}, in_flight: 6}
)";

std::string loop_mix(int tasks) {
  return fmt::format(
      "mix: loop\npipelines: {{p: {{closed_loop: {{frames: {}}}, tasks: [{{workload: "
      "convolution}}]}}}}\n",
      tasks);
}

/// Units that differ by a little, so that no two tasks end at once.
std::string many_units(int units) {
  std::string names = "platform: many\nunits:\n";
  std::string services = "workloads:\n  convolution:\n";
  for (int i = 0; i < units; ++i) {
    names += fmt::format("  u{}: {{role: cpu, slots: 1}}\n", i);
    services += fmt::format("    u{}: [{{on: u{}, ms: {:.3f}}}]\n", i, i, 1 + 0.013 * i);
  }
  return names + services;
}

Case virtual_case(std::string platform, std::function<std::string(int)> mix, std::string mode,
                  int in_flight) {
  return [=](int tasks) {
    return [=] {
      pirt::ScheduleOptions options;
      options.mode = mode;
      if (in_flight > 0) options.in_flight = in_flight;
      const auto parsed = pirt::parse_platform("bench", platform, {}, 4);
      const auto record =
          pirt::run_virtual(parsed, nullptr, pirt::parse_mix("bench", mix(tasks)), options);
      if (record.completed != tasks) std::abort();
    };
  };
}

/// A robot's mix for as long as it takes to submit so many.
Case robot_case() {
  return [](int tasks) {
    return [tasks] {
      const auto mix = pirt::load_mix("table1-robot");
      double rate = 0;
      for (const auto& pipeline : mix.pipelines) {
        rate += pipeline.rate_hz.value_or(0) * static_cast<double>(pipeline.tasks.size());
      }
      pirt::ScheduleOptions options;
      options.mode = "edf";
      options.duration = pirt::from_s(tasks / rate);
      static_cast<void>(pirt::run_virtual(pirt::load_platform("fake"), nullptr, mix, options));
    };
  };
}

/// One firing of so many tasks.
std::string graph(int tasks, bool chain) {
  std::string text = "mix: graph\npipelines:\n  p:\n    closed_loop: {frames: 1}\n    tasks:\n";
  for (int i = 0; i < tasks; ++i) {
    text += fmt::format("      - {{name: t{}, workload: convolution", i);
    if (chain && i > 0) text += fmt::format(", after: [t{}]", i - 1);
    text += "}\n";
  }
  return text;
}

Case runtime_case(std::string mode, bool chain) {
  return [mode = std::move(mode), chain](int tasks) {
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
    const auto runtime = std::make_shared<pirt::Runtime>(std::move(options));
    return [=] {
      std::atomic<int> heard = 0;
      const auto hear = [&](const pirt::TaskFuture&, pirt::TaskEnd) { ++heard; };
      pirt::TaskFuture last;
      for (int i = 0; i < tasks; ++i) {
        pirt::TaskOptions each;
        if (chain && last.valid()) each.after.push_back(last);
        last = runtime->submit("empty", {}, std::move(each), hear);
      }
      runtime->wait_all();
      if (heard != tasks) std::abort();
    };
  };
}

std::map<std::string, Case> cases() {
  std::map<std::string, Case> all;
  all["loop"] = virtual_case(kThreeUnits, loop_mix, "throughput", 0);
  for (const int units : {4, 64}) {
    for (const char* mode : {"olb", "ect"}) {
      all[fmt::format("{}{}", mode, units)] =
          virtual_case(many_units(units), loop_mix, mode, 2 * units);
    }
  }
  for (const bool chain : {false, true}) {
    all[chain ? "graph-chain" : "graph-independent"] = virtual_case(
        kThreeUnits, [chain](int tasks) { return graph(tasks, chain); }, "ect", 0);
    const std::string name = chain ? "live-chain" : "live-independent";
    all[name] = runtime_case("olb", chain);
    all[name + "-latency"] = runtime_case("latency", chain);
  }
  all["robot"] = robot_case();
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const auto all = cases();
  if (argc != 3 || !all.contains(argv[1])) {
    for (const auto& [name, unused] : all) fmt::print("{}\n", name);
    return 2;
  }
  const int tasks = std::atoi(argv[2]);
  const auto run = all.at(argv[1])(tasks);
  const auto begin = Clock::now();
  run();
  const double elapsed_s = std::chrono::duration<double>(Clock::now() - begin).count();
  fmt::print("{} {} tasks: {:.4f} us a task\n", argv[1], tasks, elapsed_s * 1e6 / tasks);
}
