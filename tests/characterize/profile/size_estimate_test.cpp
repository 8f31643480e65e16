// Times between measured sizes: what the model makes of sizes that it was not shown.
#include "characterize/profile/size_estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "workloads/base/math/random.h"
#include "workloads/catalog/own_list.h"
#include "workloads/own/definition.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

PhaseRow sized_row(const std::string& workload, double ms, Phase phase = Phase::kCall) {
  PhaseRow row;
  row.run_id = 1;
  row.platform = "p";
  row.workload = workload;
  row.unit = "cpu";
  row.backend = "cpu";
  row.phase = phase;
  row.provenance = Provenance::kMeasured;
  row.samples = 20;
  row.processes = 4;
  row.median = row.mean = from_ms(ms);
  row.p95 = row.p99 = from_ms(ms * 1.2);
  row.ci_low = from_ms(ms * 0.99);
  row.ci_high = from_ms(ms * 1.01);
  return row;
}

/// 0.5 ms and 2 ns an element; the plain sobel has 1920 x 1080.
double linear_ms(double width, double height) { return 0.5 + 2e-6 * width * height; }

Profile sobels() {
  Profile profile;
  for (const auto& [width, height] :
       std::vector<std::pair<int, int>>{{640, 480}, {800, 600}, {1600, 1200}}) {
    profile.phases.push_back(sized_row(
        "sobel@" + std::to_string(width) + "x" + std::to_string(height), linear_ms(width, height)));
  }
  profile.phases.push_back(sized_row("sobel", linear_ms(1920, 1080)));
  return profile;
}

TEST(SizeFit, FindsTheLawThatTimesFollow) {
  std::vector<SizedTime> times;
  for (const double n : {1e4, 1e5, 1e6, 4e6}) times.push_back({n, 1e-4 + 3e-10 * std::pow(n, 1.3)});
  const SizeFit fit = fit_sizes(times);
  EXPECT_NEAR(fit.a, 1e-4, 1e-6);
  EXPECT_NEAR(fit.c, 1.3, 0.005);
  EXPECT_NEAR(fit.at(5e5) / (1e-4 + 3e-10 * std::pow(5e5, 1.3)), 1, 0.01);
}

TEST(SizeFit, TimesThatDoNotGrowAreAConstant) {
  const std::vector<SizedTime> times = {{1e4, 2e-3}, {1e5, 1.9e-3}, {1e6, 1.8e-3}, {2e6, 1.7e-3}};
  const SizeFit fit = fit_sizes(times);
  EXPECT_GE(fit.b, 0);
  EXPECT_NEAR(fit.at(5e5), 1.85e-3, 1e-4);
}

/// Six workloads at these sizes with 3 % of noise, each inner size left out in turn: the share of
/// cases in which the truth is within the interval.
double share_inside(const std::vector<double>& sizes) {
  const std::vector<std::function<double(double)>> laws = {
      [](double n) { return 2e-9 * n; }, [](double n) { return 5e-4 + 1e-9 * n; },
      [](double n) { return 1e-4 + 2e-11 * std::pow(n, 1.4); },
      [](double n) { return 1e-6 * std::sqrt(n); },
      [](double n) { return 1e-10 * n * std::log2(n); },
      // What fits the cache is faster.
      [](double n) { return (n < 5e5 ? 1e-9 : 1.3e-9) * n + 1e-4; }};
  int inside = 0;
  int all = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    for (const auto& law : laws) {
      std::vector<SizedTime> measured;
      for (const double n : sizes) {
        measured.push_back({n, law(n) * random.uniform(0.97, 1.03)});
      }
      for (std::size_t i = 1; i + 1 < measured.size(); ++i) {
        auto others = measured;
        others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
        const double shown = fit_sizes(others).at(measured[i].elements);
        const double off = std::abs(std::log(law(measured[i].elements) / shown));
        inside += off <= log_error_of_fit(others) ? 1 : 0;
        ++all;
      }
    }
  }
  return static_cast<double>(inside) / all;
}

TEST(SizeFit, TheTruthOfASizeLeftOutIsWithinTheIntervalInNineOfTen) {
  EXPECT_GE(share_inside({7e4, 1.5e5, 3e5, 4.8e5, 9.2e5, 2.07e6, 8.3e6}), 0.9);
  EXPECT_GE(share_inside({7e4, 3e5, 4.8e5, 9.2e5, 2.07e6}), 0.9) << "through the least there are";
}

TEST(SizeEstimate, IsOfTheSizesBetweenThoseThatAreMeasured) {
  Profile profile = sobels();
  const auto gaps = size_gaps(profile, {"sobel@1280x720", "sobel@800x600", "sobel", "fc8"});
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].workload, "sobel@1280x720");
  EXPECT_EQ(gaps[0].unit, "cpu");
  EXPECT_THAT(gaps[0].others,
              ElementsAre("sobel@640x480", "sobel@800x600", "sobel@1600x1200", "sobel"));
  EXPECT_THAT(gaps[0].why_not, IsEmpty());
  const PhaseRow row = add_estimate(profile, gaps[0]);
  EXPECT_EQ(row.provenance, Origin(Provenance::kModelled));
  EXPECT_NEAR(to_ms(*row.median), linear_ms(1280, 720), 0.02);
  EXPECT_NEAR(to_ms(*row.p95), linear_ms(1280, 720) * 1.2, 0.03);
  EXPECT_LT(*row.ci_low, *row.median);
  EXPECT_GT(*row.ci_high, *row.median);
  EXPECT_THAT(row.notes, ElementsAre("estimated through 4 sizes"));
  EXPECT_GT(row.bytes, 1280 * 720);
  EXPECT_THAT(size_gaps(profile, {"sobel@1280x720"}), IsEmpty());
}

