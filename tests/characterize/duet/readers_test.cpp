// What programs print, read as figures: each format, and what is none of it.
#include "characterize/duet/readers.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "characterize/duet/commands.h"
#include "characterize/published/published.h"
#include "tests/support/errors.h"

namespace pirt {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

Sample read(const std::string& reader, const std::string& output) {
  ProcessResult process;
  process.output = output;
  return find_reader(reader).read(process);
}

std::string refused(const std::string& reader, const std::string& output) {
  return test::bad_input([&] { static_cast<void>(read(reader, output)); });
}

TEST(OutputReader, TimeIsThatOfTheProcessWhateverItPrints) {
  ProcessResult process;
  process.output = "anything";
  process.wall = std::chrono::milliseconds(200);
  process.cpu = std::chrono::milliseconds(150);
  EXPECT_THAT(find_reader("time").read(process).seconds,
              ElementsAre(Pair("cpu", 0.15), Pair("memory", 0), Pair("wall", 0.2)));
  process.peak_bytes = 4096;
  const Sample sample = find_reader("time").read(process);
  EXPECT_EQ(sample.seconds.at("memory"), 4096);
  EXPECT_EQ(sample.measures.at("memory").unit, "bytes");
  // What may be pirt's own is nobody's: a program of 2 MB and one of 6 would be the same.
  process.inherited_bytes = 4000;
  EXPECT_EQ(find_reader("time").read(process).seconds.at("memory"), 0);
  process.peak_bytes = 4401;
  EXPECT_EQ(find_reader("time").read(process).seconds.at("memory"), 4401);
}

// As version 1.7.1 writes it, cut to what is read.
constexpr const char* kBenchmarks = R"({"context": {"num_cpus": 2}, "benchmarks": [
 {"name": "sort/8", "run_type": "iteration", "real_time": 20.0, "cpu_time": 1.0, "time_unit": "us"},
 {"name": "sort/8", "run_type": "iteration", "real_time": 40.0, "time_unit": "us"},
 {"name": "sort/8", "run_type": "iteration", "real_time": 30.0, "time_unit": "us"},
 {"name": "sort/8_mean", "run_type": "aggregate", "aggregate_name": "mean", "real_time": 9, "time_unit": "us"},
 {"name": "sort_BigO", "run_type": "aggregate", "aggregate_name": "BigO", "real_coefficient": 2, "time_unit": "ns"},
 {"name": "old_RMS", "rms": 0.1},
 {"name": "old", "real_time": 7.0}]})";

TEST(OutputReader, GbenchHasOneRealTimeABenchmarkAndNoAggregates) {
  const Sample sample = read("gbench", kBenchmarks);
  ASSERT_EQ(sample.seconds.size(), 2U);
  EXPECT_NEAR(sample.seconds.at("sort/8"), 30e-6, 1e-12) << "the median of its repetitions";
  EXPECT_NEAR(sample.seconds.at("old"), 7e-9, 1e-15) << "of a version without run_type";
  EXPECT_THAT(sample.measures, IsEmpty());
  EXPECT_EQ(read("gbench", std::string("a word before\n") + kBenchmarks).seconds.size(), 2U);
  const std::string ended = R"({"benchmarks": [{"name": "b", "real_time": 1}]
})";
  for (const char* behind : {"\n", "\ndone {}\n"}) {
    EXPECT_EQ(read("gbench", ended + behind).seconds.size(), 1U) << behind;
  }
  // Counters without a figure, as it writes them; a name may have the words.
  const Sample counted = read("gbench", R"({"benchmarks": [{"name": "NaN \"Infinity",
      "run_type": "iteration", "real_time": 5.0, "time_unit": "ns", "a": NaN, "b": -Infinity}]})");
  EXPECT_NEAR(counted.seconds.at("NaN \"Infinity"), 5e-9, 1e-15);
}

TEST(OutputReader, GbenchRefusesErrorsAndWhatIsNone) {
  EXPECT_THAT(refused("gbench", R"({"benchmarks": [{"name": "b", "run_type": "iteration",
                                  "error_occurred": true, "error_message": "no file"}]})"),
              AllOf(HasSubstr("benchmark b"), HasSubstr("no file")));
  EXPECT_THAT(refused("gbench", "hello"), HasSubstr("no JSON of Google Benchmark but 'hello'"));
  EXPECT_THAT(refused("gbench", R"({"benchmarks": []})"), HasSubstr("no figure"));
  EXPECT_THAT(refused("gbench", R"({"benchmarks": [{"name": "b"}]})"), HasSubstr("real_time"));
  EXPECT_THAT(refused("gbench", R"({"benchmarks": [{"name": "b", "real_time": 1,
                                  "time_unit": "years"}]})"),
              HasSubstr("years"));
}

