// What mode budget reaches, beside its goals: a line each.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "scheduler/mix/dag_generator.h"
#include "scheduler/schedule.h"
#include "workloads/base/math/random.h"

namespace pirt::bench {

inline RunRecord run_mode(const Platform& platform, const Profile* profile, const Mix& mix,
                          const std::string& mode, ScheduleOptions options = {}) {
  options.mode = mode;
  return run_virtual(platform, profile, mix, options);
}

inline void print_closed_loops() {
  const auto platform = load_platform("snapdragon820");
  const auto mix = load_mix("convolution-1000");
  const auto row = [](const std::string& what, const RunRecord& run, const RunRecord& against) {
    fmt::print(
        "budget {:<34} tasks/ms {:.4f} ({:.3f}x)  mean ms {:.2f} ({:.3f}x)  p99 ms {:.2f} "
        "({:.3f}x)  energy J {:.3f} ({:.3f}x)\n",
        what, *run.throughput_per_ms, *run.throughput_per_ms / *against.throughput_per_ms,
        *run.mean_latency_ms, *run.mean_latency_ms / *against.mean_latency_ms, *run.p99_latency_ms,
        *run.p99_latency_ms / *against.p99_latency_ms, *run.energy_j,
        *run.energy_j / *against.energy_j);
  };
  row("of mode throughput", run_mode(platform, nullptr, mix, "budget"),
      run_mode(platform, nullptr, mix, "throughput"));
  ScheduleOptions options;
  options.in_flight = 4;
  const auto latency = run_mode(platform, nullptr, mix, "latency", options);
  row("4 in flight, of mode latency", run_mode(platform, nullptr, mix, "budget", options), latency);
  options.objective = Objective::kEnergy;
  options.min_rate_per_ms = 1.13 * *latency.throughput_per_ms;
  row("the same, least energy at 1.13x", run_mode(platform, nullptr, mix, "budget", options),
      latency);
  for (const auto& mode : paper_modes()) {
    ScheduleOptions frugal;
    frugal.objective = Objective::kEnergy;
    frugal.min_rate_per_ms = *run_mode(platform, nullptr, mix, mode).throughput_per_ms;
    const auto run = run_mode(platform, nullptr, mix, "budget", frugal);
    fmt::print(
        "budget least energy at {:<10}'s rate: {:.4f} of {:.4f} tasks/ms, {:.3f} of the bound\n",
        mode, *run.throughput_per_ms, *frugal.min_rate_per_ms,
        *run.energy_j / *run.bounds->energy_j);
  }
  for (const double cap_w : {0.4, 1.0, 2.0, 3.0}) {
    ScheduleOptions capped;
    capped.power_cap_w = cap_w;
    const auto run = run_mode(platform, nullptr, mix, "budget", capped);
    fmt::print("budget cap {:.1f} W: the fullest second draws {:.3f} W, {:.4f} tasks/ms\n", cap_w,
               *run.power_highest_w, *run.throughput_per_ms);
  }
}

inline void print_graphs() {
  const auto platform =
      parse_platform("three.yaml", "platform: three\nunits: {cpu: {}, gpu: {}, dsp: {}}\n", {}, 4);
  std::vector<double> ratios;
  double longest_ms = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Random random(seed);
    DagParameters parameters;
    parameters.tasks = static_cast<int>(20 + random.below(81));
    parameters.shape = random.uniform(0.5, 2);
    parameters.ccr = random.uniform(0.1, 5);
    parameters.heterogeneity = random.uniform(0.1, 1.5);
    parameters.seed = seed;
    const auto mix = parse_mix("dag.yaml", generate_dag(parameters));
    const double heft = run_mode(platform, nullptr, mix, "heft").makespan_s;
    const auto begin = std::chrono::steady_clock::now();
    ratios.push_back(run_mode(platform, nullptr, mix, "budget").makespan_s / heft);
    longest_ms =
        std::max(longest_ms,
                 std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
                     .count());
  }
  std::ranges::sort(ratios);
  fmt::print("budget of heft's makespan, 200 graphs: median {:.3f}, most {:.3f}; up to {:.0f} ms\n",
             ratios[100], ratios.back(), longest_ms);
}

inline void print_robot(const Platform& platform, const Profile* profile) {
  const auto mix_of_seed = [](std::uint64_t seed) {
    Mix mix = load_mix("full-robot");
    Random random(hash_u64(seed, 45));
    for (Pipeline& pipeline : mix.pipelines) {
      const double period_ms = 1e3 / *pipeline.rate_hz;
      pipeline.offset = from_ms(random.uniform(0, std::min(period_ms, 100.0)));
      pipeline.jitter = from_ms(pipeline.name == "planning" ? 20 : random.uniform(0, 2));
    }
    return mix;
  };
  for (const std::string what :
       {"latency", "throughput", "energy", "edf", "ect", "budget", "budget, slices off"}) {
    const std::string mode = what.substr(0, what.find(','));
    std::int64_t misses = 0;
    double energy = 0;
    double recognition_hz = 1e9;
    double longest_ms = 0;
    std::int64_t left = 0;
    std::int64_t waiting = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      ScheduleOptions options;
      options.without = {"cloud"};
      options.draw = profile != nullptr ? Draw::kSamples : Draw::kMedian;
      options.seed = seed;
      if (what != mode) options.slices = false;
      const Mix mix = mix_of_seed(seed);
      const auto begin = std::chrono::steady_clock::now();
      const auto run = run_mode(platform, profile, mix, mode, options);
      longest_ms = std::max(longest_ms, std::chrono::duration<double, std::milli>(
                                            std::chrono::steady_clock::now() - begin)
                                            .count());
      left += run.suspensions.value_or(0);
      for (const auto& pipeline : run.pipelines) {
        if (!pipeline.deadline_ms) waiting += pipeline.unfinished;
        misses += pipeline.deadline_misses.value_or(0);
        if (pipeline.pipeline == "recognition") {
          recognition_hz = std::min(recognition_hz, *pipeline.rate_hz);
        }
      }
      if (run.energy_j && run.bounds->energy_j) {
        energy = std::max(energy, *run.energy_j / *run.bounds->energy_j);
      }
    }
    fmt::print(
        "full-robot on {}, {:<18} 20 seeds of a minute: {} misses, recognition at least {:.2f} Hz, "
        "{} of what may wait unfinished, {} calls left, energy at most {:.3f} of the bound; "
        "planned "
        "and run in at most {:.0f} ms\n",
        platform.name, what, misses, recognition_hz, waiting, left, energy, longest_ms);
  }
}

}  // namespace pirt::bench
