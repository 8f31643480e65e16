// Which loop a peak is taken from, and what is said where there is none.
#include "characterize/worker/peaks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/worker/job.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ScriptedClock : public Clock {
 public:
  [[nodiscard]] Nanos now() const override { return now_; }
  void advance(Nanos by) { now_ += by; }

 private:
  Nanos now_{0};
};

struct ScriptedLoop {
  PeakKind kind = PeakKind::kF32;
  std::string variant;
  double work = 1e6;
  std::vector<Nanos> times;  ///< Of one repeat; the last one goes on.
  bool right = true;
};

class TestLoop : public PeakLoop {
 public:
  TestLoop(ScriptedLoop script, ScriptedClock& clock) : script_(std::move(script)), clock_(clock) {}
  [[nodiscard]] PeakKind kind() const override { return script_.kind; }
  [[nodiscard]] std::string variant() const override { return script_.variant; }
  [[nodiscard]] double work() const override { return script_.work; }
  void run(int repeats) override {
    clock_.advance(script_.times[std::min(run_++, script_.times.size() - 1)] * repeats);
  }
  [[nodiscard]] Verdict verify() const override {
    return {.ok = script_.right, .detail = "scripted"};
  }

 private:
  ScriptedLoop script_;
  ScriptedClock& clock_;
  std::size_t run_ = 0;
};

class TestDevice : public Device {
 public:
  explicit TestDevice(std::vector<ScriptedLoop> loops) : loops_(std::move(loops)) {}
  [[nodiscard]] DeviceInfo info() const override { return {}; }
  [[nodiscard]] Support supports(const Workload&) const override {
    return {false, "it has peak loops only"};
  }
  [[nodiscard]] PeakLoops peak_loops() override {
    PeakLoops all;
    for (const auto& loop : loops_) all.loops.push_back(std::make_unique<TestLoop>(loop, clock));
    all.unavailable[PeakKind::kInt8] = "no such instruction";
    return all;
  }
  ScriptedClock clock;

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload&,
                                                    std::span<const Tensor>) override {
    return nullptr;
  }

  std::vector<ScriptedLoop> loops_;
};

std::vector<PeakFigure> measure(std::vector<ScriptedLoop> loops) {
  TestDevice device(std::move(loops));
  return measure_peaks(device, device.clock);
}

constexpr Nanos kMs = std::chrono::milliseconds(1);

TEST(Peaks, TakesTheFastestSampleOfTheFastestLoop) {
  // 1e6 operations in 4 ms = 0.25e9 a second; in 2 ms 0.5e9, once even in 1 ms: 1e9.
  std::vector<Nanos> disturbed(20, 2 * kMs);
  disturbed[9] = kMs;
  const auto figures =
      measure({{PeakKind::kF32, "slow", 1e6, {4 * kMs}}, {PeakKind::kF32, "fast", 1e6, disturbed}});
  ASSERT_EQ(figures.size(), 4U);
  EXPECT_EQ(figures[0].kind, PeakKind::kF32);
  EXPECT_EQ(figures[0].variant, "fast");
  EXPECT_DOUBLE_EQ(*figures[0].per_second, 1e9);
  EXPECT_THAT(figures[0].reasons, IsEmpty());
}

TEST(Peaks, RepeatsWhatIsTooShortToTime) {
  // 10 us a repeat: 256 repeats are the first power of two that fills 2 ms; the rate is the same.
  const auto figures = measure({{PeakKind::kBandwidthL2, "short", 1e3, {kMs / 100}}});
  EXPECT_DOUBLE_EQ(*figures[2].per_second, 1e8);
}

TEST(Peaks, ALoopWithAWrongResultDoesNotCount) {
  const auto figures = measure(
      {{PeakKind::kF32, "cheat", 1e6, {kMs}, false}, {PeakKind::kF32, "honest", 1e6, {4 * kMs}}});
  EXPECT_EQ(figures[0].variant, "honest");
  EXPECT_THAT(figures[0].reasons, IsEmpty());
  const auto none = measure({{PeakKind::kF32, "cheat", 1e6, {kMs}, false}});
  EXPECT_FALSE(none[0].per_second.has_value());
  EXPECT_THAT(none[0].reasons, ElementsAre("wrong_output: cheat: scripted"));
}

TEST(Peaks, SaysWhyThereIsNone) {
  const auto figures = measure({});
  EXPECT_THAT(figures[1].reasons, ElementsAre("unavailable: no such instruction"));
  EXPECT_THAT(figures[3].reasons, ElementsAre("unavailable: the device has no loop"));
  for (const auto& figure : figures) EXPECT_FALSE(figure.per_second.has_value());
}

TEST(Peaks, AClockThatStandsStillGivesNoRate) {
  const auto figures = measure({{PeakKind::kF32, "instant", 1e6, {Nanos(0)}}});
  EXPECT_FALSE(figures[0].per_second.has_value());
  EXPECT_THAT(figures[0].reasons, ElementsAre(HasSubstr("clock_bound")));
}

TEST(Peaks, BecomeOneRowAKindAlsoWhenTheWorkerFails) {
  const auto records = peak_records("gpu", {}, "worker crashed", Provenance::kMeasured);
  ASSERT_EQ(records.size(), 4U);
  EXPECT_EQ(records[1].unit, "gpu");
  EXPECT_FALSE(records[1].per_second.has_value());
  EXPECT_THAT(records[1].reasons, ElementsAre("error: worker crashed"));
}

TEST(Peaks, OfTwoMeasurementsTheFasterStays) {
  const std::vector<PeakRecord> first = {
      {"u", PeakKind::kF32, 2e9, "a", Provenance::kMeasured, {}},
      {"u", PeakKind::kInt8, 1e9, "a", Provenance::kMeasured, {}}};
  const std::vector<PeakRecord> second = {
      {"u", PeakKind::kF32, 1e9, "b", Provenance::kMeasured, {}},
      {"u", PeakKind::kInt8, std::nullopt, "", Provenance::kMeasured, {"error: x"}}};
  const auto faster = faster_peaks(first, second);
  EXPECT_EQ(faster[0].variant, "a");
  EXPECT_EQ(faster[1].per_second, 1e9);
  EXPECT_EQ(faster_peaks({}, second)[0].variant, "b");
  EXPECT_EQ(faster_peaks(second, first)[0].variant, "a");
}

TEST(Peaks, SurviveThePipe) {
  JobResult result;
  result.device = DeviceInfo{"d", "p", "v", 2, true, 4096};
  result.peaks = {{PeakKind::kBandwidthMemory, 1.5e10, "loop", {}},
                  {PeakKind::kInt8, std::nullopt, "", {"unavailable: x"}}};
  const JobResult read = last_record(to_record(result) + "\n");
  EXPECT_EQ(read.device->cache_bytes, 4096);
  ASSERT_EQ(read.peaks.size(), 2U);
  EXPECT_EQ(read.peaks[0].kind, PeakKind::kBandwidthMemory);
  EXPECT_EQ(read.peaks[0].per_second, 1.5e10);
  EXPECT_EQ(read.peaks[0].variant, "loop");
  EXPECT_EQ(read.peaks[1].per_second, std::nullopt);
  EXPECT_EQ(read.peaks[1].reasons, result.peaks[1].reasons);
}

}  // namespace
}  // namespace pirt
