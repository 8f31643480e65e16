// A mix on a simulated live run.
#include <fmt/format.h>

#include <array>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "scheduler/schedule_live.h"
#include "tests/scheduler/simulation/script.h"
#include "tests/scheduler/simulation/simulation.h"
#include "workloads/base/error.h"

namespace pirt::simulated {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::array kMixModes = {"olb",        "ect",    "edf",      "edf",      "met",
                                  "throughput", "energy", "advanced", "cpu-only", "qilin"};

/// A task of a mix: what its workload reads of the same firing, and of an earlier one.
struct MixStep {
  const char* name;
  const char* workload;
  int image = -1;     ///< Whose output its picture is; -1 = from outside.
  int previous = -1;  ///< Likewise, of the nearest earlier firing, as its first input.
};
constexpr std::array<MixStep, 4> kCamera = {{{"undistort", "undistort"},
                                             {"blur", "gaussian_blur", 0},
                                             {"background", "background_model", 0},
                                             {"flow", "optical_flow", 1, 1}}};
constexpr std::array<MixStep, 1> kNetwork = {{{"alexnet", "alexnet"}}};
constexpr std::array<MixStep, 1> kUrgent = {{{"sobel", "sobel"}}};
constexpr std::array kAllWorkloads = {"undistort",    "gaussian_blur", "background_model",
                                      "optical_flow", "alexnet",       "sobel"};

struct MixPipeline {
  std::string name;
  std::span<const MixStep> steps;
  std::optional<Nanos> period;  ///< Absent: a closed loop.
};

class MixRun {
 public:
  MixRun(World& world, const Seed& seed)
      : world_(world),
        random_(derive_seed(seed.number, "mix")),
        script_(world, seed.number, chances()),
        trace_(seed.folder / "mix.json"),
        most_(seed.most_actions) {}

  int play() {
    std::filesystem::remove(trace_);
    const Platform platform = parse_platform("platform.yaml", platform_text(), {}, 1);
    const Mix mix = parse_mix("mix.yaml", mix_text());
    ScheduleOptions options;
    options.mode = kMixModes[random_.below(kMixModes.size())];
    options.duration = milliseconds(10 + random_.below(40));
    options.seed = random_.below(100);
    if (random_.below(2) == 0) options.slices = true;
    if (random_.below(3) == 0) options.faults = Faults{random_.below(100), 0.1, 0.1};
    if (random_.below(2) == 0) options.trace = trace_.string();
    LiveOptions live;
    live.prepare_first = options.slices == true || random_.below(4) != 0;
    if (limit_) live.time_limit = limit_;
    if (random_.below(4) == 0) {
      const Nanos once = script_.draw_time(*options.duration), twice = script_.draw_time(once);
      live.stop = [this, once, twice] {
        const Nanos since = world_.now() - first_;
        return opened_ ? (since > once ? 1 : 0) + (since > once + twice ? 1 : 0) : 0;
      };
      signals_ = true;
    }
    live.sink = [this](const Firings::TaskPlace& place, std::span<const Tensor> outputs) {
      sink(place, outputs);
    };
    live.progress = [this](const std::string& line) {
      world_.note(line);
      if (!std::exchange(opened_, true)) first_ = world_.now();
    };
    world_.note(options.mode + "\n" + mix_text_);
    std::optional<FullDisk> disk;
    if (options.trace && random_.below(6) == 0) disk.emplace();
    std::optional<RunRecord> record;
    try {
      record = run_live(platform, nullptr, mix, options, live);
    } catch (const Error& error) {
      // A mode that gives some task to nobody; a device that cannot be opened; a full disk.
      world_.note(error.what());
    } catch (const std::runtime_error& error) {
      world_.note(error.what());  // Of the first call of a kernel.
    } catch (int) {
    }
    script_.release_hung();
    const bool is_full = disk.has_value();
    disk.reset();
    if (!record) return actions_;
    world_.note(fmt::format("{} submitted, {} completed, {} failed", record->submitted,
                            record->completed, record->failed));
    check(*record, *options.duration);
    if (!record->trace_problem.empty() != (is_full && options.trace.has_value())) {
      world_.fail("the trace: " + record->trace_problem);
    }
    if (options.trace) expect_replay(world_, trace_, record->trace_problem.empty());
    return actions_;
  }

