// Platform files: what they mean, and what they refuse.
#include "characterize/platform/platform.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "characterize/platform/unit_request.h"
#include "tests/support/documentation.h"
#include "tests/support/errors.h"
#include "tests/support/optional_backend.h"
#include "workloads/catalog/catalog.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

Platform parse(const std::string& text, int cores = 4,
               const std::vector<YamlOverride>& overrides = {}) {
  return parse_platform("p.yaml", text, overrides, cores);
}
std::string refused(const std::string& text) {
  return bad_input([&] { static_cast<void>(parse(text)); });
}
/// A platform of one unit `cpu` with the given keys; it is in line 2.
std::string refused_unit(const std::string& keys) {
  return refused("platform: p\nunits: {cpu: {" + keys + "}}\n");
}

TEST(Platform, ReadsEveryKey) {
  const auto platform = parse(R"(
platform: all-keys
description: what
assumptions: which
units:
  cpu: {servers: 4, discipline: processor_sharing, slots: 3, active_w: 0.5, idle_w: 0.25}
  npu: {role: dsp, energy: {op_pj: 1.5, byte_pj: 20}}
  cloud: {servers: 64, link: uplink}
  probe: {}
links: {uplink: {mbit_s: 20, latency_ms: {uniform: [20, 60]}, active_w: 0.8}}
workloads:
  convolution:
    cpu: [{on: cpu, ms: 6.84}]
    npu: [{on: cpu, ms: 1.5, name: setup}, {delay_ms: 0.7, name: dma}, {on: npu, ms: {uniform: [1, 2]}}, {delay_ms: 0}]
    call_j: {cpu: 0.01}
    provenance: fitted
    source: somewhere
modes:
  throughput: {weights: {npu: 4, cpu: 0}, in_flight: 7, stage_scale: {npu.setup: 1.299}}
)");
  EXPECT_EQ(platform.name, "all-keys");
  EXPECT_EQ(platform.description, "what");
  EXPECT_EQ(platform.assumptions, "which");
  EXPECT_THAT(platform.unit_names(), ElementsAre("cpu", "npu", "cloud", "probe"));
  const auto& cpu = platform.unit("cpu");
  EXPECT_EQ(cpu.role, Role::kCpu);
  EXPECT_EQ(cpu.servers, 4);
  EXPECT_EQ(cpu.discipline, Discipline::kProcessorSharing);
  EXPECT_EQ(cpu.slots, 3);
  EXPECT_EQ(cpu.active_w, 0.5);
  EXPECT_EQ(cpu.idle_w, 0.25);
  EXPECT_FALSE(cpu.measured());
  const auto& npu = platform.unit("npu");
  EXPECT_EQ(npu.role, Role::kDsp);
  EXPECT_EQ(npu.op_pj, 1.5);
  EXPECT_EQ(npu.byte_pj, 20);
  EXPECT_EQ(npu.servers, 1);
  EXPECT_EQ(npu.discipline, Discipline::kFifo);
  EXPECT_FALSE(npu.slots);
  EXPECT_EQ(platform.unit("cloud").role, Role::kCloud);
  EXPECT_EQ(platform.unit("probe").role, Role::kOther);

  const auto& link = platform.links.at("uplink");
  EXPECT_EQ(link.mbit_s, 20);
  EXPECT_EQ(link.latency.mean(), from_ms(40));
  EXPECT_EQ(link.active_w, 0.8);

  const auto& model = platform.workloads.at("convolution");
  const auto& stages = model.stages.at("npu");
  ASSERT_EQ(stages.size(), 4U);
  EXPECT_EQ(stages[0].name, "setup");
  EXPECT_EQ(stages[0].on, "cpu");
  EXPECT_EQ(stages[1].on, "");
  EXPECT_EQ(stages[1].time.low, from_ms(0.7));
  EXPECT_EQ(stages[2].name, "execute");
  EXPECT_EQ(stages[2].time.kind, Distribution::Kind::kUniform);
  EXPECT_EQ(stages[3].name, "delay");
  EXPECT_EQ(model.call_j.at("cpu"), 0.01);
  EXPECT_EQ(model.provenance, Provenance::kFitted);
  EXPECT_EQ(model.source, "somewhere");

  const auto& mode = platform.modes.at("throughput");
  EXPECT_EQ(mode.weights, (std::map<std::string, int>{{"npu", 4}, {"cpu", 0}}));
  EXPECT_EQ(mode.in_flight, 7);
  EXPECT_EQ(mode.stage_scale.at("npu.setup"), 1.299);
}

