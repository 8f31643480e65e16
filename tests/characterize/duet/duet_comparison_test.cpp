// Two programs compared without any process: which order is asked for, what follows from what was
// measured, and that a ledger repeats it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "characterize/duet/duet.h"
#include "characterize/worker/scratch.h"
#include "tests/support/errors.h"
#include "tests/support/few_threads.h"
#include "workloads/base/system/module.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::vector<DuetCell> kTwo = {{"sobel", "cpu"}, {"fc8", "cpu"}};

/// A program that answers at once.
Sample answer(double execute_s) {
  Sample sample;
  sample.version = "1";
  sample.device = "CPU";
  sample.inputs = "abc";
  sample.right = true;
  sample.seconds = {{"prepare", 0.01},
                    {"execute", execute_s},
                    {"upload", execute_s / 100},
                    {"call", 1.01 * execute_s}};
  return sample;
}

/// Candidates take @p slowdown times as long.
TakeSample steady(double slowdown) {
  return [=](Side side, const DuetCell&, SampleKind, Nanos) {
    return SampleOutcome{.sample = answer(side == Side::kBaseline ? 1e-3 : 1e-3 * slowdown),
                         .error = {}};
  };
}

DuetEnd run(DuetComparison& comparison, const TakeSample& take) {
  Ledger nowhere;
  return run_duet(comparison, nowhere, take, one_at_a_time(comparison.cells().size()), {});
}

const DuetSeries& series(const DuetComparison& comparison, std::size_t cell,
                         const std::string& phase) {
  return comparison.cells()[cell].series.at(phase);
}

TEST(DuetComparison, ChecksBothThenTakesBlocksInTurns) {
  DuetComparison comparison(kTwo, 1);
  std::vector<std::string> steps;
  Ledger nowhere;
  int mirrored = 0;
  run_duet(comparison, nowhere, steady(1), one_at_a_time(2), {}, [&](const DuetStep& step) {
    std::string text = std::to_string(step.cell);
    for (const Side side : step.order) text += side == Side::kBaseline ? 'A' : 'B';
    mirrored += text.ends_with("BAAB") ? 1 : 0;
    steps.push_back(text);
  });
  // A turn has each cell once: 2 checks and 8 blocks.
  ASSERT_EQ(steps.size(), 2U * (2 + 8));
  for (std::size_t i = 0; i < steps.size(); i += 2) {
    EXPECT_NE(steps[i][0], steps[i + 1][0]) << i;
  }
  EXPECT_EQ(mirrored, 8) << "half of the blocks";
  EXPECT_EQ(comparison.decided(), 2U);
  EXPECT_EQ(comparison.processes(), 2U * (2 + 32));
  EXPECT_EQ(series(comparison, 0, "execute").rule.verdict(), DuetVerdict::kNotSlower);
}

TEST(DuetComparison, OnlyAConfirmationIsTakenWithCanaries) {
  DuetComparison comparison(kTwo, 1);
  std::string steps;
  Ledger nowhere;
  const auto take = [](Side side, const DuetCell& cell, SampleKind kind, Nanos most) {
    return steady(cell == kTwo[0] ? 1.1 : 1)(side, cell, kind, most);
  };
  run_duet(comparison, nowhere, take, one_at_a_time(2), {}, [&](const DuetStep& step) {
    if (step.cell == 1) {
      EXPECT_NE(step.kind, DuetStep::Kind::kCanary);
    } else if (step.kind != DuetStep::Kind::kCheck) {
      steps += step.kind == DuetStep::Kind::kCanary ? 'c' : 'b';
      EXPECT_EQ(step.kind == DuetStep::Kind::kCanary,
                step.order == std::vector<Side>(4, Side::kBaseline));
    }
  });
  std::string confirmation;
  for (int i = 0; i < 10; ++i) confirmation += "cbb";
  EXPECT_EQ(steps, std::string(12, 'b') + confirmation);
  EXPECT_EQ(series(comparison, 0, "execute").rule.canaries().size(), 10U);
  EXPECT_EQ(series(comparison, 0, "execute").rule.verdict(), DuetVerdict::kSlower);
}

