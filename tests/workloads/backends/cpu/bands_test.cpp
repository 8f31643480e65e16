// Splitting pictures over threads: exactly what the whole gives, wherever the cuts are, and whoever
// else computes at the same time.
#include "workloads/backends/cpu/bands.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <thread>

#include "tests/support/few_threads.h"
#include "tests/workloads/catalog/workload_support.h"

namespace pirt::cpu {
namespace {

cv::Mat noise(int width, int height) {
  const Tensor picture = test::noise_picture(width, height, 1);
  return cv::Mat(height, width, CV_8U, const_cast<std::byte*>(picture.data())).clone();
}

int differing(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b); }

TEST(BandTeam, RunsEachPartOnceAndAllAtOnce) {
  BandTeam team(3);
  for (int round = 0; round < 200; ++round) {
    const int parts = round % 4;
    std::array<std::atomic<int>, 3> runs = {};
    std::atomic<int> begun = 0;
    team.run(parts, [&](int part) {
      ++runs[static_cast<std::size_t>(part)];
      // None ends before all have begun: they need threads of their own.
      for (++begun; begun < parts;) std::this_thread::yield();
    });
    for (std::size_t i = 0; i < runs.size(); ++i) {
      EXPECT_EQ(runs[i], static_cast<int>(i) < parts ? 1 : 0);
    }
  }
}

TEST(BandTeam, DoesNotWaitForThreadsThatHaveNothingToDo) {
  BandTeam team(3);
  for (int round = 0; round < 20'000; ++round) {
    std::atomic<int> runs = 0;
    team.run(2 + round % 2, [&](int) { ++runs; });
    ASSERT_EQ(runs, 2 + round % 2);
  }
}

TEST(BandTeam, OfOneThreadIsTheCallingOne) {
  BandTeam team(1);
  EXPECT_EQ(team.size(), 1);
  team.run(
      1, [main = std::this_thread::get_id()](int) { EXPECT_EQ(std::this_thread::get_id(), main); });
}

TEST(BandTeam, PassesOnWhatAPartThrowsAndGoesOn) {
  for (const int threads : {1, 2, 3}) {
    BandTeam team(threads);
    for (int thrower = 0; thrower < threads; ++thrower) {
      EXPECT_THROW(team.run(threads,
                            [&](int part) {
                              if (part == thrower) throw std::runtime_error("no");
                            }),
                   std::runtime_error);
      std::atomic<int> runs = 0;
      team.run(threads, [&](int) { ++runs; });
      EXPECT_EQ(runs, threads);
    }
  }
}

TEST(BandTeam, EndsWhenOneOfItsThreadsCannotStart) {
  for (const int threads : {0, 1, 2}) {
    EXPECT_EQ(test::with_threads(threads, [] { BandTeam team(4); }), "cannot start a thread")
        << threads;
  }
  EXPECT_EQ(test::with_threads(3, [] { BandTeam team(4); }), "nothing");
}

// A thread that has missed the run before the end learns of the end all the same.
TEST(BandTeam, EndsRightAfterARun) {
  for (int i = 0; i < 3'000; ++i) {
    BandTeam team(3);
    team.run(3, [](int) {});
  }
}

TEST(BandTeam, KeepsOpenCvToTheCallingThread) {
  cv::setNumThreads(4);
  BandTeam team(2);
  team.run(2, [](int) { EXPECT_EQ(cv::getNumThreads(), 1); });
}

TEST(Bands, CoverAllRowsOnceAndShowTheirHaloAndNoMore) {
  BandTeam team(3);
  for (const int rows : {1, 2, 7, 480}) {
    std::vector<std::atomic<int>> covered(static_cast<std::size_t>(rows));
    const cv::Mat picture = noise(16, rows);
    for_bands(team, rows, Halo(2), [&](const Band& band) {
      for (int y = band.rows.start; y < band.rows.end; ++y) ++covered[static_cast<std::size_t>(y)];
      EXPECT_EQ(band.around.start, std::max(band.rows.start - 2, 0));
      EXPECT_EQ(band.around.end, std::min(band.rows.end + 2, rows));
      cv::Size whole;
      cv::Point offset;
      const cv::Mat part = band.part(picture);
      part.locateROI(whole, offset);
      EXPECT_EQ(whole.height, band.around.size());
      EXPECT_EQ(offset.y, band.rows.start - band.around.start);
      EXPECT_EQ(part.data, picture.ptr(band.rows.start));
    });
    for (const auto& count : covered) EXPECT_EQ(count, 1);
  }
}

// A median takes the edge of what it is given for the picture's.
TEST(Bands, AFilterThatSeesNoSurroundingsGivesWhatTheWholeWould) {
  for (const auto& [width, height] : {std::pair{640, 480}, {64, 48}, {7, 5}, {33, 9}, {641, 479}}) {
    const cv::Mat picture = noise(width, height);
    cv::Mat whole;
    cv::medianBlur(picture, whole, 5);
    for (const int threads : {1, 2, 3, 5}) {
      BandTeam team(threads);
      Mats out = {cv::Mat(height, width, CV_8U)};
      const auto median = [](const cv::Mat& from, Mats& to) { cv::medianBlur(from, to[0], 5); };
      filter_in_bands(team, picture, out, Halo(2), median);
      EXPECT_EQ(differing(whole, out[0]), 0) << width << "x" << height << " on " << threads;
      filter_in_bands(team, picture, out, Halo(0), median);
      if (threads > 1 && height == 480) {
        EXPECT_GT(differing(whole, out[0]), 0) << "halo forgotten";
      }
    }
  }
}

TEST(Bands, AFilterThatLooksAroundSeesNoFartherThanItsHalo) {
  const cv::Mat picture = noise(64, 48);
  cv::Mat whole;
  cv::boxFilter(picture, whole, CV_32S, {7, 7});
  BandTeam team(3);
  const auto in_bands = [&](Halo halo) {
    cv::Mat out(48, 64, CV_32S);
    for_bands(team, 48, halo, [&](const Band& band) {
      cv::Mat to = out.rowRange(band.rows);
      cv::boxFilter(band.part(picture), to, CV_32S, {7, 7});
    });
    return out;
  };
  EXPECT_EQ(differing(whole, in_bands(Halo(3))), 0);
  EXPECT_GT(differing(whole, in_bands(Halo(2))), 0);
  EXPECT_EQ(differing(whole, in_bands(Halo::whole_picture())), 0);
}

}  // namespace
}  // namespace pirt::cpu
