// Mode budget on random systems: what it guarantees is kept, what draws keeps the cap, and it keeps
// up where a mode that plans nothing does.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "scheduler/record/keeping_up.h"
#include "tests/scheduler/support.h"
#include "workloads/base/math/random.h"

namespace pirt::test {
namespace {

/// What a system may have beside units and tasks.
struct Kind {
  bool links = false, contexts = false, transfers = false, own_joules = false;
};

struct System {
  Platform platform;
  Mix mix;
};

class Generator {
 public:
  Generator(std::uint64_t seed, const Kind& kind) : random_(hash_u64(seed, 11)), kind_(kind) {}

  System make() {
    const std::string platform = units();
    return {platform_of(platform), mix_of(pipelines())};
  }

 private:
  bool perhaps(double part) { return random_.uniform(0, 1) < part; }
  double one_of(std::initializer_list<double> values) {
    return values.begin()[static_cast<std::size_t>(
        random_.uniform(0, static_cast<double>(values.size()) - 1e-9))];
  }

  std::string units() {
    names_ = {"cpu", "gpu", "dsp"};
    names_.resize(static_cast<std::size_t>(one_of({1, 1, 2, 3})));
    std::string text = "platform: random\nunits:\n";
    std::string links;
    for (const std::string& name : names_) {
      text += fmt::format("  {0}: {{role: {0}, slots: 1, active_w: {1}, idle_w: 0.1", name,
                          one_of({1, 2, 5}));
      if (kind_.links && perhaps(0.5)) {
        text += ", link: to_" + name;
        links += fmt::format("  to_{}: {{mbit_s: {}, active_w: {}, latency_ms: {}}}\n", name,
                             one_of({100, 1000, 8000}), one_of({0, 1, 3}), one_of({0, 0.1, 1}));
      }
      if (kind_.contexts && perhaps(0.4)) {
        text += fmt::format(", contexts: {{prepare_ms: {}}}", one_of({1, 5, 20}));
      }
      if (kind_.own_joules && perhaps(0.4)) {
        text += fmt::format(", energy: {{call_j: {}}}", one_of({0.01, 0.1}));
      }
      text += "}\n";
    }
    if (!links.empty()) text += "links:\n" + links;
    text += "workloads:\n";
    for (const char* workload : {"alexnet", "bundle_adjust", "describe_scene"}) {
      text += fmt::format("  {}: {{", workload);
      for (const std::string& name : names_) {
        text += fmt::format("{0}: [{{on: {0}, ms: {1}}}], ", name, random_.uniform(5, 110));
      }
      text += "}\n";
    }
    return text;
  }

  std::string pipelines() {
    std::string text = "mix: random\npipelines:\n";
    if (perhaps(0.6)) {
      text +=
          fmt::format("  rec: {{rate_hz: {}, deadline_ms: {}, tasks: [{{workload: alexnet}}]}}\n",
                      one_of({1, 3, 5}), one_of({100, 200, 300}));
    }
    if (perhaps(0.5)) {
      text += fmt::format(
          "  ba: {{rate_hz: {}, real_time: false, tasks: [{{workload: bundle_adjust}}]}}\n",
          one_of({0.5, 1, 5}));
    }
    if (perhaps(0.3)) {
      text +=
          "  sc: {closed_loop: {frames: 50}, real_time: false, tasks: [{workload: "
          "describe_scene}]}\n";
    }
    const int own = static_cast<int>(one_of({1, 2, 3, 4}));
    for (int i = 0; i < own; ++i) text += pipeline(i);
    return text;
  }

  std::string pipeline(int number) {
    const double rate_hz = one_of({5, 10, 20, 25, 50, 100});
    const double period_ms = 1000 / rate_hz;
    std::string text = fmt::format("  p{}: {{rate_hz: {}", number, rate_hz);
    text += perhaps(0.85) ? fmt::format(", deadline_ms: {}", period_ms * one_of({0.5, 1, 1, 1}))
                          : std::string(", real_time: false");
    if (perhaps(0.4)) text += fmt::format(", jitter_ms: {}", period_ms * one_of({0.05, 0.1}));
    if (perhaps(0.4)) text += fmt::format(", offset_ms: {}", random_.uniform(0, period_ms));
    text += ", tasks: [";
    const int tasks = static_cast<int>(one_of({1, 2, 3}));
    for (int t = 0; t < tasks; ++t) {
      text += fmt::format("{{name: t{}, service_ms: {{", t);
      const std::size_t first = static_cast<std::size_t>(random_.uniform(0, 2.99)) % names_.size();
      for (std::size_t u = 0; u < names_.size(); ++u) {
        if (u != first && perhaps(0.5)) continue;
        text += fmt::format("{}: {}, ", names_[u], random_.uniform(0.02, 0.35) * period_ms / tasks);
      }
      text += "}";
      if (t > 0 && perhaps(0.8)) {
        text += fmt::format(", after: [{{task: t{}, transfer_ms: {}}}]", t - 1,
                            kind_.transfers ? one_of({0, 0.5, 2}) * period_ms / 50 : 0);
      }
      text += "}, ";
    }
    return text + "]}\n";
  }