// The same entries, as figures of a comparison and as rows that are imported.
TEST(OutputReader, GbenchAndImportsReadEachEntryAlike) {
  struct Case {
    const char* entry;
    std::optional<double> compared_s;
    std::optional<Nanos> imported;
    const char* left_out;  ///< Of the import.
  };
  const std::vector<Case> cases = {
      {R"("name": "sort", "real_time": 3, "time_unit": "us", "rate": NaN)", 3e-6, Nanos(3'000), ""},
      {R"("name": "sort_mean", "real_time": 3)", {}, {}, "aggregates"},
      {R"("name": "sort_BigO", "real_coefficient": 3)", {}, {}, "aggregates"},
      {R"("name": "sort", "skipped": true, "skip_message": "", "real_time": 0)", {}, {}, "skipped"},
      {R"("name": "sort", "real_time": 3, "threads": 2)", 3e-9, {}, "several threads"},
      {R"("name": "sort", "real_time": 0.25)", 0.25e-9, {}, "below a nanosecond"},
      {R"("name": "all", "run_name": "sort", "real_time": 3)", 3e-9, Nanos(3), ""}};
  for (const Case& each : cases) {
    const std::string json =
        fmt::format("a word before\n{{\"context\": {{}}, \"benchmarks\": [{{{}}}, {}]}}",
                    each.entry, R"({"name": "other", "real_time": 5})");
    const Sample sample = read("gbench", json);
    EXPECT_EQ(sample.seconds.size(), each.compared_s ? 2U : 1U) << each.entry;
    if (each.compared_s) {
      EXPECT_NEAR(sample.seconds.at("sort"), *each.compared_s, 1e-15) << each.entry;
    }
    const Publication publication = read_publication("g.json", json);
    const auto& figures = publication.boards.at(0).figures;
    ASSERT_EQ(figures.size(), each.imported ? 2U : 1U) << each.entry;
    if (each.imported) {
      EXPECT_EQ(figures[0].workload, "gbench.sort");
      EXPECT_THAT(figures[0].samples, ElementsAre(*each.imported)) << each.entry;
      EXPECT_THAT(publication.left_out, IsEmpty());
    } else {
      EXPECT_THAT(publication.left_out, ElementsAre(HasSubstr(each.left_out)));
    }
  }
}

TEST(OutputReader, GbenchIsAskedForWhatIsUndecidedOnly) {
  const auto arguments = find_reader("gbench").arguments;
  EXPECT_THAT(arguments({}), ElementsAre("--benchmark_format=json"));
  EXPECT_THAT(
      arguments({"sort/8", "f<int>(1+2)"}),
      ElementsAre("--benchmark_format=json", R"(--benchmark_filter=^(sort/8|f<int>\(1\+2\))$)"));
  EXPECT_THAT(arguments(std::vector<std::string>(1000, std::string(100, 'x'))),
              ElementsAre("--benchmark_format=json"))
      << "no longer than an argument may be";
}

TEST(OutputReader, LinesHaveANameAValueAUnitAndADirection) {
  const Sample sample = read(
      "lines", "# a comment\n\nparse 1.5e-3 s\r\nrate\t90 MB/s higher\nrate 110 MB/s higher\n");
  EXPECT_EQ(sample.seconds.at("parse"), 1.5e-3);
  EXPECT_EQ(sample.seconds.at("rate"), 100);
  EXPECT_FALSE(sample.measures.contains("parse"));
  EXPECT_EQ(sample.measures.at("rate").unit, "MB/s");
  EXPECT_TRUE(sample.measures.at("rate").higher_is_better);
}

TEST(OutputReader, LinesRefusesOddOnesWithTheirNumber) {
  EXPECT_THAT(refused("lines", "a 1 s\nb 2"), AllOf(HasSubstr("line 2"), HasSubstr("NAME VALUE")));
  EXPECT_THAT(refused("lines", "a one s"), HasSubstr("'one' is no number"));
  EXPECT_THAT(refused("lines", "a nan s"), HasSubstr("no finite figure"));
  EXPECT_THAT(refused("lines", "a 1 s better"), HasSubstr("'better' is no direction"));
  for (const char* rate : {"MB/s", "frames/sec", "img/sec.", "req/min", "km/h", "fps", "Mbps",
                           "iops", "Hz", "GFLOPS"}) {
    EXPECT_THAT(refused("lines", std::string("a 1 ") + rate), HasSubstr("say lower or higher"));
    EXPECT_EQ(read("lines", std::string("a 1 ") + rate + " lower").seconds.at("a"), 1);
  }
  for (const char* unit : {"ms", "ps", "s/frame", "drops"}) {
    EXPECT_EQ(read("lines", std::string("a 1 ") + unit).seconds.at("a"), 1) << unit;
  }
  EXPECT_THAT(refused("lines", "a 1 s\na 1 ms"), HasSubstr("another unit"));
  EXPECT_THAT(refused("lines", "# nothing\n"), HasSubstr("no figure"));
  std::string many;
  for (int i = 0; i < 1001; ++i) many += "n" + std::to_string(i) + " 1 s\n";
  EXPECT_THAT(refused("lines", many), HasSubstr("more than 1000"));
  EXPECT_THAT(refused("lines", std::string(201, 'x') + " 1 s"), HasSubstr("201 characters"));
  EXPECT_THAT(refused("lines", "d\xe9 1 s"), HasSubstr("not UTF-8"));
  EXPECT_THAT(refused("lines", "a 1 \xb5s"), HasSubstr("not UTF-8"));
}

TEST(OutputReader, OfTwoWorkloadsTheFirstProcessesVerifyAndInputsAreTheirOwn) {
  EXPECT_EQ(workload_reader().first, "--verify");
  ProcessResult process;
  process.output = R"({"pirt_sample": 1, "device": "CPU", "inputs": "abc", "right": false,
                      "detail": "3 differ", "seconds": {"call": 0.5, "device_init": 1}})";
  const Sample sample = workload_reader().read(process);
  EXPECT_EQ(sample.inputs, "");
  EXPECT_EQ(sample.right, false);
  EXPECT_FALSE(sample.seconds.contains("device_init"));
}