TEST(Platform, ATimeIsShortForOneStageOnTheUnitItself) {
  const auto parsed = [](const std::string& cpu) {
    return parse_platform("test.yaml",
                          "platform: p\nunits: {cpu: {}, gpu: {}}\nworkloads:\n  mine.icp: {cpu: " +
                              cpu + ", gpu: [{on: cpu, ms: 1}]}\n",
                          {}, 1);
  };
  for (const char* time : {"48", "{uniform: [48, 50]}"}) {
    const Platform platform = parsed(time);
    const auto& stages = platform.workloads.at("mine.icp").stages.at("cpu");
    ASSERT_EQ(stages.size(), 1U) << time;
    EXPECT_EQ(stages[0].name, "execute");
    EXPECT_EQ(stages[0].on, "cpu");
    EXPECT_EQ(stages[0].time.low, from_ms(48));
  }
  for (const char* bad : {"-1", "fast", "{uniform: [2, 1]}", "{on: cpu, ms: 1}", "2e9"}) {
    EXPECT_THAT(test::bad_input([&] { static_cast<void>(parsed(bad)); }), HasSubstr("test.yaml:4"))
        << bad;
  }
}

TEST(Platform, SaysHowLongAUnitStaysAwake) {
  const auto platform = parse(
      "platform: p\nunits:\n  a: {backend: cpu}\n  b: {backend: cpu, spin_us: 0}\n"
      "  c: {backend: cpu, spin_us: 2.5}\n");
  EXPECT_EQ(platform.unit("a").spin, Nanos(20'000));
  EXPECT_EQ(platform.unit("b").spin, Nanos(0));
  EXPECT_EQ(platform.unit("c").spin, Nanos(2'500));
}

TEST(Platform, SaysFileLineAndPathOfAWrongUnit) {
  EXPECT_EQ(refused("platform: p\nunits:\n  cpu:\n    slotz: 3\n"),
            "p.yaml:4: units.cpu.slotz: unknown key (did you mean slots?)");
  EXPECT_THAT(refused_unit("slots: 0"),
              StartsWith("p.yaml:2: units.cpu.slots: must be between 1 and"));
  EXPECT_THAT(refused_unit("servers: 0"), HasSubstr("units.cpu.servers: must be between 1"));
  EXPECT_THAT(refused_unit("servers: 1.5"), HasSubstr("whole number"));
  EXPECT_THAT(refused_unit("active_w: -1"), HasSubstr("units.cpu.active_w: must be between 0"));
  EXPECT_THAT(refused_unit("active_w: .nan"), HasSubstr("finite number"));
  EXPECT_THAT(refused_unit("active_w: 1, active_w: 2"),
              HasSubstr("units.cpu.active_w: given twice"));
  EXPECT_THAT(refused_unit("discipline: fifoo"), HasSubstr("did you mean fifo"));
  EXPECT_THAT(refused_unit("role: gpuu"), HasSubstr("did you mean gpu"));
  EXPECT_THAT(refused_unit("link: wire"), HasSubstr("units.cpu.link: no link 'wire'"));
  EXPECT_THAT(refused_unit("energy: {op_j: 1}"), HasSubstr("units.cpu.energy.op_j: unknown key"));
  EXPECT_THAT(refused_unit("backend: cpuu"),
              AllOf(HasSubstr("units.cpu.backend"), HasSubstr("did you mean cpu")));
  EXPECT_THAT(refused_unit("cores: all"), HasSubstr("needs a `backend:`"));
  EXPECT_THAT(refused_unit("spin_us: 5"), HasSubstr("needs a `backend:`"));
  for (const char* value : {"-1", "20.5", ".inf", "long"}) {
    EXPECT_THAT(refused_unit(std::string("backend: cpu, spin_us: ") + value),
                StartsWith("p.yaml:2: units.cpu.spin_us: "))
        << value;
  }
  EXPECT_THAT(refused_unit("backend: cpu, spin: 5"), HasSubstr("did you mean spin_us"));
  EXPECT_THAT(refused_unit("backend: cpu, script: {a: 1}"), HasSubstr("only backend fake"));
  EXPECT_THAT(refused_unit("backend: fake, script: text"), HasSubstr("must be a map"));
}

TEST(Platform, SaysWhichDevicesItsWattsAreOf) {
  const auto unit = [](const std::string& keys, const std::vector<YamlOverride>& set = {}) {
    return parse_platform("p.yaml", "platform: p\nunits:\n  gpu: {backend: opencl, " + keys + "}\n",
                          set, 1)
        .units[0];
  };
  const std::string watts = "active_w: 9, idle_w: 1, held_w: 2";
  EXPECT_EQ(on_device(unit(watts), false).active_w, 9);
  EXPECT_EQ(on_device(unit(watts + ", watts_of: device"), false).standing_w(), 3);
  const std::string assumed = watts + ", watts_of: host_cores";
  EXPECT_EQ(on_device(unit(assumed), true).standing_w(), 3);
  EXPECT_EQ(on_device(unit(assumed), false).active_w, 0);
  EXPECT_EQ(on_device(unit(assumed), false).standing_w(), 0);
  EXPECT_EQ(on_device(unit(assumed, {{"gpu.active_w", "5"}}), false).active_w, 5);
  const auto set =
      on_device(unit(assumed, {{"gpu.energy.call_j", "7"}, {"gpu.held_w", "6"}}), false);
  EXPECT_EQ(set.call_j, 7);
  EXPECT_EQ(set.active_w, 0) << "which the user did not say";
  EXPECT_EQ(set.standing_w(), 6);
  const std::string fitted = assumed + ", energy: {call_j: 1, provenance: fitted}";
  EXPECT_EQ(on_device(unit(fitted), false).call_j, 1) << "to what a meter showed of the device";
  EXPECT_THAT(refused_unit("watts_of: hostcores"), HasSubstr("host_cores"));
}

/// The platform with one number in each place that takes one; @p bad in the place called @p key.
std::string with_number(const std::string& key, const std::string& bad) {
  const auto number = [&](const std::string& name, const std::string& good) {
    return name + ": " + (name == key ? bad : good);
  };
  return "platform: p\nunits:\n  cpu: {" + number("servers", "1") + ", " + number("slots", "1") +
         ", " + number("active_w", "1") + ", " + number("idle_w", "0") + ", " +
         number("held_w", "0") + ",\n    energy: {" + number("op_pj", "1") + ", " +
         number("byte_pj", "1") + ", " + number("call_j", "1") + "}}\nlinks: {l: {" +
         number("mbit_s", "1") + ", " + number("latency_ms", "1") +
         "}}\nworkloads:\n  sobel: {cpu: [{on: cpu, " + number("ms", "1") + "}, {" +
         number("delay_ms", "{uniform: [0, 1]}") + "}]}\nmodes:\n  latency: {weights: {" +
         number("cpu", "1") + "}, " + number("in_flight", "1") + ", stage_scale: {" +
         number("cpu.execute", "1") + "}}\n";
}

TEST(Platform, RefusesEachNumberOutsideItsRange) {
  EXPECT_EQ(parse(with_number("", "")).units.size(), 1U);
  const auto expect_refused = [](const std::string& key, const std::string& bad) {
    EXPECT_THAT(refused(with_number(key, bad)),
                AllOf(StartsWith("p.yaml:"), HasSubstr(key + ": must be")))
        << key << ": " << bad;
  };
  for (const char* key : {"servers", "slots", "in_flight"}) {
    for (const char* bad : {"0", "-1", "1.5", "1e3", "010", "0x10", "1000001", "4294967297",
                            "18446744073709551617", ".nan", "'1'", "many"}) {
      expect_refused(key, bad);
    }
  }
  for (const char* key :
       {"active_w", "idle_w", "held_w", "op_pj", "byte_pj", "call_j", "mbit_s", "cpu.execute"}) {
    for (const char* bad : {"-1", "1e300", "1e-999", ".inf", ".nan", "010", "0x1", "+1", "'1'"}) {
      expect_refused(key, bad);
    }
  }
  for (const char* key : {"latency_ms", "ms", "delay_ms"}) {
    for (const char* bad : {"1e-7", "1e-320", "-1", "1000000001", ".inf", ".nan", "010", "+1"}) {
      expect_refused(key, bad);
    }
  }
  EXPECT_THAT(refused(with_number("delay_ms", "{uniform: [0, 1e-7]}")),
              HasSubstr("delay_ms.uniform[1]: must be 0 or at least 1e-06"));
  EXPECT_EQ(parse(with_number("latency_ms", "0")).links.at("l").latency.mean(), Nanos(0));
}

TEST(Platform, SaysWhereInTheFileTheScriptOfAFakeUnitIsWrong) {
  const auto with = [](const std::string& script) {
    return refused("platform: p\nunits:\n  gpu:\n    backend: fake\n    script:\n      seed: 1\n" +
                   script);
  };
  EXPECT_EQ(with("      device_init_ms: 1e-7\n"),
            "p.yaml:7: units.gpu.script.device_init_ms: must be 0 or at least 1e-06 (a "
            "nanosecond), got 1e-7");
  EXPECT_THAT(with("      cache_kb: 010\n"),
              StartsWith("p.yaml:7: units.gpu.script.cache_kb: must be"));
  EXPECT_THAT(with("      devise: x\n"), HasSubstr("did you mean device"));
  EXPECT_EQ(with("      seed: 2\n"), "p.yaml:7: units.gpu.script.seed: given twice");
}

TEST(Platform, RefusesUnknownWorkloadsInTheScriptOfAFakeUnit) {
  const auto with = [](const std::string& script) {
    return refused_unit("backend: fake, script: {" + script + "}");
  };
  EXPECT_THAT(with("crash: [sobel, sobl]"),
              AllOf(StartsWith("p.yaml:2: units.cpu.script.crash[1]: there is no workload 'sobl'"),
                    HasSubstr("did you mean sobel")));
  for (const char* key :
       {"stages: {sobl: [{ms: 1}]}", "samples_ms: {sobl: [1]}", "wrong_output_after: {sobl: 1}"}) {
    EXPECT_THAT(with(key), HasSubstr("there is no workload 'sobl'")) << key;
  }
  const auto platform = parse(
      "platform: p\nunits: {gpu: {backend: fake, script: "
      "{hang: [mine.icp, sobel@640x480, fc6@int8], samples_ms: {ncnn.alexnet: [1]}}}}\n");
  EXPECT_THAT(platform.unit("gpu").script, HasSubstr("sobel@640x480"));
}

TEST(Platform, ReadsTextOfSeveralLinesAsOne) {
  const auto platform = parse(
      "platform: p\ndescription: |\n  one\n  two\nassumptions: >\n  a\n\n  b\nunits: {cpu: {}}\n");
  EXPECT_EQ(platform.description, "one two");
  EXPECT_EQ(platform.assumptions, "a b");
  EXPECT_THAT(refused_unit("backend: fake, device: \"a\\nb\""), HasSubstr("units.cpu.device"));
}

TEST(Platform, RefusesFilesThatSayNothing) {
  EXPECT_THAT(refused("units: {cpu: {}}\n"), HasSubstr("missing key 'platform'"));
  EXPECT_THAT(refused("platform: p\n"), HasSubstr("missing key 'units'"));
  EXPECT_THAT(refused("platform: p\nunits: {}\n"), HasSubstr("at least one unit"));
  EXPECT_THAT(refused("platform: p\nunits: {a b: {}}\n"), HasSubstr("letters, digits"));
  EXPECT_THAT(refused("platform: p\nunits: {source: {}}\n"), HasSubstr("cannot name a unit"));
  EXPECT_THAT(refused("just text\n"), HasSubstr("must be a map"));
  EXPECT_THAT(refused("platform: p\nunits: {cpu: {}}\nworkload: {}\n"),
              HasSubstr("did you mean workloads"));
}

TEST(Platform, ChecksWhatRefersToWhat) {
  const auto with = [](const std::string& rest) {
    return refused("platform: p\nunits: {cpu: {}, gpu: {}}\n" + rest);
  };
  EXPECT_THAT(with("workloads:\n  sobell: {cpu: [{on: cpu, ms: 1}]}\n"),
              AllOf(StartsWith("p.yaml:4: workloads.sobell"), HasSubstr("did you mean sobel")));
  EXPECT_THAT(with("workloads: {sobel: {cpuu: [{on: cpu, ms: 1}]}}\n"),
              HasSubstr("did you mean cpu"));
  EXPECT_THAT(
      with("workloads: {sobel: {cpu: [{on: gpuu, ms: 1}]}}\n"),
      AllOf(HasSubstr("workloads.sobel.cpu[0].on: no unit 'gpuu'"), HasSubstr("did you mean gpu")));
  EXPECT_THAT(with("workloads: {sobel: {cpu: []}}\n"), HasSubstr("at least one stage"));
  EXPECT_THAT(with("workloads: {sobel: {cpu: [{on: cpu}]}}\n"), HasSubstr("missing key 'ms'"));
  EXPECT_THAT(with("workloads: {sobel: {cpu: [{on: cpu, delay_ms: 1}]}}\n"), HasSubstr("either"));
  EXPECT_THAT(with("workloads: {sobel: {cpu: [{on: cpu, ms: -1}]}}\n"), HasSubstr("between 0"));
  EXPECT_THAT(with("workloads: {sobel: {cpu: [{delay_ms: {uniform: [5, 2]}}]}}\n"),
              HasSubstr("low must not be above"));
  EXPECT_THAT(with("workloads: {sobel: {cpu: [{delay_ms: {uniform: [5]}}]}}\n"),
              HasSubstr("[low, high]"));
  EXPECT_THAT(with("workloads: {sobel: {call_j: {dsp: 1}}}\n"), HasSubstr("no unit 'dsp'"));
  EXPECT_THAT(with("workloads: {sobel: {provenance: guessed}}\n"),
              HasSubstr("'guessed' is not one of"));
  EXPECT_THAT(with("links: {l: {latency_ms: 1}}\n"), HasSubstr("missing key 'mbit_s'"));
  EXPECT_THAT(with("links: {l: {mbit_s: 0}}\n"), HasSubstr("links.l.mbit_s"));
  EXPECT_THAT(with("modes: {latency: {weights: {dsp: 1}}}\n"),
              HasSubstr("modes.latency.weights.dsp: no unit 'dsp'"));
  EXPECT_THAT(with("modes: {latency: {weights: {cpu: -1}}}\n"),
              HasSubstr("modes.latency.weights.cpu"));
  EXPECT_THAT(with("modes: {latency: {weights: {cpu: 0}}}\n"), HasSubstr("all weights are 0"));
  EXPECT_THAT(with("modes: {latency: {in_flight: 0}}\n"), HasSubstr("modes.latency.in_flight"));
  EXPECT_THAT(with("workloads: {sobel: {cpu: [{on: cpu, ms: 1, name: kernel}]}}\n"
                   "modes: {latency: {stage_scale: {cpu.kernle: 2}}}\n"),
              HasSubstr("did you mean cpu.kernel"));
}

const std::string kHalves = R"(
platform: halves
units:
  first: {backend: cpu, cores: first_half}
  second: {backend: cpu, cores: second_half}
)";

TEST(PlatformCores, AreHalvedWithTheOddOneInTheFirstHalf) {
  const auto four = parse(kHalves, 4);
  EXPECT_THAT(four.unit("first").cores, ElementsAre(0, 1));
  EXPECT_THAT(four.unit("second").cores, ElementsAre(2, 3));
  EXPECT_FALSE(four.unit("first").shares_cores);
  const auto three = parse(kHalves, 3);
  EXPECT_THAT(three.unit("first").cores, ElementsAre(0, 1));
  EXPECT_THAT(three.unit("second").cores, ElementsAre(2));
}

TEST(PlatformCores, OfAGpuAreTwoOrHalfOfFewerThanFour) {
  const auto cores_of = [](const std::string& unit, int cores) {
    return parse(
               "platform: p\nunits:\n  cpu: {backend: cpu, cores: all_but_two}\n"
               "  gpu: {backend: cpu, cores: last_two}\n",
               cores)
        .unit(unit)
        .cores;
  };
  EXPECT_THAT(cores_of("cpu", 6), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(cores_of("gpu", 6), ElementsAre(4, 5));
  EXPECT_THAT(cores_of("cpu", 4), ElementsAre(0, 1));
  EXPECT_THAT(cores_of("cpu", 3), ElementsAre(0, 1));
  EXPECT_THAT(cores_of("gpu", 3), ElementsAre(2));
  EXPECT_THAT(cores_of("cpu", 2), ElementsAre(0));
  EXPECT_THAT(cores_of("gpu", 2), ElementsAre(1));
  EXPECT_THAT(cores_of("gpu", 1), ElementsAre(0));
}

TEST(PlatformCores, AreSharedAndMarkedWhereThereIsOne) {
  const auto one = parse(kHalves, 1);
  for (const char* unit : {"first", "second"}) {
    EXPECT_THAT(one.unit(unit).cores, ElementsAre(0));
    EXPECT_TRUE(one.unit(unit).shares_cores);
  }
}

TEST(PlatformCores, MayBeListed) {
  const auto listed = [](const std::string& cores) {
    return parse("platform: p\nunits: {a: {backend: cpu, cores: " + cores +
                     "}, b: {backend: cpu, cores: all}, c: {backend: cpu}}\n",
                 2);
  };
  EXPECT_THAT(listed("[5, 1]").unit("a").cores, ElementsAre(5, 1));
  EXPECT_TRUE(listed("[5, 1]").unit("a").shares_cores);
  EXPECT_TRUE(listed("[5, 1]").unit("b").shares_cores);
  EXPECT_THAT(listed("[5, 1]").unit("b").cores, ElementsAre(0, 1));
  EXPECT_FALSE(listed("[5]").unit("a").shares_cores);
  EXPECT_THAT(listed("[5]").unit("c").cores, IsEmpty());
  for (const char* bad : {"[]", "[-1]", "[0, 0]", "half", "[x]"}) {
    EXPECT_THAT(bad_input([&] { static_cast<void>(listed(bad)); }), HasSubstr("units.a.cores"))
        << bad;
  }
}

TEST(PlatformCores, AreThoseThatTheProcessMayUse) {
  EXPECT_THAT(usable_cores(), testing::Not(IsEmpty()));
  EXPECT_EQ(load_platform("host-cpu").unit("cpu").cores, usable_cores());
}

TEST(Platform, KeepsTheScriptOfAFakeUnitAsText) {
  const auto platform =
      parse("platform: p\nunits: {gpu: {backend: fake, script: {wrong_output: [sobel]}}}\n");
  const auto script = parse_yaml("script", platform.unit("gpu").script);
  EXPECT_EQ(script.at("wrong_output").items()[0].text(), "sobel");
}

TEST(Platform, HandsTheSettingsOfACloudToItsBackend) {
  const auto platform = parse(
      "platform: p\nunits: {cloud: {backend: nats, server: 'nats://[::1]:4222', robot: r1}}\n");
  const auto settings = parse_yaml("settings", platform.unit("cloud").script);
  EXPECT_EQ(settings.at("server").text(), "nats://[::1]:4222");
  EXPECT_EQ(settings.at("robot").text(), "r1");
  EXPECT_EQ(make_unit_request(platform, platform.unit("cloud")).script,
            platform.unit("cloud").script);
  EXPECT_THAT(refused_unit("backend: cpu, server: x"),
              HasSubstr("units.cpu.server: only a unit with `backend: nats` has that"));
  EXPECT_THAT(refused_unit("server: x"), HasSubstr("only a unit with `backend: nats`"));
  EXPECT_THAT(refused_unit("backend: nats, servr: x"), HasSubstr("did you mean server"));
}

TEST(PlatformOverrides, SetOneValueOfAUnit) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const auto platform = load_platform(
      "host", {parse_override("cpu.active_w=15"), parse_override("opencl.energy.op_pj=3")});
  EXPECT_EQ(platform.unit("cpu").active_w, 15);
  EXPECT_EQ(platform.unit("opencl").op_pj, 3);
}

TEST(PlatformOverrides, AreExplainedWhenTheyCannotBeRead) {
  for (const char* bad :
       {"cpu.active_w", "cpu.active_w=", "active_w=3", "=3", ".x=3", "cpu.=3", ""}) {
    EXPECT_THAT(bad_input([&] { static_cast<void>(parse_override(bad)); }),
                HasSubstr("unit.key=value"))
        << bad;
  }
  EXPECT_EQ(parse_override("a.b=c=d").value, "c=d");
}

TEST(PlatformOverrides, WithAMisspeltMapAreRefused) {
  EXPECT_THAT(bad_input([] {
                static_cast<void>(parse("platform: p\nunits: {cpu: {}}\n", 2,
                                        {parse_override("cpu.nrgy.op_pj=1")}));
              }),
              HasSubstr("nrgy"));
}

TEST(ShippedPlatforms, AllLoadUnderTheirNames) {
  EXPECT_THAT(shipped_platforms(),
              ElementsAre("de1-soc", "fake", "host", "host-cloud", "host-cpu", "host-gpu",
                          "host-opencl", "jetson-tx1", "snapdragon820", "snapdragon820-counted",
                          "snapdragon820-section5"));
  for (const auto& name : shipped_platforms()) {
    const auto platform = load_platform(name);
    EXPECT_EQ(platform.name, name);
    EXPECT_FALSE(platform.description.empty());
    EXPECT_FALSE(platform.assumptions.empty());
  }
}

TEST(ShippedPlatforms, FakeServesEveryWorkloadOfTheCatalog) {
  const auto platform = load_platform("fake");
  for (const auto& workload : workload_names()) {
    ASSERT_TRUE(platform.workloads.contains(workload)) << workload;
    for (const char* unit : {"cpu", "gpu", "dsp"}) {
      ASSERT_TRUE(platform.workloads.at(workload).stages.contains(unit))
          << workload << " on " << unit;
      for (const auto& stage : platform.workloads.at(workload).stages.at(unit)) {
        EXPECT_EQ(stage.on, unit);
        EXPECT_TRUE(phase_from_string(stage.name)) << stage.name;
      }
    }
  }
}

TEST(ShippedPlatforms, HostMeasuresTwoUnitsAndPublishesTheCloud) {
  PIRT_BACKEND_OR_SKIP("opencl")
  const auto host = load_platform("host");
  EXPECT_EQ(host.unit("cpu").backend, "cpu");
  EXPECT_EQ(host.unit("opencl").backend, "opencl");
  EXPECT_EQ(host.unit("opencl").role, Role::kGpu);
  EXPECT_FALSE(host.unit("cloud").measured());
  const auto& alexnet = host.workloads.at("alexnet");
  EXPECT_EQ(alexnet.provenance, Provenance::kPublished);
  EXPECT_EQ(alexnet.call_j.at("cloud"), 0.010);
  EXPECT_EQ(alexnet.stages.at("cloud")[0].time.low, from_ms(2000));
  EXPECT_EQ(alexnet.stages.at("cloud")[0].time.high, from_ms(5000));
  EXPECT_THAT(host.assumptions, HasSubstr("--set cpu.active_w=15"));
}

TEST(ShippedPlatforms, HostGpuComputesOnADeviceWithMemoryOfItsOwn) {
  const auto host = load_platform("host-gpu");
  const UnitModel& gpu = host.unit("gpu");
  EXPECT_EQ(gpu.role, Role::kGpu);
  EXPECT_EQ(gpu.device, "own_memory");
  EXPECT_THAT(host.neighbours(gpu), IsEmpty()) << "it shares no memory";
  EXPECT_FALSE(host.states_power(gpu)) << "the meter's, or none";
  EXPECT_FALSE(host.unit("cloud").measured());
}

TEST(ShippedPlatforms, UnknownNamesComeWithTheNearest) {
  EXPECT_THAT(bad_input([] { static_cast<void>(load_platform("hots")); }),
              AllOf(HasSubstr("'hots'"), HasSubstr("host")));
  EXPECT_THAT(bad_input([] { static_cast<void>(load_platform("/nowhere/x.yaml")); }),
              HasSubstr("/nowhere/x.yaml"));
  EXPECT_TRUE(names_a_file("x.yaml"));
  EXPECT_TRUE(names_a_file("./host"));
  EXPECT_FALSE(names_a_file("host"));
}

TEST(Platform, LoadsFromAFile) {
  const auto path = std::filesystem::path(testing::TempDir()) / "pirt_platform_test.yaml";
  std::ofstream(path) << "platform: mine\nunits: {gpu: {}}\n";
  EXPECT_EQ(load_platform(path.string()).name, "mine");
  std::ofstream(path) << "platform: mine\nunits: {gpu: {slots: x}}\n";
  EXPECT_THAT(bad_input([&] { static_cast<void>(load_platform(path.string())); }),
              StartsWith(path.string() + ":2: units.gpu.slots"));
  std::filesystem::remove(path);
}

TEST(Platform, NamesTheNearestUnit) {
  PIRT_BACKEND_OR_SKIP("opencl")
  EXPECT_THAT(bad_input([] { static_cast<void>(load_platform("host").unit("openc")); }),
              HasSubstr("did you mean opencl"));
}

TEST(Platform, IsAsItsReferenceSays) {
  const std::string text = yaml_example("characterize/platform/README.md");
  const Platform platform = parse_platform("README.md", text, {}, 4);
  EXPECT_GE(platform.units.size(), 4U);
}

}  // namespace
}  // namespace pirt::test