  Random random_;
  Kind kind_;
  std::vector<std::string> names_;
};

constexpr Kind kPlain = {};
constexpr Kind kAllKinds = {.links = true, .contexts = true, .transfers = true, .own_joules = true};

RunRecord run(const System& system, const std::string& mode, std::optional<double> cap_w = {}) {
  ScheduleOptions options;
  options.mode = mode;
  options.duration = from_s(5);
  options.power_cap_w = cap_w;
  return run_virtual(system.platform, nullptr, system.mix, options);
}

TEST(RandomSystems, WhatIsGuaranteedIsNeverLate) {
  int guaranteed = 0;
  for (const Kind& kind : {kPlain, kAllKinds}) {
    for (std::uint64_t seed = 0; seed < 150; ++seed) {
      const RunRecord record = run(Generator(seed, kind).make(), "budget");
      for (const PipelineResult& pipeline : record.pipelines) {
        if (pipeline.response_bound_ms && pipeline.p99_ms) {
          // A histogram is off by at most 0.1 %.
          EXPECT_LE(*pipeline.p99_ms, *pipeline.response_bound_ms * 1.001)
              << "seed " << seed << ", " << pipeline.pipeline;
        }
        if (!pipeline.guaranteed.value_or(false)) continue;
        ++guaranteed;
        EXPECT_EQ(pipeline.deadline_misses, 0) << "seed " << seed << ", " << pipeline.pipeline;
      }
    }
  }
  EXPECT_GT(guaranteed, 100);
}

TEST(RandomSystems, NoSecondIsAboveTheCapUnseen) {
  int capped = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const double cap_w = 0.5 * static_cast<double>(1 + seed % 12);
    const RunRecord record = run(Generator(seed, kAllKinds).make(), "budget", cap_w);
    if (record.over_cap.value_or(0) > 0) continue;
    ++capped;
    EXPECT_LE(*record.power_highest_w, cap_w * (1 + 1e-9)) << "seed " << seed;
  }
  EXPECT_GT(capped, 50);
}

TEST(RandomSystems, WhereAModeThatPlansNothingKeepsUpItDoesToo) {
  int kept = 0;
  for (std::uint64_t seed = 0; seed < 150; ++seed) {
    const System system = Generator(seed, kPlain).make();
    if (!keeps_up(run(system, "edf")) && !keeps_up(run(system, "ect"))) continue;
    ++kept;
    EXPECT_TRUE(keeps_up(run(system, "budget"))) << "seed " << seed;
  }
  EXPECT_GT(kept, 30);
}

// Of 80 ms, `job` does not fit between q and r, which three times bear to wait for less than 30.
TEST(Budget, DoesNotStarveWhatHasNoDeadline) {
  const std::string chain =
      ", tasks: [{name: t1, service_ms: {cpu: 1}}, {name: t2, service_ms: {cpu: 1}, after: [t1]}, "
      "{name: t3, service_ms: {cpu: 1}, after: [t2]}]}\n";
  const std::string mix = "mix: m\npipelines:\n  q: {rate_hz: 10, deadline_ms: 95" + chain +
                          "  r: {rate_hz: 10, offset_ms: 50, deadline_ms: 95" + chain +
                          "  job: {rate_hz: 2, tasks: [{name: j, service_ms: {cpu: 80}}]}\n";
  const std::string imu =
      "  imu: {rate_hz: 1000, deadline_ms: 1, tasks: [{name: i, service_ms: {dsp: 0.1}}]}\n";
  const Platform platform = platform_of(
      "platform: two\nunits: {cpu: {slots: 1, active_w: 1}, dsp: {slots: 1, active_w: 1}}\n");
  const auto keeps = [&](const std::string& text, const std::string& mode,
                         std::optional<Objective> objective) {
    ScheduleOptions options;
    options.mode = mode;
    options.objective = objective;
    options.duration = from_s(5);
    return keeps_up(run_virtual(platform, nullptr, mix_of(text), options));
  };
  EXPECT_TRUE(keeps(mix, "edf", {}));
  EXPECT_TRUE(keeps(mix, "budget", Objective::kEnergy));
  EXPECT_TRUE(keeps(mix + imu, "edf", {}));
  EXPECT_TRUE(keeps(mix + imu, "budget", {}));
}

// x and y, of 8 of their 10 ms each, fit on two units, and fire for the first time after 10 s.
TEST(Budget, PlansForWhatBeginsLate) {
  const std::string late =
      ": {rate_hz: 10, offset_ms: 10000, deadline_ms: 10, tasks: [{name: t, service_ms: {a: 8, b: "
      "8}}]}\n";
  const Platform platform = platform_of(
      "platform: three\nunits: {a: {slots: 1, active_w: 1}, b: {slots: 1, active_w: 2}, c: {slots: "
      "1, active_w: 1}}\n");
  const Mix mix = mix_of(
      "mix: m\npipelines:\n"
      "  imu: {rate_hz: 1000, deadline_ms: 1, tasks: [{name: i, service_ms: {c: 0.1}}]}\n  x" +
      late + "  y" + late);
  ScheduleOptions options;
  options.mode = "budget";
  options.duration = from_s(12);
  const RunRecord record = run_virtual(platform, nullptr, mix, options);
  EXPECT_EQ(record.pipelines[2].completed, 20);
  EXPECT_EQ(real_time_losses(record), 0);
}

}  // namespace
}  // namespace pirt::test