TEST(DuetComparison, FindsASlowdownAndSaysByHowMuch) {
  DuetComparison comparison(kTwo, 1);
  EXPECT_EQ(run(comparison, steady(1.1)), DuetEnd::kDecided);
  const DuetSeries& execute = series(comparison, 1, "execute");
  EXPECT_EQ(execute.rule.verdict(), DuetVerdict::kSlower);
  EXPECT_NEAR(execute.rule.effect(), std::log(1.1), 1e-9);
  EXPECT_EQ(execute.base_s.size(), execute.candidate_s.size());
  EXPECT_EQ(series(comparison, 1, "prepare").rule.verdict(), DuetVerdict::kNotSlower);
  EXPECT_FALSE(comparison.cells()[1].series.contains("upload")) << "1 % of a call";
}

TEST(DuetComparison, RepeatsNoCallsOnceTheyAreDecided) {
  // Calls are clear after 8 blocks; prepare is slower, which takes 12 and 20 more, with 10
  // canaries.
  DuetComparison comparison({kTwo[0]}, 1);
  std::map<SampleKind, int> asked;
  EXPECT_EQ(run(comparison,
                [&](Side side, const DuetCell&, SampleKind kind, Nanos) {
                  ++asked[kind];
                  Sample sample = answer(1e-3);
                  if (kind == SampleKind::kSetup) sample.seconds = {{"prepare", 0.01}};
                  if (side == Side::kCandidate) sample.seconds["prepare"] *= 1.2;
                  return SampleOutcome{.sample = sample, .error = {}};
                }),
            DuetEnd::kDecided);
  EXPECT_EQ(series(comparison, 0, "prepare").rule.verdict(), DuetVerdict::kSlower);
  EXPECT_EQ(series(comparison, 0, "execute").rule.verdict(), DuetVerdict::kNotSlower);
  EXPECT_EQ(series(comparison, 0, "execute").base_s.size(), 16U);
  EXPECT_EQ(series(comparison, 0, "prepare").base_s.size(), 64U);
  EXPECT_EQ(asked[SampleKind::kVerified], 2);
  EXPECT_EQ(asked[SampleKind::kTimed], 4 * 8);
  EXPECT_EQ(asked[SampleKind::kSetup], 4 * (4 + 20 + 10));
}

// A device that says in the first block what uploading took, and never again.
TEST(DuetComparison, EndsWhereASeriesHasNoTimeAnyMore) {
  DuetComparison comparison({{"sobel", "cpu"}}, 1);
  int processes = 0;
  run(comparison, [&processes](Side, const DuetCell&, SampleKind, Nanos) {
    Sample sample = answer(1e-3);
    sample.seconds["upload"] = 5e-4;
    if (++processes > 2 + 4) sample.seconds.erase("upload");  // the checks, and one block
    EXPECT_LT(processes, 1000);
    return SampleOutcome{.sample = sample, .error = {}};
  });
  EXPECT_EQ(comparison.decided(), 1U);
  EXPECT_EQ(series(comparison, 0, "upload").rule.verdict(), DuetVerdict::kInconclusive);
  EXPECT_EQ(series(comparison, 0, "call").rule.verdict(), DuetVerdict::kNotSlower);
}

TEST(DuetComparison, CountsRunsWithoutAFigureUntilItIsDecided) {
  DuetComparison comparison({{std::string(kCommandCell), ""}}, 1);
  int processes = 0;
  run(comparison, [&processes](Side side, const DuetCell&, SampleKind, Nanos) {
    Sample sample;
    const bool is_candidate = side == Side::kCandidate;
    sample.seconds = {{"slow", is_candidate ? 1.2 : 1.0}, {"same", 1.0}};
    if (++processes > 2 + 4 * 8 && is_candidate) sample.seconds.erase("same");
    return SampleOutcome{.sample = sample, .error = {}};
  });
  EXPECT_EQ(series(comparison, 0, "slow").rule.verdict(), DuetVerdict::kSlower);
  EXPECT_EQ(series(comparison, 0, "same").rule.verdict(), DuetVerdict::kNotSlower);
  EXPECT_EQ(series(comparison, 0, "same").without, 0U);
}

