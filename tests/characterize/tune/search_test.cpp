// The search over scripted devices: what is chosen, what is rejected, how much is measured.
#include "characterize/tune/search.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace pirt {
namespace {

using opencl::info_of;
using opencl::Parameter;
using opencl::Tuning;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr auto kGood = TuneSample::Status::kGood;

TuneSample taking(double ms) { return {.status = kGood, .time = from_ms(ms)}; }
TuneSample wrong() { return {.status = TuneSample::Status::kWrong, .reason = "off by 3"}; }
TuneSample crash() { return {.status = TuneSample::Status::kFailed, .reason = "SIGSEGV"}; }

/// A search on a CPU device over @p parameters, all judged by @p workloads.
TuneSearch search_of(std::vector<Parameter> parameters, TuneMeasure measure,
                     std::vector<std::string> workloads = {"w"}) {
  TuneSearch search{.start = Tuning(true), .steps = {}, .measure = std::move(measure)};
  for (const Parameter parameter : parameters) {
    search.steps.push_back({&info_of(parameter), workloads});
  }
  return search;
}

TEST(TuneSearch, ChoosesTheFastestAndSaysByHowMuch) {
  // fc_rows: 1 2 4 8, default 8.
  const std::map<int, double> ms = {{1, 12}, {2, 9}, {4, 8}, {8, 10}};
  const auto outcome = search_tuning(search_of({Parameter::kFcRows}, [&](const Tuning& t, auto&) {
    return taking(ms.at(t[Parameter::kFcRows]));
  }));
  EXPECT_EQ(outcome.tuning.describe(), "fc_rows=4");
  ASSERT_THAT(outcome.findings, SizeIs(1));
  const TuneFinding& found = outcome.findings[0];
  EXPECT_EQ(found.verdict, TuneVerdict::kReplaced);
  EXPECT_EQ(found.standard, 8);
  EXPECT_EQ(found.best, 4);
  EXPECT_NEAR(found.speed_up, 10.0 / 8, 1e-9);
  EXPECT_EQ(found.rounds, 8);
  EXPECT_EQ(found.rounds_faster, 8);
  EXPECT_NEAR(found.p_value, std::pow(0.5, 8), 1e-12);
  EXPECT_THAT(outcome.not_reached, IsEmpty());
}

TEST(TuneSearch, KeepsTheDefaultUnlessTheGainIsTwoPercent) {
  for (const auto& [ms, chosen] : {std::pair{9.85, 8}, {9.75, 4}, {10.5, 8}}) {
    const auto outcome =
        search_tuning(search_of({Parameter::kFcRows}, [&, ms = ms](const Tuning& t, auto&) {
          return taking(t[Parameter::kFcRows] == 4 ? ms : 10.0);
        }));
    EXPECT_EQ(outcome.tuning[Parameter::kFcRows], chosen) << ms;
    EXPECT_EQ(outcome.findings[0].verdict,
              chosen == 4 ? TuneVerdict::kReplaced : TuneVerdict::kDefaultBest);
  }
}

TEST(TuneSearch, DoesNotTakeALuckyCandidateForAFasterOne) {
  // 4 looks 10 % faster in the first rounds (one measurement in each of them) and is as fast as the
  // default afterwards.
  int measured = 0;
  const auto outcome = search_tuning(search_of({Parameter::kFcRows}, [&](const Tuning& t, auto&) {
    const bool lucky = t[Parameter::kFcRows] == 4 && ++measured <= TuneRules{}.rounds;
    return taking(lucky ? 9 : 10);
  }));
  EXPECT_EQ(outcome.tuning, Tuning(true));
  EXPECT_EQ(outcome.findings[0].verdict, TuneVerdict::kNotConfirmed);
  EXPECT_EQ(outcome.findings[0].fastest, 4);
}

TEST(TuneSearch, DoesNotChooseWithinTheNoise) {
  // All candidates alike, each measurement anywhere within 20 %. By chance one may pass: the
  // median of 8 rounds above 2 % and a bound at 95 % above 0. 100 searches allow for few.
  int replaced = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Random noise(seed);
    auto search =
        search_of({Parameter::kFcRows}, [&](auto&, auto&) { return taking(noise.uniform(9, 11)); });
    search.seed = seed;
    replaced += search_tuning(search).findings[0].verdict == TuneVerdict::kReplaced ? 1 : 0;
  }
  EXPECT_LE(replaced, 10);
}

TEST(TuneSearch, SeesAGainThroughTheNoise) {
  int replaced = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Random noise(seed);
    const auto outcome = search_tuning(search_of({Parameter::kFcRows}, [&](const Tuning& t, auto&) {
      return taking(noise.uniform(9.5, 10.5) * (t[Parameter::kFcRows] == 2 ? 0.8 : 1));
    }));
    replaced += outcome.tuning[Parameter::kFcRows] == 2 ? 1 : 0;
  }
  EXPECT_EQ(replaced, 50);
}

