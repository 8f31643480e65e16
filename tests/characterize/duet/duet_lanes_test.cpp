// Cells measured side by side: only those of units that share no core, each lane one process at a
// time, and to the same end.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>

#include "characterize/duet/duet.h"
#include "characterize/worker/scratch.h"
#include "tests/support/errors.h"
#include "tests/support/recorded_machines.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

/// Units a, b and c on the cores of these.
Platform three(const std::string& a, const std::string& b, const std::string& c) {
  std::string text = "platform: three\nunits:\n";
  for (const auto& [unit, cores] : {std::pair("a", a), std::pair("b", b), std::pair("c", c)}) {
    text += fmt::format("  {}: {{backend: cpu, cores: {}}}\n", unit, cores);
  }
  return parse_platform("three.yaml", text, {}, 8);
}

const std::vector<DuetCell> kCells = {{"sobel", "a"}, {"sobel", "b"}, {"sobel", "c"},
                                      {"fc8", "a"},   {"fc8", "b"},   {"scheduler", ""}};

class DuetLanes : public testing::Test {
 protected:
  ScratchFolder folder_;
  test::RecordedMachine machine_{folder_.path()};
};

TEST_F(DuetLanes, ALaneForUnitsOfTheirOwnCoresAndWhatRunsAnywhereByItself) {
  EXPECT_THAT(
      side_by_side(three("[0]", "[1, 2]", "[3]"), kCells, machine_.root()),
      ElementsAre(UnorderedElementsAre(ElementsAre(2), ElementsAre(0, 3), ElementsAre(1, 4)),
                  ElementsAre(ElementsAre(5))));
}

TEST_F(DuetLanes, OneLaneForUnitsThatShareACore) {
  EXPECT_THAT(side_by_side(three("[0, 1]", "[1, 2]", "[3]"), kCells, machine_.root()).front(),
              UnorderedElementsAre(ElementsAre(2), ElementsAre(0, 1, 3, 4)));
  EXPECT_THAT(side_by_side(three("[0]", "[3]", "all"), kCells, machine_.root()).front(),
              ElementsAre(ElementsAre(0, 1, 2, 3, 4)))
      << "c joins a and b, which share none with each other";
}

TEST_F(DuetLanes, OneLaneForUnitsOnSiblingsOfOnePhysicalCore) {
  for (const int core : {0, 1}) machine_.core(core, "topology/thread_siblings_list", "0-1\n");
  for (const int core : {2, 6}) machine_.core(core, "topology/thread_siblings_list", "2,6\n");
  EXPECT_THAT(side_by_side(three("[0]", "[1]", "[2]"), kCells, machine_.root()).front(),
              UnorderedElementsAre(ElementsAre(2), ElementsAre(0, 1, 3, 4)));
  EXPECT_THAT(side_by_side(three("[2]", "[1]", "[6]"), kCells, machine_.root()).front(),
              UnorderedElementsAre(ElementsAre(1, 4), ElementsAre(0, 2, 3)));
}

TEST_F(DuetLanes, UnknownUnitsAreRefused) {
  EXPECT_THAT(
      test::bad_input([this] {
        const std::vector<DuetCell> unknown = {{"sobel", "d"}};
        static_cast<void>(side_by_side(three("[0]", "[1]", "[2]"), unknown, machine_.root()));
      }),
      HasSubstr("'d'"));
  EXPECT_TRUE(side_by_side(three("[0]", "[1]", "[2]"), {}, machine_.root()).empty());
}

/// A program of two lanes whose processes take no time, except that each lane's first waits for the
/// other's: which only ends soon if both are under way at once.
class TwoLanes {
 public:
  SampleOutcome take(const DuetCell& cell, double execute_s) {
    std::unique_lock lock(mutex_);
    int& running = running_[cell.unit];
    overlapped_ = overlapped_ || ++running > 1;
    begun_.notify_all();
    met_ = met_ &&
           begun_.wait_for(lock, std::chrono::seconds(60), [this] { return running_.size() == 2; });
    --running;
    Sample sample;
    sample.device = "CPU";
    sample.right = true;
    sample.seconds = {{"execute", execute_s}, {"call", execute_s}};
    return {.sample = sample, .error = {}};
  }
  [[nodiscard]] bool met() const { return met_; }
  [[nodiscard]] bool overlapped() const { return overlapped_; }

