#include "tests/scheduler/support.h"
#include "tests/support/documentation.h"
#include "workloads/catalog/own_list.h"
#include "workloads/own/definition.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

std::string refused(const std::string& yaml) {
  return bad_input([&] { static_cast<void>(mix_of(yaml)); });
}

/// A mix of one pipeline `p` with the given lines inside it.
std::string pipeline(const std::string& lines) { return "mix: m\npipelines:\n  p:\n" + lines; }

TEST(Mix, ReadsEveryKey) {
  const Mix mix = mix_of(R"(
mix: robot
description: all keys
image_buffers: 3
pipelines:
  first:
    rate_hz: 12.5
    offset_ms: 7
    jitter_ms: 2.5
    deadline_ms: 40
    expires_ms: 25.5
    real_time: false
    eligible: [gpu]
    tasks:
      - {name: a, workload: sobel, image_input: true}
      - {name: b, workload: fc8, after: [a, {task: a, bytes: 10}, {task: a, bytes: 20}], eligible: [cpu, dsp]}
  second:
    closed_loop: {frames: 7}
    tasks: [{workload: conv1}]
)");
  EXPECT_EQ(mix.name, "robot");
  EXPECT_EQ(mix.description, "all keys");
  EXPECT_EQ(mix.image_buffers, 3);
  ASSERT_EQ(mix.pipelines.size(), 2U);
  const Pipeline& first = mix.pipelines[0];
  EXPECT_EQ(first.rate_hz, 12.5);
  EXPECT_EQ(first.offset, Nanos(7'000'000));
  EXPECT_EQ(first.jitter, Nanos(2'500'000));
  EXPECT_EQ(first.deadline, Nanos(40'000'000));
  EXPECT_EQ(first.expires, Nanos(25'500'000));
  EXPECT_FALSE(first.real_time);
  EXPECT_TRUE(first.has_image_input());
  EXPECT_THAT(first.tasks[0].eligible, ElementsAre("gpu"));
  EXPECT_THAT(first.tasks[1].eligible, ElementsAre("cpu", "dsp"));
  EXPECT_THAT(first.tasks[1].after, ElementsAre(0, 0, 0));
  EXPECT_EQ(first.tasks[1].input_bytes, 30);
  const Pipeline& second = mix.pipelines[1];
  EXPECT_EQ(second.frames, 7);
  EXPECT_TRUE(second.real_time);
  EXPECT_FALSE(second.has_image_input());
  EXPECT_EQ(second.tasks[0].name, "conv1");
  EXPECT_FALSE(second.tasks[0].input_bytes);
}