TEST(SizeEstimate, OfListsGoesByWhatTheyAreMadeOf) {
  Profile profile;
  for (const auto& [width, height] :
       std::vector<std::pair<int, int>>{{320, 240}, {800, 600}, {1280, 720}, {1600, 1200}}) {
    profile.phases.push_back(
        sized_row("feature_detect@" + std::to_string(width) + "x" + std::to_string(height),
                  linear_ms(width, height)));
  }
  const auto gaps = size_gaps(profile, {"feature_detect@1024x768"});
  ASSERT_THAT(gaps, SizeIs(1));
  ASSERT_THAT(gaps[0].why_not, IsEmpty()) << "corners are as many at any size";
  EXPECT_NEAR(to_ms(*add_estimate(profile, gaps[0]).median), linear_ms(1024, 768), 0.02);
}

TEST(SizeEstimate, OfWhatMakesAsMuchAtAnySizeGoesByWhatItTakes) {
  own::Definition counts;
  counts.name = "mine.counts";
  counts.inputs = {own::tensor_from("image", "u8[height,width]")};
  counts.outputs = {own::tensor_from("counts", "i32[256]")};
  counts.size = own::Size{640, 480};
  counts.backends = {"cpu"};
  std::vector<Workload> one;
  one.push_back(own::to_workload(counts));
  make_known(std::move(one));
  Profile profile;
  for (const auto& [width, height] :
       std::vector<std::pair<int, int>>{{320, 240}, {800, 600}, {1280, 720}, {1600, 1200}}) {
    profile.phases.push_back(
        sized_row("mine.counts@" + std::to_string(width) + "x" + std::to_string(height),
                  linear_ms(width, height)));
  }
  const auto gaps = size_gaps(profile, {"mine.counts@1024x768"});
  ASSERT_THAT(gaps, SizeIs(1));
  ASSERT_THAT(gaps[0].why_not, IsEmpty());
  EXPECT_NEAR(to_ms(*add_estimate(profile, gaps[0]).median), linear_ms(1024, 768), 0.02);
}

TEST(SizeEstimate, IsNotBeyondThemNorOfThree) {
  Profile profile = sobels();
  for (const char* size : {"sobel@320x240", "sobel@3840x2160"}) {
    EXPECT_THAT(size_gaps(profile, {size}).at(0).why_not, HasSubstr("not between")) << size;
  }
  profile.phases.erase(profile.phases.begin() + 1);
  EXPECT_THAT(size_gaps(profile, {"sobel@1280x720"}).at(0).why_not, HasSubstr("3 of its sizes"));
  // A row that is no figure is none of them, nor is another workload's.
  profile = sobels();
  profile.phases[1].reasons = {"wrong_output"};
  profile.phases.push_back(sized_row("undistort@1024x768", 1));
  profile.phases.push_back(sized_row("sobel@map", 1));
  EXPECT_THAT(size_gaps(profile, {"sobel@1280x720"}).at(0).others, SizeIs(3));
}

TEST(SizeEstimate, IsDoubtedAsWhatItFollowsFrom) {
  Profile profile = sobels();
  const auto gaps = size_gaps(profile, {"sobel@1280x720"});
  ASSERT_THAT(gaps, SizeIs(1));
  profile.phases[0].doubts = {"changed"};
  profile.phases[1].doubts = {"changed", "contended"};
  EXPECT_THAT(add_estimate(profile, gaps[0]).doubts, ElementsAre("changed", "contended"));
}

TEST(SizeEstimate, TellsPhasesApartWhereAllSizesDo) {
  Profile profile = sobels();
  const auto sized = profile.phases;
  for (const PhaseRow& row : sized) {
    profile.phases.push_back(sized_row(row.workload, to_ms(*row.median) * 0.8, Phase::kExecute));
  }
  Profile partly = profile;
  const SizeGap gap = size_gaps(profile, {"sobel@1280x720"}).at(0);
  add_estimate(profile, gap);
  EXPECT_NE(profile.find("sobel@1280x720", "cpu", Phase::kExecute), nullptr);
  partly.phases.pop_back();
  add_estimate(partly, gap);
  EXPECT_EQ(partly.find("sobel@1280x720", "cpu", Phase::kExecute), nullptr);
  EXPECT_NE(partly.find("sobel@1280x720", "cpu", Phase::kCall), nullptr);
}

TEST(SizeEstimate, OfAForeignWorkloadGoesByItsPictures) {
  Profile profile;
  for (const int width : {320, 640, 960, 1920}) {
    profile.phases.push_back(
        sized_row("mine.warp@" + std::to_string(width) + "x480", width / 100.0));
  }
  const auto gaps = size_gaps(profile, {"mine.warp@1280x480"});
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_NEAR(to_ms(*add_estimate(profile, gaps[0]).median), 12.8, 0.1);
}

}  // namespace
}  // namespace pirt