TEST(DuetComparison, DriftWithinABlockCancels) {
  DuetComparison comparison(kTwo, 1);
  double now = 1e-3;
  run(comparison, [&](Side, const DuetCell&, SampleKind, Nanos) {
    now *= 1.02;
    return SampleOutcome{.sample = answer(now), .error = {}};
  });
  for (const double block : series(comparison, 0, "execute").rule.blocks()) {
    EXPECT_NEAR(block, 0, 1e-9);
  }
}

TEST(DuetComparison, AFailureEndsTheCellAndKeepsItsBlocks) {
  DuetComparison comparison(kTwo, 1);
  int left = 15;
  EXPECT_EQ(run(comparison,
                [&](Side side, const DuetCell& cell, SampleKind, Nanos) {
                  SampleOutcome outcome{.sample = answer(1e-3), .error = {}};
                  if (side == Side::kCandidate && cell.workload == "sobel" && --left <= 0) {
                    outcome = {.sample = {}, .error = "crashed (SIGSEGV)"};
                  }
                  return outcome;
                }),
            DuetEnd::kDecided);
  const DuetCellState& sobel = comparison.cells()[0];
  EXPECT_EQ(sobel.failures[1], "crashed (SIGSEGV)");
  EXPECT_EQ(sobel.failures[0], "");
  EXPECT_GE(sobel.blocks, 4U);
  EXPECT_EQ(series(comparison, 0, "execute").rule.verdict(), DuetVerdict::kUndecided);
  EXPECT_EQ(series(comparison, 1, "execute").rule.verdict(), DuetVerdict::kNotSlower);
}

TEST(DuetComparison, ComparesOnlyWhatComputesTheSame) {
  const auto with = [&](const std::function<void(Sample&)>& change) {
    DuetComparison comparison({kTwo[0]}, 1);
    run(comparison, [&](Side side, const DuetCell&, SampleKind, Nanos) {
      SampleOutcome outcome{.sample = answer(1e-3), .error = {}};
      if (side == Side::kCandidate) change(*outcome.sample);
      return outcome;
    });
    return comparison.cells()[0];
  };
  EXPECT_THAT(with([](Sample& s) { s.inputs = "xyz"; }).not_comparable, HasSubstr("input data"));
  EXPECT_THAT(with([](Sample& s) { s.device = "GPU"; }).not_comparable,
              HasSubstr("CPU against GPU"));
  EXPECT_THAT(with([](Sample& s) {
                s.seconds = {{"other", 1.0}};
              }).not_comparable,
              HasSubstr("no phase"));
  const auto wrong = with([](Sample& s) {
    s.right = false;
    s.detail = "3 of 4 differ";
  });
  EXPECT_EQ(wrong.failures[1], "wrong output, 3 of 4 differ");
  EXPECT_EQ(wrong.blocks, 0U);
}

TEST(DuetComparison, ABlockBeforeTheFirstProcessesIsRefused) {
  DuetComparison comparison({kTwo[0]}, 1);
  DuetStep step;
  step.kind = DuetStep::Kind::kBlock;
  step.order = {Side::kBaseline, Side::kCandidate, Side::kCandidate, Side::kBaseline};
  const auto block = comparison.event_of(step, std::vector<Sample>(4, answer(1e-3)));
  EXPECT_THAT(test::bad_input([&] { comparison.apply(block); }),
              HasSubstr("before the first processes"));
}

class DuetLedger : public testing::Test {
 protected:
  Ledger open(DuetComparison& comparison) {
    return Ledger(file(), {{"candidate", "1"}},
                  [&](const Ledger::Event& event) { comparison.apply(event); });
  }
  [[nodiscard]] std::filesystem::path file() const { return scratch_.path() / "ledger"; }
  void expect_refused(const std::string& part, const Ledger::Event& key = {{"candidate", "1"}}) {
    DuetComparison comparison(kTwo, 1);
    const auto open_it = [&] {
      Ledger(file(), key, [&](const Ledger::Event& event) { comparison.apply(event); });
    };
    EXPECT_THAT(test::bad_input(open_it), testing::AllOf(HasSubstr(part), HasSubstr("ledger")));
  }
  ScratchFolder scratch_;
};