TEST(Mix, BytesAreThoseOfForeignTasks) {
  const auto one = [](const std::string& task) {
    return pipeline("    rate_hz: 1\n    tasks: [{" + task + "}]\n");
  };
  const Mix alike = mix_of(one("workload: mine.icp, bytes: 921600"));
  EXPECT_EQ(alike.pipelines[0].tasks[0].bytes->in, 921600);
  EXPECT_EQ(alike.pipelines[0].tasks[0].bytes->out, 921600);
  const Mix two = mix_of(one("workload: mine.icp, bytes: {in: 10, out: 0}"));
  EXPECT_EQ(two.pipelines[0].tasks[0].bytes->in, 10);
  EXPECT_EQ(two.pipelines[0].tasks[0].bytes->out, 0);
  EXPECT_THAT(refused(one("workload: sobel, bytes: 1")),
              AllOf(HasSubstr("test.yaml:5"), HasSubstr("tensors of sobel")));
  EXPECT_THAT(refused(one("name: a, service_ms: {cpu: 1}, bytes: 1")), HasSubstr("edges"));
  for (const char* bad : {"-1", "1.5", "1e13", "{in: 1}", "{in: 1, out: 1, at: 1}"}) {
    EXPECT_THAT(refused(one(std::string("workload: mine.icp, bytes: ") + bad)),
                HasSubstr("test.yaml:5"))
        << bad;
  }
  // Along an edge to a task that moves nothing itself; what the edge says goes before it.
  const Mix edges = mix_of(pipeline(R"(
    rate_hz: 1
    tasks:
      - {workload: mine.icp, bytes: {in: 10, out: 20}}
      - {name: a, service_ms: {cpu: 1}, after: [mine.icp]}
      - {name: b, service_ms: {cpu: 1}, after: [{task: mine.icp, bytes: 5}]}
      - {name: c, workload: mine.other, after: [mine.icp]}
)"));
  EXPECT_EQ(edges.pipelines[0].tasks[1].edges[0].bytes, 20);
  EXPECT_EQ(edges.pipelines[0].tasks[2].edges[0].bytes, 5);
  EXPECT_EQ(edges.pipelines[0].tasks[3].edges[0].bytes, std::nullopt);
}

// Times of it may be imported, or be in a platform file.
TEST(Mix, ReadsASizeThatAWorkloadOfSomebodyElsesDoesNotHave) {
  own::Definition fixed;
  fixed.name = "my.fixed";
  fixed.outputs = {own::tensor_from("out", "u8[4]")};
  fixed.backends = {"cpu"};
  std::vector<Workload> one;
  one.push_back(own::to_workload(fixed));
  make_known(std::move(one));
  const Mix mix = mix_of(pipeline("    rate_hz: 1\n    tasks: [{workload: my.fixed@64x48}]\n"));
  EXPECT_EQ(mix.pipelines[0].tasks[0].workload, "my.fixed@64x48");
}

TEST(Mix, TensorsOfInputsMayHaveDotsAsTasksMay) {
  own::Definition net;
  net.name = "my.net";
  net.inputs = {own::tensor_from("in", "u8[4]")};
  net.outputs = {own::tensor_from("model.24.m", "u8[4]")};
  net.backends = {"cpu"};
  std::vector<Workload> one;
  one.push_back(own::to_workload(net));
  make_known(std::move(one));
  const Mix mix = mix_of(pipeline(R"(
    rate_hz: 1
    tasks:
      - {workload: my.net}
      - {name: b, workload: my.net, inputs: {in: my.net.model.24.m}}
)"));
  EXPECT_THAT(mix.pipelines[0].tasks[1].after, ElementsAre(0));
}

TEST(Mix, PutsPredecessorsFirst) {
  const Mix mix = mix_of(pipeline(R"(
    rate_hz: 1
    tasks:
      - {name: last, workload: fc8, after: [middle, first]}
      - {name: middle, workload: fc8, after: [first]}
      - {name: other, workload: fc8}
      - {name: first, workload: fc8}
)"));
  // Ready in file order: `other`, then `first`, which frees `middle`, which frees `last`.
  std::vector<std::string> names;
  for (const auto& task : mix.pipelines[0].tasks) names.push_back(task.name);
  EXPECT_THAT(names, ElementsAre("other", "first", "middle", "last"));
  EXPECT_THAT(mix.pipelines[0].tasks[3].after, ElementsAre(2, 1));
}

TEST(Mix, PrintsTheCycle) {
  EXPECT_THAT(refused(pipeline(R"(
    rate_hz: 1
    tasks:
      - {name: start, workload: fc8}
      - {name: a, workload: fc8, after: [start, c]}
      - {name: b, workload: fc8, after: [a]}
      - {name: c, workload: fc8, after: [b]}
      - {name: behind, workload: fc8, after: [c]}
)")),
              AllOf(HasSubstr("pipelines.p"), HasSubstr("a -> b -> c -> a")));
  EXPECT_THAT(
      refused(pipeline("    rate_hz: 1\n    tasks: [{name: a, workload: fc8, after: [a]}]\n")),
      HasSubstr("a -> a"));
}

TEST(Mix, RefusesBadRates) {
  const std::string tasks = "\n    tasks: [{workload: fc8}]\n";
  for (const char* rate : {"0", "-1", ".nan", "nan", ".inf", "1e300", "fast", "'3'", "[1]", "1e-10",
                           "1000001", "010", "0x10", "+1"}) {
    EXPECT_THAT(refused(pipeline(std::string("    rate_hz: ") + rate + tasks)),
                HasSubstr("test.yaml:4: pipelines.p.rate_hz: "))
        << rate;
  }
}

/// The mix with one number in each place that takes one; @p bad in the place called @p key.
std::string with_number(const std::string& key, const std::string& bad) {
  const auto number = [&](const std::string& name, const std::string& good) {
    return name + ": " + (name == key ? bad : good);
  };
  return "mix: m\n" + number("image_buffers", "1") + "\npipelines:\n  p:\n    " +
         number("rate_hz", "1") + "\n    " + number("offset_ms", "0") + "\n    " +
         number("jitter_ms", "0") + "\n    " + number("deadline_ms", "1") + "\n    " +
         number("expires_ms", "1") + "\n    tasks:\n      - {name: a, workload: fc8}\n" +
         "      - {name: b, after: [{task: a, " + number("bytes", "0") + ", " +
         number("transfer_ms", "0") + "}], service_ms: {" + number("cpu", "1") + "}}\n" +
         "  q: {closed_loop: {" + number("frames", "1") + "}, tasks: [{workload: fc8}]}\n";
}

TEST(Mix, RefusesEachNumberOutsideItsRangeAtItsLine) {
  const std::vector<std::string> counts = {"image_buffers", "bytes", "frames"};
  const std::vector<std::string> times = {"offset_ms",  "jitter_ms",   "deadline_ms",
                                          "expires_ms", "transfer_ms", "cpu"};
  EXPECT_EQ(mix_of(with_number("", "")).pipelines.size(), 2U);
  const auto expect_refused = [](const std::string& key, const std::string& bad) {
    const std::string yaml = with_number(key, bad);
    const auto before = yaml.substr(0, yaml.find(key + ": "));
    const auto line = 1 + std::ranges::count(before, '\n');
    EXPECT_THAT(refused(yaml),
                AllOf(testing::StartsWith("test.yaml:" + std::to_string(line) + ": "),
                      HasSubstr(key + ": must be")))
        << key << ": " << bad;
  };
  for (const auto& key : counts) {
    for (const char* bad : {"-1", "1.5", "1e3", "010", "0x10", "1000000000001",
                            "9223372036854775808", "18446744073709551617", ".nan", "'1'", "many"}) {
      expect_refused(key, bad);
    }
  }
  for (const auto& key : times) {
    for (const char* bad : {"1e-7", "9.9e-7", "1e-320", "1e-999", "-1", "1000000001", "1e300",
                            ".inf", ".nan", "010", "0x1", "+1", "'1'", "soon"}) {
      expect_refused(key, bad);
    }
  }
  // 0 is "none" for a transfer, and nothing for the others.
  EXPECT_EQ(mix_of(with_number("transfer_ms", "0.0")).pipelines[0].tasks[1].edges[0].transfer,
            Nanos(0));
  for (const char* key : {"deadline_ms", "expires_ms", "cpu"}) expect_refused(key, "0");
  EXPECT_EQ(mix_of(with_number("deadline_ms", "1e-6")).pipelines[0].deadline, Nanos(1));
}

TEST(Mix, RefusesNamesThatATerminalWouldObey) {
  for (const char* name : {"\"a\\e[2J\"", "\"a\\nb\"", "\"a\\tb\"", "\"a\\Nb\""}) {
    EXPECT_THAT(refused(std::string("mix: ") + name + "\npipelines: {}\n"),
                testing::StartsWith("test.yaml:1: "))
        << name;
    EXPECT_THAT(refused(pipeline(std::string("    rate_hz: 1\n    tasks:\n      - {name: ") + name +
                                 ", workload: fc8}\n")),
                testing::StartsWith("test.yaml:6: "))
        << name;
    EXPECT_THAT(refused(std::string("mix: m\npipelines:\n  ") + name +
                        ": {rate_hz: 1, tasks: [{workload: fc8}]}\n"),
                testing::StartsWith("test.yaml:3: "))
        << name;
  }
  EXPECT_THAT(refused("mix: caf\xe9\npipelines: {}\n"),
              testing::StartsWith("test.yaml:1: not a text file"));
}

TEST(Mix, NamesTheNearestWorkloadTaskAndKey) {
  EXPECT_THAT(refused(pipeline("    rate_hz: 1\n    tasks: [{workload: sobell}]\n")),
              AllOf(HasSubstr("test.yaml:5: pipelines.p.tasks[0].workload"),
                    HasSubstr("did you mean sobel")));
  EXPECT_THAT(
      refused(pipeline("    rate_hz: 1\n    tasks: [{name: blur, workload: fc8},\n"
                       "      {name: x, workload: fc8, after: [blurr]}]\n")),
      AllOf(HasSubstr("test.yaml:6: pipelines.p.tasks[1].after"), HasSubstr("did you mean blur")));
  EXPECT_THAT(
      refused(pipeline("    rate_hzz: 1\n    tasks: [{workload: fc8}]\n")),
      AllOf(HasSubstr("test.yaml:4: pipelines.p.rate_hzz"), HasSubstr("did you mean rate_hz")));
}

TEST(Mix, RefusesWhatCannotRun) {
  const std::string task = "    tasks: [{workload: fc8}]\n";
  EXPECT_THAT(refused("mix: m\npipelines: {}\n"), HasSubstr("at least one pipeline"));
  EXPECT_THAT(refused(pipeline("    rate_hz: 1\n    tasks: []\n")), HasSubstr("at least one task"));
  EXPECT_THAT(refused(pipeline(task)), HasSubstr("one of rate_hz and closed_loop"));
  EXPECT_THAT(refused(pipeline("    rate_hz: 1\n    closed_loop: {frames: 1}\n" + task)),
              HasSubstr("one of rate_hz and closed_loop"));
  EXPECT_THAT(refused(pipeline("    closed_loop: {frames: 1}\n    jitter_ms: 1\n" + task)),
              HasSubstr("jitter_ms: is about pipelines with a rate_hz"));
  EXPECT_THAT(refused(pipeline("    rate_hz: 40\n    jitter_ms: 25.1\n" + task)),
              HasSubstr("must not be above the 25 ms between two firings"));
  EXPECT_THAT(refused(pipeline("    closed_loop: {frames: 0}\n" + task)),
              HasSubstr("closed_loop.frames"));
  EXPECT_THAT(refused(pipeline("    closed_loop: {frames: 1.5}\n" + task)),
              HasSubstr("whole number"));
  EXPECT_THAT(refused(pipeline("    rate_hz: 1\n    deadline_ms: 0\n" + task)),
              HasSubstr("deadline_ms: must be between"));
  EXPECT_THAT(refused(pipeline("    rate_hz: 1\n    eligible: []\n" + task)),
              HasSubstr("at least one unit"));
  EXPECT_THAT(refused(pipeline("    rate_hz: 1\n    tasks: [{workload: fc8}, {workload: fc8}]\n")),
              HasSubstr("two tasks are named 'fc8'"));
  EXPECT_THAT(refused("mix: m\nimage_buffers: 0\n" + pipeline("    rate_hz: 1\n" + task).substr(7)),
              HasSubstr("image_buffers"));
}

TEST(Mix, SortsALongGraphQuickly) {
  // 20,000 tasks, each after the next one in the file: the worst order. Quadratic sorting would not
  // end in sensible time.
  std::string yaml = "mix: long\npipelines:\n  p:\n    rate_hz: 1\n    tasks:\n";
  for (int i = 0; i < 20'000; ++i) {
    yaml += "      - {name: t" + std::to_string(i) + ", workload: fc8";
    yaml += i + 1 < 20'000 ? ", after: [t" + std::to_string(i + 1) + "]}\n" : "}\n";
  }
  const Mix mix = mix_of(yaml);
  EXPECT_EQ(mix.pipelines[0].tasks.front().name, "t19999");
  EXPECT_EQ(mix.pipelines[0].tasks.back().name, "t0");
}

TEST(ShippedMixes, AllLoad) {
  EXPECT_THAT(shipped_mixes(), ElementsAre("convolution-1000", "full-robot", "section5",
                                           "section5-cpu-only", "section5-placed", "table1-robot"));
  for (const auto& name : shipped_mixes()) {
    const Mix mix = load_mix(name);
    EXPECT_EQ(mix.name, name);
    EXPECT_FALSE(mix.description.empty());
  }
  EXPECT_THAT(bad_input([] { static_cast<void>(load_mix("full-robt")); }),
              AllOf(HasSubstr("'full-robt'"), HasSubstr("full-robot")));
  EXPECT_THAT(bad_input([] { static_cast<void>(load_mix("./none.yaml")); }),
              HasSubstr("./none.yaml"));
}

TEST(Mix, IsAsItsReferenceSays) {
  const Mix mix = parse_mix("README.md", yaml_example("scheduler/mix/README.md"));
  ScheduleOptions options;
  options.mode = "throughput";
  const RunRecord record = run_virtual(load_platform("fake"), nullptr, mix, options);
  EXPECT_GT(record.completed, 0);
  EXPECT_EQ(record.stalled, 0);
}

}  // namespace
}  // namespace pirt::test