 private:
  Script::Chances chances() {
    Script::Chances chances;
    chances.longest = milliseconds(1 + random_.below(4));
    const auto hostility = random_.below(4);
    if (hostility == 0) chances.hangs = chances.late = chances.refuses = chances.throws = 0;
    if (hostility == 1) chances.hangs = 6;
    if (random_.below(4) != 0) limit_ = 4 * chances.longest;
    chances.limit = limit_.value_or(seconds(6));
    return chances;
  }

  std::string platform_text() {
    const auto slots = [this] { return 1 + random_.below(3); };
    std::vector<std::string> units = {"cpu"};
    std::string text = "platform: board\nunits:\n";
    text += fmt::format("  cpu: {{backend: cpu, cores: all, slots: {}, active_w: 1}}\n", slots());
    const auto add = [&](const char* name, std::uint64_t one_in, const std::string& how) {
      if (random_.below(one_in) != 0) return false;
      units.emplace_back(name);
      text += fmt::format("  {}: {{{}, active_w: 1}}\n", name, how);
      return true;
    };
    add("gpu", 2, fmt::format("backend: cpu, cores: all, slots: {}", slots()));
    paced_ = add("dsp", 4, "slots: 2");
    add("fpga", 4, "backend: fake, slots: 1, contexts: {prepare_ms: 1}");
    add("cloud", 4, fmt::format("backend: fake, role: cloud, servers: {}", slots()));
    text += "workloads:\n";
    for (const char* workload : kAllWorkloads) {
      text += fmt::format("  {}: {{", workload);
      for (const std::string& unit : units) {
        text +=
            fmt::format("{0}: [{{on: {0}, ms: {1}, name: execute}}], ", unit, 1 + random_.below(3));
      }
      text += "}\n";
    }
    return text;
  }

  std::string mix_text() {
    std::string& text = mix_text_;
    text = "mix: m\n";
    buffers_ = random_.below(5) == 0;
    if (buffers_) text += "image_buffers: 2\n";
    text += "pipelines:\n";
    const auto all = random_.below(3);
    if (all < 2) add_pipeline("camera", kCamera);
    if (all > 0) add_pipeline("network", kNetwork);
    if (all > 0 || random_.below(2) == 0) add_pipeline("urgent", kUrgent);
    return text;
  }

  void add_pipeline(const char* name, std::span<const MixStep> steps) {
    MixPipeline& pipeline = pipelines_.emplace_back();
    pipeline.name = name;
    pipeline.steps = steps.first(1 + random_.below(steps.size()));
    std::string& text = mix_text_;
    text += fmt::format("  {}:\n", name);
    if (random_.below(3) == 0) {
      const int frames = std::min<int>(most_, static_cast<int>(1 + random_.below(12)));
      actions_ += frames;
      text += fmt::format("    closed_loop: {{frames: {}}}\n", std::max(frames, 1));
    } else {
      constexpr std::array kRates = {50, 100, 250, 500};
      const int rate = kRates[random_.below(kRates.size())];
      pipeline.period = Nanos(seconds(1)) / rate;
      text += fmt::format("    rate_hz: {}\n", rate);
    }
    if (random_.below(2) == 0) text += fmt::format("    deadline_ms: {}\n", 1 + random_.below(20));
    if (random_.below(6) == 0) text += fmt::format("    expires_ms: {}\n", 1 + random_.below(20));
    if (random_.below(3) == 0) text += "    real_time: false\n";
    text += "    tasks:\n";
    for (const MixStep& step : pipeline.steps) {
      text += fmt::format("      - {{name: {}, workload: {}", step.name, step.workload);
      if (step.image >= 0) {
        text += fmt::format(", inputs: {{image: {}.image", steps[at(step.image)].name);
        if (step.previous >= 0) {
          text += fmt::format(", previous: {}.image@-1", steps[at(step.previous)].name);
        }
        text += "}";
      }
      if (buffers_ && steps.size() > 1) text += ", image_input: true";
      text += "}\n";
    }
  }
  static std::size_t at(int step) { return static_cast<std::size_t>(step); }