TEST_F(DuetLedger, GoesOnAfterEveryInterruptionToTheSameEnd) {
  DuetComparison whole(kTwo, 1);
  run(whole, steady(1.1));
  int runs = 0;
  bool decided = false;
  while (!decided) {
    ASSERT_LT(++runs, 1000);
    DuetComparison comparison(kTwo, 1);
    Ledger ledger = open(comparison);
    int left = 7;  // Processes; then Ctrl-C.
    const auto end = run_duet(comparison, ledger,
                              [&](Side side, const DuetCell& cell, SampleKind kind, Nanos most) {
                                if (--left < 0)
                                  return SampleOutcome{.sample = {}, .error = {}, .stopped = true};
                                return steady(1.1)(side, cell, kind, most);
                              },
                              one_at_a_time(2), {});
    decided = end == DuetEnd::kDecided;
    if (!decided) continue;
    EXPECT_EQ(comparison.processes(), whole.processes());
    EXPECT_EQ(series(comparison, 0, "execute").rule.blocks(),
              series(whole, 0, "execute").rule.blocks());
  }
  EXPECT_GT(runs, 10);
}

TEST_F(DuetLedger, WhatTimedOutIsTriedAgainUnderALongerLimitOnly) {
  int processes = 0;
  const auto failure = [&](std::chrono::seconds limit, bool hangs) {
    DuetComparison comparison({kTwo[0]}, 1, limit);
    Ledger ledger = open(comparison);
    const auto take = [&](Side side, const DuetCell& cell, SampleKind kind, Nanos most) {
      ++processes;
      if (side == Side::kBaseline || !hangs) return steady(1)(side, cell, kind, most);
      return SampleOutcome{.sample = {}, .error = "timed out", .timed_out = true};
    };
    run_duet(comparison, ledger, take, one_at_a_time(1), {});
    return comparison.cells()[0].failures[1];
  };
  EXPECT_EQ(failure(std::chrono::seconds(60), true), "timed out");
  EXPECT_EQ(failure(std::chrono::seconds(60), false), "timed out");
  EXPECT_EQ(failure(std::chrono::seconds(30), false), "timed out");
  EXPECT_EQ(processes, 2);
  EXPECT_EQ(failure(std::chrono::seconds(300), false), "");
  EXPECT_EQ(processes, 2 + 1 + 4 * 8);
}

TEST_F(DuetLedger, EndsAllLanesWhenOneCannotStart) {
  DuetComparison comparison(kTwo, 1);
  Ledger ledger = open(comparison);
  std::atomic<int> samples = 0;
  const DuetRounds rounds = {std::vector<DuetLane>{{0}, {1}}};
  EXPECT_EQ(test::with_threads(0,
                               [&] {
                                 run_duet(comparison, ledger,
                                          [&](Side side, const DuetCell& cell, SampleKind kind,
                                              Nanos most) {
                                            // Nothing is measured for what cannot be decided.
                                            if (++samples > 0) ::_exit(1);
                                            return steady(1)(side, cell, kind, most);
                                          },
                                          rounds, {});
                               }),
            "cannot start a thread");
}

TEST_F(DuetLedger, CutsOffHalfALine) {
  DuetComparison first(kTwo, 1);
  {
    Ledger ledger = open(first);
    run_duet(first, ledger, steady(1), one_at_a_time(2), {});
  }
  const auto size = std::filesystem::file_size(file());
  std::ofstream(file(), std::ios::app) << R"({"block": {"workload": "so)";
  DuetComparison second(kTwo, 1);
  open(second);
  EXPECT_EQ(second.processes(), first.processes());
  EXPECT_EQ(std::filesystem::file_size(file()), size);
}

TEST_F(DuetLedger, RefusesWhatItCannotGoOnWith) {
  DuetComparison first(kTwo, 1);
  {
    const Ledger ledger = open(first);
    expect_refused("in use");
  }
  expect_refused(R"(candidate: "1" there, "2" now)", {{"candidate", "2"}});
  std::ofstream(file(), std::ios::app) << "{\"block\": 3}\n";
  expect_refused(":2 is damaged");
  std::ofstream(file()) << "my notes";
  expect_refused("no ledger");
  EXPECT_EQ(read_file(file()), "my notes");
  std::filesystem::remove(file());
  std::filesystem::create_directory(file());
  expect_refused("cannot open");
}