TEST(TuneSearch, NeverChoosesACandidateThatIsWrongOrDoesNotRun) {
  const auto outcome = search_tuning(search_of({Parameter::kFcRows}, [](const Tuning& t, auto&) {
    const int rows = t[Parameter::kFcRows];
    return rows == 1 ? wrong() : rows == 2 ? crash() : taking(10);
  }));
  EXPECT_EQ(outcome.tuning, Tuning(true));
  EXPECT_EQ(outcome.findings[0].verdict, TuneVerdict::kDefaultBest);
  EXPECT_THAT(outcome.findings[0].rejected,
              testing::UnorderedElementsAre(RejectedCandidate{1, true, "w: off by 3"},
                                            RejectedCandidate{2, false, "w: SIGSEGV"}));
}

TEST(TuneSearch, DropsACandidateThatTurnsWrongWhileItIsConfirmed) {
  int measured = 0;
  const auto outcome = search_tuning(search_of({Parameter::kFcRows}, [&](const Tuning& t, auto&) {
    if (t[Parameter::kFcRows] != 4) return taking(10);
    return ++measured > TuneRules{}.rounds + 2 ? wrong() : taking(5);
  }));
  EXPECT_EQ(outcome.tuning, Tuning(true));
  EXPECT_EQ(outcome.findings[0].verdict, TuneVerdict::kNotConfirmed);
  EXPECT_THAT(outcome.findings[0].rejected, SizeIs(1));
}

TEST(TuneSearch, LeavesOutAWorkloadThatTheDefaultCannotRun) {
  // Nobody is rejected for it, whatever the order.
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    auto search = search_of(
        {Parameter::kFcRows},
        [](const Tuning& t, const std::string& workload) {
          return workload == "broken" ? crash() : taking(t[Parameter::kFcRows] == 2 ? 8 : 10);
        },
        {"broken", "w"});
    search.seed = seed;
    const auto outcome = search_tuning(search);
    EXPECT_EQ(outcome.tuning.describe(), "fc_rows=2");
    EXPECT_EQ(outcome.findings[0].reason, "broken: SIGSEGV");
    EXPECT_THAT(outcome.findings[0].rejected, IsEmpty());
    EXPECT_THAT(outcome.findings[0].gains, SizeIs(1));
  }
}

TEST(TuneSearch, WithoutAnyMeasuredWorkloadLeavesTheParameterAsItIs) {
  auto search = search_of({Parameter::kFcRows}, [](auto&, auto&) { return crash(); });
  search.start.set(Parameter::kFcRows, 2);
  const auto outcome = search_tuning(search);
  EXPECT_EQ(outcome.findings[0].verdict, TuneVerdict::kNotMeasured);
  EXPECT_EQ(outcome.tuning, search.start);
}

TEST(TuneSearch, JudgesByTheGeometricMeanOfTheWorkloads) {
  // 4 rows: twice as fast on a, 1.6 times as slow on b: sqrt(2 / 1.6) = 1.118 in the mean.
  const auto outcome = search_tuning(search_of({Parameter::kFcRows},
                                               [](const Tuning& t, const std::string& workload) {
                                                 if (t[Parameter::kFcRows] != 4) return taking(10);
                                                 return taking(workload == "a" ? 5 : 16);
                                               },
                                               {"a", "b"}));
  EXPECT_EQ(outcome.tuning.describe(), "fc_rows=4");
  const TuneFinding& found = outcome.findings[0];
  EXPECT_NEAR(found.speed_up, std::sqrt(2 / 1.6), 1e-9);
  ASSERT_THAT(found.gains, SizeIs(2));
  EXPECT_NEAR(found.gains[0].speed_up, 2, 1e-9);
  EXPECT_NEAR(found.gains[1].speed_up, 1 / 1.6, 1e-9);
}

TEST(TuneSearch, LooksAgainAtWhatSharesAKernelWithWhatChanged) {
  // 12 pixels are only good with 8 channels: channels are looked at after pixels, so that pixels
  // have to be looked at again. fc_rows has nothing to do with them.
  const auto time = [](const Tuning& t, auto&) {
    const bool narrow = t[Parameter::kConvChannels] == 8;
    const bool many = t[Parameter::kConvPixels] == 12;
    return taking((narrow ? 9 : 10) * (narrow && many ? 0.8 : many ? 1.2 : 1));
  };
  std::map<std::string_view, std::set<int>> begun;
  auto search =
      search_of({Parameter::kConvPixels, Parameter::kConvChannels, Parameter::kFcRows}, time);
  std::vector<std::string_view> order;
  search.progress = [&](const TuneStep& step, const std::string& what) {
    if (what.ends_with("first look")) return;
    if (order.empty() || order.back() != step.parameter->name)
      order.push_back(step.parameter->name);
  };
  const auto outcome = search_tuning(search);
  EXPECT_EQ(outcome.tuning.describe(), "conv_channels=8, conv_pixels=12");
  EXPECT_THAT(order, ElementsAre("conv_pixels", "conv_channels", "conv_pixels", "conv_channels",
                                 "fc_rows"));
  EXPECT_THAT(outcome.findings, SizeIs(3));
}

