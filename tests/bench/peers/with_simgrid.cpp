// Virtual time beside SimGrid S4U. Decisions are not compared here, only what they cost: SimGrid
// starts each task when the trace of our run says that the dispatcher did.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>

#include "scheduler/schedule.h"
#include "scheduler/services/eligibility.h"
#include "scheduler/services/services.h"
#include "tests/bench/peers/comparison.h"
#include "tests/bench/peers/simgrid.h"
#include "tests/scheduler/trace_log.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"

namespace pirt::bench {
namespace {

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// ---- Tasks a second.

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

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

void compare_speed() {
  constexpr std::int64_t kTasks = 1'000'000;
  constexpr int kRounds = 7;
  const auto platform = parse_platform("three.yaml", kThreeUnits, {}, 4);
  const auto mix = parse_mix("loop.yaml",
                             "mix: loop\npipelines: {p: {closed_loop: {frames: 1000000}, tasks: "
                             "[{workload: convolution}]}}");
  ScheduleOptions options;
  options.mode = "throughput";
  std::vector<double> ours;
  std::vector<double> theirs;
  std::vector<double> ratios;
  for (int round = 0; round < kRounds; ++round) {
    const auto begin = std::chrono::steady_clock::now();
    const auto record = run_virtual(platform, nullptr, mix, options);
    ours.push_back(seconds_since(begin));
    const auto peer = simgrid_closed_loop({1.3e-3, 2.9e-3, 3.7e-3}, {2, 2, 2}, kTasks);
    theirs.push_back(peer.elapsed_s);
    ratios.push_back(peer.elapsed_s / ours.back());
    if (record.completed != kTasks || std::abs(peer.makespan_s / record.makespan_s - 1) > 1e-9) {
      fmt::print("NOT THE SAME WORK: makespan {:.9f} s, SimGrid {:.9f} s\n", record.makespan_s,
                 peer.makespan_s);
    }
  }
  const auto [least, most] = std::ranges::minmax(ratios);
  const double count = kTasks;
  fmt::print(
      "closed loop, 1 M tasks on 3 units, {} rounds in turn: {:.2f} us a task ({:.2f} M tasks/s); "
      "SimGrid {:.2f} us ({:.2f} M tasks/s); ratio {:.1f} ({:.1f} to {:.1f})\n",
      kRounds, median(ours) / count * 1e6, count / median(ours) / 1e6, median(theirs) / count * 1e6,
      count / median(theirs) / 1e6, median(ratios), least, most);
}

// ---- Completion times.

/// A run of ours, and how SimGrid is to do the same.
struct Scenario {
  std::vector<PeerUnit> units;
  std::vector<PeerTask> tasks;
  std::vector<PeerStart> starts;
  std::vector<std::vector<double>> completions;  ///< Ours, by unit, in order; seconds.
};

ServiceTable services_of(const Platform& platform, const Mix& mix, const std::string& mode) {
  ServiceOptions options;
  const auto defaults = platform.modes.find(mode);
  if (defaults != platform.modes.end()) options.stage_scale = defaults->second.stage_scale;
  return resolve_services(platform, nullptr, workloads_of(mix), options);
}

PeerTask peer_task(const Service& service, UnitId unit) {
  PeerTask task{.unit = unit, .stages = {}};
  for (const auto& stage : service.stages) task.stages.push_back({stage.on, to_s(stage.mean())});
  return task;
}

Scenario scenario_of(const Platform& platform, const Mix& mix, const ScheduleOptions& wished) {
  const auto path = std::filesystem::temp_directory_path() / "pirt-bench-simgrid.json";
  ScheduleOptions options = wished;
  options.trace = path.string();
  static_cast<void>(run_virtual(platform, nullptr, mix, options));
  const test::TraceLog log = test::load_trace_log(path);
  std::filesystem::remove(path);
  const auto services = services_of(platform, mix, options.mode);

  Scenario scenario;
  for (const auto& unit : platform.units) {
    scenario.units.push_back(
        {unit.servers, unit.discipline == Discipline::kProcessorSharing || unit.servers > 1});
  }
  scenario.completions.resize(platform.units.size());
  std::unordered_map<TaskId, WorkloadId> workloads;
  PeerStart now;  // At time 0, then at the latest completion.
  for (const auto& entry : log.entries) {
    for (std::size_t i = 0; i < entry.effects.submitted.size(); ++i) {
      workloads[entry.effects.submitted[i]] = entry.tasks[i].kind.workload;
    }
    if (entry.input.kind == DispatcherInput::Kind::kComplete) {
      scenario.starts.push_back(std::exchange(now, {}));
      auto& list = scenario.completions[entry.input.unit];
      list.push_back(to_s(entry.input.now));
      now = {entry.input.unit, list.size(), {}};
    }
    for (const Start& start : entry.effects.started) {
      now.tasks.push_back(scenario.tasks.size());
      scenario.tasks.push_back(
          peer_task(*services.find(workloads.at(start.task), start.unit), start.unit));
    }
  }
  scenario.starts.push_back(now);
  return scenario;
}

struct Difference {
  std::size_t tasks = 0;
  double worst_s = 0;
};

void add_difference(const Scenario& scenario, Difference& sum) {
  const auto peer = simgrid_completions(scenario.units, scenario.tasks, scenario.starts);
  for (std::size_t unit = 0; unit < scenario.units.size(); ++unit) {
    const auto& ours = scenario.completions[unit];
    const auto& theirs = peer.at(unit);
    if (ours.size() != theirs.size()) {
      sum.worst_s = INFINITY;
      return;
    }
    for (std::size_t i = 0; i < ours.size(); ++i) {
      sum.worst_s = std::max(sum.worst_s, std::abs(ours[i] - theirs[i]));
    }
    sum.tasks += ours.size();
  }
}

/// Three units, one of them four shared cores; each workload has one to four stages of random
/// length on random units, or between them.
Platform random_platform(Random& rng) {
  std::string yaml =
      "platform: random\nunits:\n  cpu: {servers: 4, discipline: processor_sharing, slots: 6}\n"
      "  gpu: {slots: 3}\n  dsp: {slots: 2}\nworkloads:\n";
  const std::vector<std::string> units = {"cpu", "gpu", "dsp"};
  for (const auto& workload : workload_names()) {
    yaml += "  " + workload + ":\n";
    for (const auto& unit : units) {
      std::vector<std::string> stages;
      for (std::uint64_t i = rng.next() % 4; i-- > 0;) {
        const double ms = 0.1 + static_cast<double>(rng.next() % 9'900'000) * 1e-6;
        const std::size_t on = rng.next() % 4;
        stages.push_back(on == 3 ? fmt::format("{{delay_ms: {:.6f}}}", ms)
                                 : fmt::format("{{on: {}, ms: {:.6f}}}", units[on], ms));
      }
      stages.push_back(fmt::format("{{on: {}, ms: {:.6f}}}", unit,
                                   0.1 + static_cast<double>(rng.next() % 9'900'000) * 1e-6));
      yaml += fmt::format("    {}: [{}]\n", unit, fmt::join(stages, ", "));
    }
  }
  return parse_platform("random.yaml", yaml, {}, 4);
}

Mix random_mix(Random& rng) {
  std::string yaml = "mix: random\npipelines:\n";
  const auto names = workload_names();
  for (int p = 0; p < 5; ++p) {
    yaml += fmt::format("  p{}: {{closed_loop: {{frames: 100}}, tasks: [{{workload: {}}}]}}\n", p,
                        names[rng.next() % names.size()]);
  }
  return parse_mix("random.yaml", yaml);
}

bool compare_stage_models() {
  constexpr double kLimitS = 1e-6;
  Difference paper;
  for (const char* mode : {"latency", "throughput", "energy"}) {
    ScheduleOptions options;
    options.mode = mode;
    add_difference(
        scenario_of(load_platform("snapdragon820"), load_mix("convolution-1000"), options), paper);
  }
  fmt::print("stage models, snapdragon820, three modes: {} completions, at most {:.3f} us apart\n",
             paper.tasks, paper.worst_s * 1e6);
  Difference random;
  constexpr int kPlatforms = 30;
  for (std::uint64_t seed = 1; seed <= kPlatforms; ++seed) {
    Random rng(seed);
    const auto platform = random_platform(rng);
    const auto mix = random_mix(rng);
    ScheduleOptions options;
    options.mode = "olb";
    options.in_flight = 3;
    add_difference(scenario_of(platform, mix, options), random);
  }
  fmt::print(
      "stage models, {} random platforms with a shared 4-core CPU: {} completions, at most {:.3f} "
      "us apart\n",
      kPlatforms, random.tasks, random.worst_s * 1e6);
  const bool agree = paper.worst_s <= kLimitS && random.worst_s <= kLimitS;
  if (!agree) fmt::print("FAILED: more than {} us apart\n", kLimitS * 1e6);
  return agree;
}

}  // namespace

bool compare_with_simgrid() {
  compare_speed();
  return compare_stage_models();
}

}  // namespace pirt::bench
