#include "characterize/energy/window.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "characterize/worker/measure.h"
#include "tests/characterize/energy/sysfs_tree.h"
#include "tests/support/few_threads.h"

namespace pirt {
namespace {

using testing::HasSubstr;

MeterInfo counter(std::optional<std::int64_t> range_uj) {
  MeterInfo info;
  info.kind = MeterKind::kCounter;
  info.range_uj = range_uj;
  info.path = "energy_uj";
  return info;
}

MeterInfo power() {
  MeterInfo info;
  info.kind = MeterKind::kPower;
  info.period = std::chrono::milliseconds(5);
  return info;
}

/// One reading every 100 ms, from the first moment to the last one.
MeterTrace trace(const std::vector<std::int64_t>& values) {
  MeterTrace result;
  Nanos at{0};
  for (const auto value : values) {
    result.readings.push_back({at, value});
    at += std::chrono::milliseconds(100);
  }
  result.end = at - std::chrono::milliseconds(100);
  return result;
}

TEST(Window, ACounterIsItsLastReadingMinusItsFirst) {
  EXPECT_DOUBLE_EQ(integrate(counter({}), trace({1'000'000, 4'500'000})).energy_j.value(), 3.5);
}

TEST(Window, ACounterWrapsAtItsOwnRangeAndNotAt32Bits) {
  // 262 143 328 850 is what a desktop's package has. From 100 J below it to 20 J behind: 120 J.
  const std::int64_t range = 262'143'328'850;
  const auto wrapped = trace({range - 100'000'000, 20'000'000});
  EXPECT_DOUBLE_EQ(integrate(counter(range), wrapped).energy_j.value(), 120);
  // AMD's is smaller: what had to be added to the same readings differs.
  const auto small = trace({65'532'610'987 - 1'000'000, 500'000});
  EXPECT_DOUBLE_EQ(integrate(counter(65'532'610'987), small).energy_j.value(), 1.5);
}

TEST(Window, ACounterThatGoesBackWithoutARangeIsAnError) {
  const auto result = integrate(counter({}), trace({5'000'000, 4'000'000}));
  EXPECT_EQ(result.energy_j, std::nullopt);
  EXPECT_THAT(result.reason, HasSubstr("meter_error: energy_uj went back from 5000000 to 4000000"));
  EXPECT_THAT(integrate(counter(1'000), trace({5'000'000, 4'000'000})).reason,
              HasSubstr("more than its range"));
}

TEST(Window, AMeterThatStandsStillIsFrozenAndNotZero) {
  const auto frozen = [](const MeterInfo& meter, std::int64_t value) {
    const auto result = integrate(meter, trace({value, value, value}));
    return !result.energy_j && result.reason == "meter_frozen";
  };
  EXPECT_TRUE(frozen(counter(1'000'000), 0));
  EXPECT_TRUE(frozen(counter(1'000'000), 5'000'000));
  EXPECT_TRUE(frozen(power(), 0));
}

TEST(Window, APowerAboveZeroMayBeConstant) {
  const auto constant = integrate(power(), trace({5'000'000, 5'000'000, 5'000'000}));
  EXPECT_NEAR(constant.energy_j.value(), 1, 1e-12);
  EXPECT_EQ(constant.constant_uw, 5'000'000) << "for whoever has seen other windows";
  EXPECT_EQ(integrate(power(), trace({5'000'000, 5'000'001})).constant_uw, std::nullopt);
}

TEST(Window, PowerIsAddedUpInTrapezoids) {
  // 0.1 s each: (2+4)/2 + (4+4)/2 + (4+1)/2 = 9.5 W * 0.1 s.
  const auto result = integrate(power(), trace({2'000'000, 4'000'000, 4'000'000, 1'000'000}));
  EXPECT_NEAR(result.energy_j.value(), 0.95, 1e-12);
}

TEST(Window, FirstAndLastReadingReachToTheEnds) {
  auto readings = trace({2'000'000, 4'000'000});
  readings.begin = std::chrono::milliseconds(-50);  // 2 W before the first one
  readings.end = std::chrono::milliseconds(150);    // 4 W behind the last one
  EXPECT_NEAR(integrate(power(), readings).energy_j.value(), 0.1 + 0.3 + 0.2, 1e-12);
}

TEST(Window, AFewFailedReadsOfASensorAreBridgedAndManyAreAnError) {
  std::vector<std::int64_t> values(19, 3'000'000);
  values.push_back(3'000'001);
  auto readings = trace(values);
  readings.last_error = "EIO";
  readings.failures = 2;  // of 22
  EXPECT_NEAR(integrate(power(), readings).energy_j.value(), 3 * 1.9, 1e-5);
  readings.failures = 3;  // of 23: more than a tenth
  EXPECT_EQ(integrate(power(), readings).reason,
            "meter_error: 3 of 23 reads failed, the last with EIO");
}

TEST(Window, ACounterMustBeReadAtBothEnds) {
  auto readings = trace({1'000'000});
  readings.failures = 1;
  readings.last_error = "gone";
  EXPECT_THAT(integrate(counter({}), readings).reason, HasSubstr("1 of 2 reads failed"));
}

/// Counts how often it is read.
class CountingMeter : public Meter {
 public:
  using Meter::Meter;
  [[nodiscard]] Attribute<std::int64_t> read() const override {
    return {stopped_ ? reads_.load() : ++reads_, "", 0};
  }
  [[nodiscard]] std::int64_t reads() const { return reads_; }
  void stop() { stopped_ = true; }

 private:
  mutable std::atomic<std::int64_t> reads_ = 0;
  std::atomic<bool> stopped_ = false;
};

TEST(Recorder, ReadsCountersTwiceAndSensorsInBetween) {
  const CountingMeter energy(counter({})), sensor(power());
  const std::vector<const Meter*> meters = {&energy, &sensor};
  const MachineClock clock;
  MeterRecorder recorder(meters, clock);
  while (sensor.reads() < 4) std::this_thread::yield();
  const auto traces = recorder.stop();
  EXPECT_EQ(traces[0].readings.size(), 2U);
  EXPECT_GE(traces[1].readings.size(), 5U);
  EXPECT_EQ(traces[1].readings.size(), static_cast<std::size_t>(sensor.reads()));
  for (const auto& each : traces) {
    EXPECT_LE(each.readings.front().at, each.begin);
    EXPECT_GE(each.readings.back().at, each.end);
    EXPECT_TRUE(std::ranges::is_sorted(each.readings, {}, &MeterReading::at));
  }
}

/// The longest step passes while it is looked at twice.
class HastyClock : public Clock {
 public:
  [[nodiscard]] Nanos now() const override { return now_ += std::chrono::milliseconds(300); }

 private:
  mutable Nanos now_{0};
};

TEST(Recorder, ACounterThatStopsWithinItsWindowIsFrozen) {
  MeterInfo stepping = counter({});
  stepping.steps = true;
  CountingMeter energy(stepping);
  const std::vector<const Meter*> meters = {&energy};
  const auto reason = [&](bool stops) {
    const HastyClock clock;
    MeterRecorder recorder(meters, clock);
    static_cast<void>(energy.read());
    if (stops) energy.stop();
    const auto traces = recorder.stop();
    EXPECT_GT(traces[0].readings.back().value, traces[0].readings.front().value);
    return integrate(energy.info(), traces[0]).reason;
  };
  EXPECT_EQ(reason(false), "");
  EXPECT_EQ(reason(true), "meter_frozen") << "what it counted until then is not all";
}

TEST(Recorder, EndsItsThreadWithoutBeingAsked) {
  const CountingMeter sensor(power());
  const std::vector<const Meter*> meters = {&sensor};
  const MachineClock clock;
  { const MeterRecorder recorder(meters, clock); }
  const auto reads = sensor.reads();
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(sensor.reads(), reads);
}

TEST(Recorder, SaysThatItsThreadCannotStart) {
  const CountingMeter sensor(power());
  const std::vector<const Meter*> meters = {&sensor};
  const MachineClock clock;
  EXPECT_EQ(test::with_threads(0, [&] { const MeterRecorder recorder(meters, clock); }),
            "cannot start a thread");
}

TEST(Recorder, AVanishingFileIsATraceOfFailures) {
  const test::SysfsTree tree;
  tree.add_rapl("intel-rapl:0", "package-0", 1);
  const auto found = discover_meters(tree.root());
  const std::vector<const Meter*> meters = {found.meters[0].get()};
  const MachineClock clock;
  MeterRecorder recorder(meters, clock);
  tree.remove("class/powercap/intel-rapl:0");
  const auto traces = recorder.stop();
  EXPECT_THAT(integrate(meters[0]->info(), traces[0]).reason, HasSubstr("No such file"));
}

}  // namespace
}  // namespace pirt