 private:
  std::mutex mutex_;
  std::condition_variable begun_;
  std::map<std::string, int> running_;
  bool met_ = true, overlapped_ = false;
};

const std::vector<DuetCell> kFour = {{"sobel", "a"}, {"fc8", "a"}, {"sobel", "b"}, {"fc8", "b"}};
const DuetRounds kSideBySide = {{{0, 1}, {2, 3}}};

TEST(DuetRun, LanesRunSideBySideEachOneProcessAtATime) {
  DuetComparison comparison(kFour, 1), alone(kFour, 1);
  Ledger nowhere;
  TwoLanes lanes;
  const auto take = [&](Side side, const DuetCell& cell, SampleKind, Nanos) {
    const bool slower = side == Side::kCandidate && cell == kFour[2];
    return lanes.take(cell, slower ? 1.1e-3 : 1e-3);
  };
  int steps = 0;
  EXPECT_EQ(run_duet(comparison, nowhere, take, kSideBySide, {}, [&](const DuetStep&) { ++steps; }),
            DuetEnd::kDecided);
  EXPECT_TRUE(lanes.met());
  EXPECT_FALSE(lanes.overlapped());
  EXPECT_EQ(run_duet(alone, nowhere, take, one_at_a_time(4), {}), DuetEnd::kDecided);
  EXPECT_EQ(comparison.processes(), alone.processes());
  EXPECT_GT(steps, 40);
  for (std::size_t c = 0; c < kFour.size(); ++c) {
    EXPECT_EQ(comparison.cells()[c].series.at("call").rule.verdict(),
              c == 2 ? DuetVerdict::kSlower : DuetVerdict::kNotSlower);
  }
}

TEST(DuetRun, OneLanesEndIsAllLanesEnd) {
  for (const bool stopped : {true, false}) {
    DuetComparison comparison(kFour, 1);
    Ledger nowhere;
    std::atomic<int> processes = 0;
    const auto take = [&](Side, const DuetCell& cell, SampleKind, Nanos) -> SampleOutcome {
      ++processes;
      if (cell.unit == "a" && stopped) return {.sample = {}, .error = {}, .stopped = true};
      if (cell.unit == "a") throw_environment("no space left");
      return {.sample = Sample{}, .error = {}};
    };
    const auto run = [&] {
      return run_duet(comparison, nowhere, take, {{{0, 1}, {2}}, {{3}}}, {});
    };
    if (stopped) {
      EXPECT_EQ(run(), DuetEnd::kStopped);
    } else {
      EXPECT_THROW(run(), Error);
    }
    EXPECT_EQ(comparison.cells()[3].blocks, 0U) << "the next round does not begin";
  }
}

// A step of the first cell would last longer than there is time.
TEST(DuetRun, ACellThatTakesTooLongCostsNoOtherItsTime) {
  for (const DuetRounds& rounds : {one_at_a_time(2), DuetRounds{std::vector<DuetLane>{{0}, {1}}}}) {
    DuetComparison comparison({kFour[0], kFour[2]}, 1);
    Ledger nowhere;
    const auto take = [](Side, const DuetCell& cell, SampleKind, Nanos) {
      Sample sample;
      sample.seconds = {{"call", 1e-3}};
      sample.wall_s = cell == kFour[0] ? 1e5 : 1e-3;
      return SampleOutcome{.sample = sample, .error = {}};
    };
    EXPECT_EQ(run_duet(comparison, nowhere, take, rounds, {.time = std::chrono::hours(10)}),
              DuetEnd::kOutOfTime);
    EXPECT_FALSE(comparison.cells()[0].decided());
    EXPECT_TRUE(comparison.cells()[1].decided());
  }
}

}  // namespace
}  // namespace pirt