TEST(TuneSearch, KeepsWhatIsStoredOfOtherParametersAndGoesBackToADefaultThatIsBest) {
  auto search = search_of({Parameter::kFcRows}, [](auto&, auto&) { return taking(10); });
  search.start.set(Parameter::kFcRows, 4);
  search.start.set(Parameter::kConvPixels, 2);
  EXPECT_EQ(search_tuning(search).tuning.describe(), "conv_pixels=2");
}

TEST(TuneSearch, MeasuresNothingAfterItsTimeAndSaysWhatItDidNotReach) {
  // First look: the start once, fc_rows 1 (8 is its default), conv_pixels 13 (0 is its default): 3.
  // Then fc_rows in 3 rounds of 4 candidates: 15 in all; conv_pixels in 3 of 7: 36.
  for (const auto& [limit, reached] :
       {std::pair{0, 0}, {1, 0}, {3, 0}, {14, 0}, {15, 1}, {35, 1}, {36, 2}, {100, 2}}) {
    int measured = 0;
    auto search = search_of({Parameter::kFcRows, Parameter::kConvPixels}, [&](auto&, auto&) {
      ++measured;
      return taking(10);
    });
    search.time_up = [&measured, limit = limit] { return measured >= limit; };
    const auto outcome = search_tuning(search);
    EXPECT_EQ(measured, std::min(limit, 36));
    EXPECT_THAT(outcome.findings, SizeIs(static_cast<std::size_t>(reached))) << limit;
    EXPECT_THAT(outcome.not_reached, SizeIs(static_cast<std::size_t>(2 - reached))) << limit;
    EXPECT_FALSE(outcome.stopped);
    EXPECT_EQ(outcome.tuning, Tuning(true));
  }
}

TEST(TuneSearch, KeepsWhatWasDecidedBeforeItsTimeAndNothingThatWasNot) {
  // fc_rows=1 is twice as fast; its time ends in its confirming rounds, or with the last of them.
  for (const int left_out : {1, 0}) {
    int measured = 0;
    auto search = search_of({Parameter::kFcRows}, [&](const Tuning& t, auto&) {
      ++measured;
      return taking(t[Parameter::kFcRows] == 1 ? 5 : 10);
    });
    // Of 1, 2, 4 and 8 rows, after a round 1 and the default are left: 4 + 2 + 2, then 8 * 2.
    search.time_up = [&] { return measured >= 24 - left_out; };
    EXPECT_EQ(search_tuning(search).tuning.describe(), left_out == 0 ? "fc_rows=1" : "default");
  }
}

TEST(TuneSearch, BeginsWithWhatGainsMostAtAFirstLook) {
  // flow_run_y 1.87x at one end of its range, sobel_strip_rows 1.2x at the other, blur none; what
  // is of all kernels comes last, whatever it gains.
  const auto time = [](const Tuning& t, auto&) {
    return taking(100 / (t[Parameter::kFlowRunY] == 256 ? 1.87 : 1) /
                  (t[Parameter::kSobelStripRows] == 8 ? 1.2 : 1) /
                  (t[Parameter::kLocalX] == 32 ? 3 : 1));
  };
  auto search = search_of({Parameter::kLocalX, Parameter::kBlurStripRows,
                           Parameter::kSobelStripRows, Parameter::kFlowRunY},
                          time);
  std::vector<std::string_view> order;
  search.progress = [&](const TuneStep& step, const std::string& what) {
    if (what.ends_with("first look")) return;
    if (order.empty() || order.back() != step.parameter->name) {
      order.push_back(step.parameter->name);
    }
  };
  const auto outcome = search_tuning(search);
  EXPECT_THAT(order, ElementsAre("flow_run_y", "sobel_strip_rows", "blur_strip_rows", "local_x"));
  EXPECT_EQ(outcome.tuning.describe(), "local_x=32, sobel_strip_rows=8, flow_run_y=256");
}

TEST(TuneSearch, StoppedByTheUserKeepsWhatWasComplete) {
  int seen = 0;
  const auto outcome =
      search_tuning(search_of({Parameter::kFcRows, Parameter::kConvPixels},
                              [&](const Tuning& t, auto&) -> std::optional<TuneSample> {
                                if (t[Parameter::kConvPixels] == 12 && ++seen == 2)
                                  return std::nullopt;
                                return taking(t[Parameter::kFcRows] == 4 ? 5 : 10);
                              }));
  EXPECT_TRUE(outcome.stopped);
  EXPECT_EQ(outcome.tuning.describe(), "fc_rows=4");
  EXPECT_THAT(outcome.not_reached, ElementsAre("conv_pixels"));
}

TEST(TuneSearch, MeasuresInRoundsAndDropsWhatIsFarBehind) {
  std::map<int, int> times;
  const auto outcome = search_tuning(search_of({Parameter::kFcRows}, [&](const Tuning& t, auto&) {
    const int rows = t[Parameter::kFcRows];
    ++times[rows];
    return taking(rows == 1 ? 20 : 10);
  }));
  EXPECT_EQ(times[1], 1);
  EXPECT_EQ(times[2], TuneRules{}.rounds);
  EXPECT_EQ(times[4], TuneRules{}.rounds);
}

}  // namespace
}  // namespace pirt
