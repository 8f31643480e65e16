// Fractions of rooflines, worked by hand, and what invalidates a peak.
#include "characterize/profile/roofline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

PhaseRow execute(const std::string& workload, double ms, std::int64_t ops, std::int64_t bytes,
                 const std::string& unit = "gpu") {
  PhaseRow row;
  row.run_id = 1;
  row.workload = workload;
  row.unit = unit;
  row.phase = Phase::kExecute;
  row.median = from_ms(ms);
  if (ops > 0) row.ops = ops;
  row.bytes = bytes;
  return row;
}

PeakRow peak(PeakKind kind, double per_second, const std::string& unit = "gpu") {
  PeakRow row;
  row.run_id = 1;
  row.unit = unit;
  row.kind = kind;
  row.per_second = per_second;
  row.variant = "loop";
  return row;
}

/// f32 1e9 op/s, int8 4e9 op/s, 1e9 B/s from L2, 1e8 B/s from memory, 1 MB of cache.
Profile profile_of(std::vector<PhaseRow> rows) {
  Profile profile;
  RunInfo run;
  run.run_id = 1;
  run.platform = "board";
  run.environment = {{"unit.gpu.cache_bytes", "1000000"}};
  run.units = {{"gpu", "fake", "d", false, {}}};
  profile.runs = {run};
  profile.phases = std::move(rows);
  profile.peaks = {peak(PeakKind::kF32, 1e9), peak(PeakKind::kInt8, 4e9),
                   peak(PeakKind::kBandwidthL2, 1e9), peak(PeakKind::kBandwidthMemory, 1e8)};
  return profile;
}