  /// With the run's mutex.
  void sink(const Firings::TaskPlace& place, std::span<const Tensor> outputs) {
    auto& firing = done_[{place.pipeline, place.firing}];
    const bool is_news = firing.emplace(place.task, value_in(outputs[0])).second;
    if (!is_news) world_.fail("a task completes twice");
    auto& last = ended_[{place.pipeline, place.firing}];
    last = std::max(last, world_.now());
  }

  void check(const RunRecord& record, Nanos duration) {
    if (record.submitted !=
        record.completed + record.dropped + record.expired + record.failed + record.queued) {
      world_.fail("tasks do not balance");
    }
    std::int64_t by_units = 0;
    for (const UnitResult& unit : record.units) by_units += unit.completed;
    if (by_units != record.completed) world_.fail("units have completed other tasks");
    bool closed = !signals_;
    for (std::size_t p = 0; p < pipelines_.size(); ++p) {
      const PipelineResult& result = record.pipelines[p];
      if (result.fired != result.completed + result.dropped + result.unfinished) {
        world_.fail("firings of " + result.pipeline + " do not balance");
      }
      closed = closed && !pipelines_[p].period;
      if (!paced_) check_values(p);
      if (!paced_ && !buffers_ && !signals_) check_latency(record, p, duration);
    }
    if (closed && record.queued != record.stalled) world_.fail("tasks wait, and the run has ended");
  }

  /// What came out is that of what went in, and a state has counted each call once.
  void check_values(std::size_t p) {
    const auto steps = pipelines_[p].steps;
    std::vector<std::optional<double>> newest(steps.size());
    double count = 0;
    for (const auto& [key, made] : done_) {
      if (key.first != p) continue;
      for (const auto& [task, value] : made) {
        const MixStep& step = steps[task];
        if (std::string_view(step.workload) == "background_model") {
          if (value != count++) world_.fail(fmt::format("a state's {}: {}", count - 1, value));
          continue;
        }
        std::vector<double> inputs;
        const double outside = 10.0 * static_cast<double>(key.second % 4);
        if (step.previous >= 0) {
          const auto& earlier = newest[at(step.previous)];
          if (!earlier) world_.fail("a task reads what nobody has made");
          inputs.push_back(*earlier);
        }
        inputs.push_back(step.image < 0 ? outside
                                        : made.at(static_cast<std::uint32_t>(step.image)));
        if (value != value_of(step.workload, inputs)) {
          world_.fail(
              fmt::format("{} of firing {} has read something else", step.name, key.second));
        }
      }
      for (const auto& [task, value] : made) newest[task] = value;
    }
  }

  /// From when it was due to the end, at least: what the record says of the longest.
  void check_latency(const RunRecord& record, std::size_t p, Nanos duration) {
    const MixPipeline& pipeline = pipelines_[p];
    if (!pipeline.period) return;
    const Nanos begin = first_ + from_s(*record.set_up_s);
    Nanos longest{0};
    for (const auto& [key, made] : done_) {
      if (key.first != p || made.size() < pipeline.steps.size()) continue;
      const Nanos end = ended_[key] - begin;
      if (end > duration - milliseconds(3)) continue;
      longest = std::max(longest, end - static_cast<std::int64_t>(key.second) * *pipeline.period);
    }
    const double said_ms = record.pipelines[p].p99_ms.value_or(0);
    if (said_ms * 1.002 + 0.002 < to_ms(longest)) {
      world_.fail(fmt::format("a firing of {} took {:.6f} ms, and the record says {:.6f} at most",
                              pipeline.name, to_ms(longest), said_ms));
    }
  }

  World& world_;
  Random random_;
  std::optional<Nanos> limit_;
  Script script_;
  std::filesystem::path trace_;
  int most_, actions_ = 0;
  bool paced_ = false, buffers_ = false, signals_ = false, opened_ = false;
  Nanos first_{0};  ///< When the first unit was opened.
  std::string mix_text_;
  std::vector<MixPipeline> pipelines_;
  using Key = std::pair<std::size_t, std::uint64_t>;  // Pipeline, firing.
  std::map<Key, std::map<std::uint32_t, double>> done_;
  std::map<Key, Nanos> ended_;
};

}  // namespace

int play_mix(World& world, const Seed& seed) {
  MixRun run(world, seed);
  int actions = 0;
  world.run([&] { actions = run.play(); });
  return actions;
}

}  // namespace pirt::simulated