TEST(OutputReader, PirtIsOneOfThem) {
  EXPECT_EQ(read("pirt", R"({"pirt_sample": 1, "version": "1", "device": "CPU",
                            "seconds": {"call": 0.5}})")
                .seconds.at("call"),
            0.5);
  EXPECT_THAT(refused("pirt", R"({"pirt_sample": 1, "version": "1", "device": "CPU",
                                 "seconds": {"call": -1}})"),
              HasSubstr("below 0"));
  EXPECT_THAT(test::bad_input([] { static_cast<void>(find_reader("gbnch")); }),
              AllOf(HasSubstr("gbench"), HasSubstr("--reads")));
}

TEST(DuetCommands, SayHowLongADecisionTakes) {
  EXPECT_EQ(duration_text(1.1), "12 blocks of 4 runs of 1.1 s: about 53 s; confirming 2 min more");
  EXPECT_EQ(duration_text(0.001), "12 blocks of 4 runs of 0.001 s: about 1 s; confirming 1 s more");
  EXPECT_EQ(duration_text(60), "12 blocks of 4 runs of 60 s: about 48 min; confirming 2 h more");
}

TEST(DuetCommands, FindsAProgramAsAShellDoes) {
  EXPECT_TRUE(find_program("sh").is_absolute());
  EXPECT_EQ(find_program("/bin/sh"), "/bin/sh");
  EXPECT_THAT(test::bad_input([] { static_cast<void>(find_program("no-such-program")); }),
              HasSubstr("no program"));
  EXPECT_THAT(test::bad_input([] { static_cast<void>(find_program("/etc")); }),
              HasSubstr("no program"));
}

/// One process of each side as a command's, @p of says with which figures.
DuetCellState compared(const std::function<Sample(Side)>& of) {
  DuetComparison comparison({{std::string(kCommandCell), ""}}, 1);
  Ledger nowhere;
  run_duet(comparison, nowhere,
           [&of](Side side, const DuetCell&, SampleKind, Nanos) {
             return SampleOutcome{.sample = of(side), .error = {}};
           },
           one_at_a_time(1), {});
  return comparison.cells().front();
}