TEST_F(DuetLedger, AFullDiskKeepsWhatWasThere) {
  DuetComparison first(kTwo, 1);
  Ledger ledger = open(first);
  ledger.append({{"failure", {{"workload", "fc8"}, {"unit", "cpu"}}}});
  const std::string before = read_file(file());
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &limit), 0);
  const rlimit small{.rlim_cur = before.size() + 10, .rlim_max = limit.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  EXPECT_THROW(ledger.append({{"failure", "something longer than ten characters"}}), Error);
  ::setrlimit(RLIMIT_FSIZE, &limit);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(read_file(file()), before);
}

TEST_F(DuetLedger, IsAFile) {
  const auto open_it = [] { Ledger("/dev/zero", {{"candidate", "1"}}, [](const auto&) {}); };
  EXPECT_THAT(test::bad_input(open_it), HasSubstr("no file"));
}

TEST(ContentKey, IsOfWhatIsThereNow) {
  // This program was built more than two seconds ago.
  EXPECT_EQ(content_key("/proc/self/exe"), content_key("/proc/self/exe"));
  const ScratchFolder scratch;
  const auto file = scratch.path() / "file";
  std::ofstream(file) << "one";
  const auto written = std::filesystem::last_write_time(file);
  const std::string before = content_key(file);
  std::ofstream(file) << "two";
  std::filesystem::last_write_time(file, written);
  EXPECT_NE(content_key(file), before);
}

TEST(BuiltKey, HasTheLibrariesOfAnInstalledProgram) {
  const ScratchFolder scratch;
  const auto program = std::filesystem::canonical(scratch.path()) / "bin" / "pirt";
  const auto libraries = module_folders(program).at(2).parent_path();
  std::filesystem::create_directories(program.parent_path());
  std::filesystem::create_directories(libraries);
  std::ofstream(program) << "program";
  std::ofstream(libraries / "libother.so") << "not pirt's";
  std::ofstream(libraries / "libpirt.so.1") << "one";
  const std::string before = json_text(built_key(program));
  EXPECT_THAT(before, AllOf(HasSubstr("libpirt.so.1"), Not(HasSubstr("libother"))));
  std::ofstream(libraries / "libpirt.so.1") << "another";
  EXPECT_NE(json_text(built_key(program)), before);
  const auto modules = module_folders(program).at(2);
  std::filesystem::create_directories(modules);
  std::ofstream(modules / "pirt_dsp.elf") << "one";
  const std::string with_one = json_text(built_key(program));
  std::ofstream(modules / "pirt_dsp.elf") << "another";
  EXPECT_NE(json_text(built_key(program)), with_one);
}

TEST(Injection, ReadsWhatItWrites) {
  const Injection injection = parse_injection("execute=1.1,scheduler=2");
  EXPECT_EQ(injection.execute, 1.1);
  EXPECT_EQ(injection.prepare, 1);
  EXPECT_EQ(to_string(injection), "execute=1.1,scheduler=2");
  for (const char* bad : {"execute", "execute=", "execute=0.5", "execute=x", "sleep=2", "",
                          "execute=1e9", "execute=nan"}) {
    EXPECT_THAT(test::bad_input([&] { static_cast<void>(parse_injection(bad)); }),
                HasSubstr("execute=1.1"));
  }
}

TEST(Sample, ReadsWhatItWritesAndNothingElse) {
  const Sample there = sample_from_json(json_text(to_json(answer(1e-3))));
  EXPECT_EQ(there.device, "CPU");
  EXPECT_EQ(there.right, true);
  EXPECT_EQ(there.seconds, answer(1e-3).seconds);
  const Sample among = sample_from_json("onednn_verbose,info,oneDNN v2.6\n" +
                                        json_text(to_json(answer(1e-3)), 2) + "\nbye\n");
  EXPECT_EQ(among.seconds, there.seconds);
  for (const char* bad :
       {"", "{}", "[1]", "hello", R"({"pirt_sample": 1, "version": "1", "device": "d"})",
        R"({"pirt_sample": 1, "version": "1", "device": "d", "seconds": {"call": 1e999}})",
        R"({"pirt_sample": 1, "version": "1", "device": 1, "seconds": {}})"}) {
    EXPECT_THAT(test::bad_input([&] { static_cast<void>(sample_from_json(bad)); }),
                HasSubstr("pirt sample"));
  }
}

}  // namespace
}  // namespace pirt