TEST(Roofline, ArithmeticBoundCellIsHeldAgainstThePeak) {
  // 1e6 ops at 1e9/s take 1 ms at least, 1e5 bytes at 1e9/s 0.1 ms; 4 ms were taken.
  const auto roofs = rooflines(profile_of({execute("conv1", 4, 1'000'000, 100'000)}));
  const Roofline* cell = roofs.find("conv1", "gpu");
  ASSERT_NE(cell, nullptr);
  EXPECT_DOUBLE_EQ(*cell->fraction, 0.25);
  EXPECT_EQ(cell->bound, PeakKind::kF32);
  EXPECT_DOUBLE_EQ(cell->roof_per_second, 1e9);
  EXPECT_DOUBLE_EQ(cell->reached_per_second, 2.5e8);
  EXPECT_DOUBLE_EQ(*cell->intensity, 10);
  EXPECT_EQ(cell->missing, "");
}

TEST(Roofline, OperationsOnPaddingNeedNotBeDone) {
  // conv4 has 448 561 152 operations, of which 2 * 384 * 384 * 37 * 37 are not on padding.
  const auto roofs = rooflines(profile_of({execute("conv4", 420, 448'561'152, 100'000)}));
  EXPECT_DOUBLE_EQ(*roofs.cells[0].fraction, 403'734'528 / 0.42e9);
  EXPECT_DOUBLE_EQ(roofs.cells[0].roof_per_second, 1e9) << "not above the peak";
  EXPECT_TRUE(is_valid(roofs.peaks[0])) << "with all operations it would be exceeded";
}

TEST(Roofline, BandwidthBoundCellIsHeldAgainstIntensityTimesBandwidth) {
  // Intensity 0.1: roof = 0.1 x 1e9 = 1e8 op/s. 50000 ops in 1 ms are 5e7.
  const auto roofs = rooflines(profile_of({execute("fc8", 1, 50'000, 500'000)}));
  EXPECT_DOUBLE_EQ(*roofs.cells[0].fraction, 0.5);
  EXPECT_EQ(roofs.cells[0].bound, PeakKind::kBandwidthL2);
  EXPECT_DOUBLE_EQ(roofs.cells[0].roof_per_second, 1e8);
}

TEST(Roofline, BytesBeyondTheCacheCountAtMemoryBandwidth) {
  // 1e6 of 3e6 bytes may stay in the cache: 1 ms + 2e6/1e8 = 20 ms.
  EXPECT_DOUBLE_EQ(least_transfer_s(3e6, 1e6, 1e9, 1e8), 0.021);
  EXPECT_DOUBLE_EQ(least_transfer_s(1e6, 1e6, 1e9, 1e8), 0.001);
  EXPECT_DOUBLE_EQ(least_transfer_s(3e6, std::nullopt, 1e9, 1e8), 0.003);
  EXPECT_DOUBLE_EQ(least_transfer_s(3e6, 1e6, std::nullopt, 1e8), 0.02);
  EXPECT_DOUBLE_EQ(least_transfer_s(3e6, 1e6, 1e9, std::nullopt), 0.001);
  const auto roofs = rooflines(profile_of({execute("fc6", 42, 100, 3'000'000)}));
  EXPECT_DOUBLE_EQ(*roofs.cells[0].fraction, 0.5);
  EXPECT_EQ(roofs.cells[0].bound, PeakKind::kBandwidthMemory);
}

TEST(Roofline, EightBitWorkloadsHaveTheEightBitPeak) {
  EXPECT_EQ(arithmetic_of(find_workload("gaussian_blur")), PeakKind::kInt8);
  EXPECT_EQ(arithmetic_of(find_workload("sobel")), PeakKind::kInt8);
  EXPECT_EQ(arithmetic_of(find_workload("conv1")), PeakKind::kF32);
  EXPECT_EQ(arithmetic_of(find_workload("fc8")), PeakKind::kF32);
  const auto roofs = rooflines(profile_of({execute("sobel", 1, 1'000'000, 1000)}));
  EXPECT_DOUBLE_EQ(*roofs.cells[0].fraction, 0.25);
  EXPECT_EQ(roofs.cells[0].bound, PeakKind::kInt8);
}

TEST(Roofline, LayersInFewerBitsHaveThePeakOfTheirPrecisionOrNone) {
  EXPECT_EQ(arithmetic_of(find_workload("conv2@int8")), PeakKind::kInt8);
  EXPECT_EQ(arithmetic_of(find_workload("conv2@bf16")), std::nullopt);
  const auto roofs = rooflines(profile_of({execute("conv2@bf16", 1, 1'000'000'000, 500'000)}));
  EXPECT_EQ(roofs.cells[0].bound, PeakKind::kBandwidthL2);
  EXPECT_EQ(roofs.cells[0].missing, "bf16: no loop measures its peak");
  EXPECT_TRUE(is_valid(roofs.peaks[0])) << "its arithmetic exceeds no peak of another kind";
}

TEST(Roofline, WithoutOperationsTheBytesAreHeldAgainstBandwidthAlone) {
  const auto roofs = rooflines(profile_of({execute("undistort", 2, 0, 500'000)}));
  EXPECT_DOUBLE_EQ(*roofs.cells[0].fraction, 0.25);
  EXPECT_DOUBLE_EQ(roofs.cells[0].roof_per_second, 1e9);
  EXPECT_FALSE(roofs.cells[0].intensity.has_value());
}

TEST(Roofline, APeakThatIsNotKnownIsLeftOutAndNamed) {
  Profile profile = profile_of({execute("sobel", 1, 1'000'000, 100'000)});
  profile.peaks[1].per_second.reset();
  profile.peaks[1].reasons = {"unavailable: no dot product"};
  const auto roofs = rooflines(profile);
  EXPECT_DOUBLE_EQ(*roofs.cells[0].fraction, 0.1);
  EXPECT_EQ(roofs.cells[0].missing, "int8: unavailable: no dot product");
}

TEST(Roofline, AFractionAboveOneInvalidatesThePeakAndTheUnitHasNone) {
  // conv1 runs at 2e9 op/s, conv2 at 4e9: the peak is exceeded by conv2, most of all.
  Profile profile =
      profile_of({execute("conv1", 1, 2'000'000, 1000), execute("conv2", 1, 4'000'000, 1000),
                  execute("fc8", 10, 1000, 100'000)});
  profile.phases.push_back(execute("fc8", 10, 1'000'000, 100'000, "cpu"));
  profile.runs[0].units.push_back({"cpu", "fake", "d", true, {}});
  profile.peaks.push_back(peak(PeakKind::kF32, 1e9, "cpu"));
  const auto roofs = rooflines(profile);
  EXPECT_FALSE(is_valid(roofs.peaks[0]));
  EXPECT_THAT(roofs.peaks[0].reasons, ElementsAre("exceeded by conv2"));
  EXPECT_TRUE(is_valid(roofs.peaks[2]));
  for (const char* workload : {"conv1", "conv2", "fc8"}) {
    const Roofline* cell = roofs.find(workload, "gpu");
    EXPECT_FALSE(cell->fraction.has_value());
    EXPECT_EQ(cell->why_not, "the unit's f32 peak is exceeded by conv2");
  }
  EXPECT_DOUBLE_EQ(*roofs.find("fc8", "cpu")->fraction, 0.1);  // another unit is not concerned
  ASSERT_EQ(exceeded_peaks(roofs, 1).size(), 1U);
  EXPECT_THAT(exceeded_peaks(roofs, 2), IsEmpty());
}

TEST(Roofline, ExactlyOneIsReachedAndNotExceeded) {
  const auto roofs = rooflines(profile_of({execute("conv1", 1, 1'000'000, 1000)}));
  EXPECT_TRUE(is_valid(roofs.peaks[0]));
  EXPECT_DOUBLE_EQ(*roofs.cells[0].fraction, 1.0);
}

TEST(Roofline, AnExceededBandwidthIsToldFromAnExceededPeak) {
  const auto roofs = rooflines(profile_of({execute("fc8", 1, 1000, 900'000 * 2)}));
  // 1 ms for the cached part and 8 ms for the rest, in 1 ms.
  EXPECT_TRUE(is_valid(roofs.peaks[2]));
  EXPECT_THAT(roofs.peaks[3].reasons, ElementsAre("exceeded by fc8"));
}

TEST(Roofline, WhatTheDatabaseSaysOfAnExceededPeakHolds) {
  Profile profile = profile_of({execute("conv1", 4, 1'000'000, 100'000)});
  profile.peaks[0].reasons = {"exceeded by conv5"};
  const auto roofs = rooflines(profile);
  EXPECT_FALSE(roofs.cells[0].fraction.has_value());
  EXPECT_THAT(roofs.cells[0].why_not, HasSubstr("exceeded by conv5"));
}

TEST(Roofline, CellsOfAnotherMachineAreNotHeldAgainstThesePeaks) {
  Profile profile = profile_of({execute("conv1", 4, 1'000'000, 100'000)});
  RunInfo other = profile.runs[0];
  other.run_id = 2;
  other.seed = 9;                           // other inputs are no obstacle,
  other.environment["precision"] = "live";  // nor are rows of a live run
  profile.runs.push_back(other);
  profile.phases[0].run_id = 2;
  EXPECT_TRUE(rooflines(profile).cells[0].fraction.has_value());
  profile.runs[1].environment["governor"] = "powersave";
  EXPECT_THAT(rooflines(profile).cells[0].why_not, HasSubstr("governor"));
}

TEST(Roofline, WithoutPeaksEachCellSaysWhyNot) {
  Profile profile = profile_of({execute("conv1", 4, 1, 1), execute("future", 1, 1, 1)});
  profile.peaks.clear();
  const auto roofs = rooflines(profile);
  EXPECT_EQ(roofs.cells[0].why_not, "the unit's peaks were not measured");
  EXPECT_THAT(roofs.cells[1].why_not, HasSubstr("catalog"));
}

TEST(Roofline, InvalidRowsHaveNone) {
  Profile profile = profile_of({execute("conv1", 4, 1'000'000, 100'000)});
  profile.phases[0].reasons = {"wrong_output"};
  EXPECT_THAT(rooflines(profile).cells, IsEmpty());
}

}  // namespace
}  // namespace pirt