TEST(DuetCommands, HigherIsBetterTurnsTheRatio) {
  const auto state = compared([](Side side) {
    Sample sample;
    sample.seconds = {{"rate", side == Side::kBaseline ? 110.0 : 100.0}, {"time", 1}};
    sample.measures = {{"rate", {"MB/s", true}}};
    return sample;
  });
  EXPECT_EQ(state.series.at("rate").rule.verdict(), DuetVerdict::kSlower);
  EXPECT_NEAR(state.series.at("rate").rule.effect(), std::log(1.1), 1e-9);
  EXPECT_EQ(state.series.at("time").rule.verdict(), DuetVerdict::kNotSlower);
}

TEST(DuetCommands, SecondsAreAUnitLikeOthers) {
  const auto in_unit = [](const char* base, const char* candidate) {
    return compared([=](Side side) {
      Sample sample;
      sample.seconds = {{"lat", 2}};
      const std::string unit = side == Side::kBaseline ? base : candidate;
      if (unit != "s") sample.measures = {{"lat", {unit, false}}};
      return sample;
    });
  };
  EXPECT_THAT(in_unit("s", "ms").not_comparable, HasSubstr("figure lat: s, lower is better"));
  EXPECT_THAT(in_unit("ms", "s").not_comparable, HasSubstr("figure lat: ms, lower is better"));
  EXPECT_EQ(in_unit("ms", "ms").not_comparable, "");
  // Nor may a program turn to another one from run to run.
  int runs = 0;
  const auto turning = compared([&runs](Side side) {
    Sample sample;
    sample.seconds = {{"lat", 2}};
    if (side == Side::kCandidate && ++runs > 3) sample.measures = {{"lat", {"us", false}}};
    return sample;
  });
  EXPECT_THAT(turning.failures[1], HasSubstr("figure lat: us, lower is better, and s"));
}

TEST(DuetCommands, AFigureBelowZeroIsNotJudged) {
  const auto state = compared([](Side) {
    Sample sample;
    sample.seconds = {{"offset", -0.5}, {"time", 1}};
    return sample;
  });
  EXPECT_FALSE(state.series.contains("offset"));
  EXPECT_EQ(state.series.at("time").rule.verdict(), DuetVerdict::kNotSlower);
}

TEST(DuetCommands, AFigureThatTheFirstProcessesDoNotAllHaveIsPassing) {
  int processes = 0;
  const auto state = compared([&processes](Side side) {
    Sample sample;
    const bool first = ++processes <= 2;
    sample.seconds = {{"time", 1.0}, {"dropped", first ? 3.0 : 0.0}};
    if (side == Side::kBaseline) sample.seconds["old"] = 1;
    if (first) return sample;
    // Half of it is worse.
    sample.seconds["rate"] = side == Side::kBaseline ? 100 : 50;
    sample.measures = {{"rate", {"MB/s", true}}};
    return sample;
  });
  EXPECT_THAT(state.passing, ElementsAre(Pair("dropped", testing::_), Pair("rate", testing::_)));
  EXPECT_THAT(state.series, ElementsAre(Pair("time", testing::_)));
}

TEST(DuetCommands, NamesMeanNothingToTheRule) {
  // "prepare" is no set-up here, nor "upload" a part of "call".
  const auto state = compared([](Side side) {
    Sample sample;
    const double slowdown = side == Side::kBaseline ? 1 : 1.06;
    sample.seconds = {{"prepare", slowdown}, {"upload", 0.01 * slowdown}, {"call", 1}};
    return sample;
  });
  EXPECT_EQ(state.series.at("prepare").rule.verdict(), DuetVerdict::kSlower);
  EXPECT_EQ(state.series.at("upload").rule.verdict(), DuetVerdict::kSlower);
}

TEST(DuetCommands, AFigureInAnotherUnitIsNotCompared) {
  const auto state = compared([](Side side) {
    Sample sample;
    sample.seconds = {{"size", 1}};
    sample.measures = {{"size", {side == Side::kBaseline ? "kB" : "MB"}}};
    return sample;
  });
  EXPECT_THAT(state.not_comparable, AllOf(HasSubstr("size"), HasSubstr("kB"), HasSubstr("MB")));
}

}  // namespace
}  // namespace pirt
