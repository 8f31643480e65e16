#include "characterize/energy/metered_calls.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <thread>

#include "characterize/worker/measure.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A counter that advances by what a function of the time since its first reading says.
class SimulatedCounter : public Meter {
 public:
  explicit SimulatedCounter(std::function<double(double seconds)> energy_j, bool steps = false)
      : Meter(info_of_it(steps)), energy_j_(std::move(energy_j)) {}
  [[nodiscard]] Attribute<std::int64_t> read() const override {
    return {static_cast<std::int64_t>(energy_j_(to_s(clock_.now() - start_)) * 1e6), "", 0};
  }

 private:
  static MeterInfo info_of_it(bool steps) {
    MeterInfo info;
    info.steps = steps;
    info.name = "package-0";
    info.driver = "rapl";
    info.covers = "package";
    info.kind = MeterKind::kCounter;
    info.path = "energy_uj";
    return info;
  }
  MachineClock clock_;
  Nanos start_ = clock_.now();
  std::function<double(double)> energy_j_;
};

constexpr Nanos kWindow = std::chrono::milliseconds(30);

MeteredCalls measure(const Meter& meter, const std::function<void()>& call) {
  const std::vector<const Meter*> meters = {&meter};
  const MachineClock clock;
  return meter_calls(meters, clock, kWindow, call);
}

void nap() { std::this_thread::sleep_for(std::chrono::milliseconds(2)); }

TEST(MeteredCalls, SubtractsIdleAndDividesByTheCalls) {
  // 3 W idle, and 0.25 J on top a call, however long it takes.
  double used_j = 0;
  const SimulatedCounter meter([&](double seconds) { return 3 * seconds + used_j; });
  const auto metered = measure(meter, [&] {
    nap();
    used_j += 0.25;
  });
  EXPECT_THAT(metered.reasons, IsEmpty());
  EXPECT_GE(metered.calls, 1);
  EXPECT_GE(metered.duration, kWindow);
  // Meter and clock are not read at the same moment; the window is short.
  EXPECT_NEAR(metered.idle_before_w.value(), 3, 1);
  EXPECT_NEAR(metered.call_j().value(), 0.25, 0.01);
  EXPECT_EQ(metered.source, "rapl: package-0");
  EXPECT_EQ(metered.domain, "package");
}

TEST(MeteredCalls, AFrozenMeterIsInvalidAndNotZero) {
  const SimulatedCounter meter([](double) { return 5.0; });
  const auto metered = measure(meter, nap);
  EXPECT_THAT(metered.reasons, ElementsAre("meter_frozen"));
  const auto record = metered_energy(metered);
  EXPECT_EQ(record.energy_j, std::nullopt);
  EXPECT_EQ(record.provenance, Provenance::kMeasured);
  EXPECT_THAT(record.reasons, ElementsAre("meter_frozen"));
}

/// A power sensor with a reading every millisecond.
class SimulatedSensor : public Meter {
 public:
  explicit SimulatedSensor(std::function<double()> power_w)
      : Meter(info_of_it()), power_w_(std::move(power_w)) {}
  [[nodiscard]] Attribute<std::int64_t> read() const override {
    return {static_cast<std::int64_t>(power_w_() * 1e6), "", 0};
  }

 private:
  static MeterInfo info_of_it() {
    MeterInfo info;
    info.name = "VDD_IN";
    info.driver = "ina3221";
    info.covers = "board input";
    info.kind = MeterKind::kPower;
    info.period = std::chrono::milliseconds(1);
    return info;
  }
  std::function<double()> power_w_;
};

TEST(MeteredCalls, AMeterThatIsConstantWhileIdleMayMoveUnderLoad) {
  std::atomic<bool> calling = false;
  const SimulatedSensor meter([&] { return calling ? 8.0 : 3.0; });  // steps of a coarse sensor
  const auto metered = measure(meter, [&] {
    calling = true;
    nap();
    calling = false;
  });
  EXPECT_THAT(metered.reasons, IsEmpty());
  EXPECT_DOUBLE_EQ(metered.idle_before_w.value(), 3);
  EXPECT_GT(metered.call_j().value(), 0);
}

TEST(MeteredCalls, AMeterThatStandsStillUnderLoadTooIsFrozen) {
  const SimulatedSensor meter([] { return 5.0; });
  const auto record = metered_energy(measure(meter, nap));
  EXPECT_THAT(record.reasons, ElementsAre("meter_frozen"));
  EXPECT_EQ(record.energy_j, std::nullopt);
}

TEST(MeteredCalls, CallsThatDrawNoMoreThanIdlingHaveNoFigure) {
  double gain_j = 0;
  const SimulatedCounter meter([&](double seconds) { return 3 * seconds - gain_j; });
  const auto metered = measure(meter, [&] {
    nap();
    gain_j += 0.005;  // sleeping in the call draws less than idling
  });
  ASSERT_EQ(metered.reasons.size(), 1U);
  EXPECT_THAT(metered.reasons[0], HasSubstr("not_above_idle"));
  EXPECT_EQ(metered_energy(metered).energy_j, std::nullopt);
}

TEST(MeteredCalls, AnIdlePowerThatChangesIsUnstable) {
  // Somebody else draws 5 W from the first call on.
  double from_s = -1;
  double used_j = 0;
  const MachineClock clock;
  const Nanos start = clock.now();
  const SimulatedCounter meter([&](double) {
    const double seconds = to_s(clock.now() - start);
    return 3 * seconds + used_j + (from_s < 0 ? 0 : 5 * (seconds - from_s));
  });
  const auto metered = measure(meter, [&] {
    if (from_s < 0) from_s = to_s(clock.now() - start);
    nap();
    used_j += 0.001;
  });
  ASSERT_EQ(metered.reasons.size(), 1U);
  EXPECT_THAT(metered.reasons[0], HasSubstr("unstable"));
  EXPECT_TRUE(metered_energy(metered).energy_j.has_value());  // kept and shown
}

/// A board that idles at 100 W and shows a new figure each 10 ms, in a time of its own: reading it
/// takes 1 ms, a call 2 ms.
class SteppingBoard : public Clock {
 public:
  [[nodiscard]] Nanos now() const override { return now_; }

  MeteredCalls measure(double call_j) {
    const std::vector<const Meter*> meters = {&meter_};
    return meter_calls(meters, *this, kWindow, [&] {
      now_ += std::chrono::milliseconds(2);
      used_j_ += call_j;
    });
  }

 private:
  double read_j() {
    now_ += std::chrono::milliseconds(1);
    const auto step = now_ / std::chrono::milliseconds(10);
    if (step != step_) shown_j_ = 100 * to_s(now_) + used_j_;
    step_ = step;
    return shown_j_;
  }

  Nanos now_{0};
  std::int64_t step_ = -1;
  double used_j_ = 0, shown_j_ = 0;
  SimulatedCounter meter_{[this](double) { return read_j(); }, true};
};

TEST(MeteredCalls, GoOnUntilAStepOfTheMeterIsFivePercentOfWhatTheyDraw) {
  // 0.2 J each 2 ms are 100 W above 100 W: a step is 2 J, which is a part of 20 of 40 J, after
  // 0.4 s.
  SteppingBoard board;
  const auto metered = board.measure(0.2);
  EXPECT_THAT(metered.reasons, IsEmpty());
  EXPECT_GE(metered.duration, std::chrono::milliseconds(400));
  EXPECT_LE(metered.duration, std::chrono::milliseconds(600));
  EXPECT_NEAR(metered.call_j().value(), 0.2, 1e-4);
  EXPECT_EQ(metered.source, "rapl: package-0; a step each 10 ms");
}

TEST(MeteredCalls, WhatIsBelowTheStepsOfTheMeterIsNotMeasurable) {
  // 2 mJ each 2 ms are 1 W: a step of 1.01 J is a part of 20 of what they draw after 20.2 s.
  SteppingBoard board;
  const auto metered = board.measure(0.002);
  ASSERT_THAT(metered.reasons,
              ElementsAre(HasSubstr("not_measurable: a step of the meter is 1.0")));
  EXPECT_LT(board.now(), std::chrono::seconds(30));
  EXPECT_TRUE(metered_energy(metered).energy_j.has_value());  // kept and shown
}

TEST(MeteredCalls, ACounterThatWasResetIsAnError) {
  double reset_j = 0;
  const SimulatedCounter meter([&](double seconds) { return 100 * seconds - reset_j; }, true);
  const auto metered = measure(meter, [&] {
    nap();
    reset_j = 1e6;
  });
  ASSERT_FALSE(metered.reasons.empty());
  EXPECT_THAT(metered.reasons[0], HasSubstr("meter_error: energy_uj went back"));
}

TEST(MeteredCalls, AFailingCallEndsTheMeasurement) {
  const SimulatedCounter meter([](double seconds) { return seconds; });
  EXPECT_THROW(static_cast<void>(measure(meter, [] { throw_environment("device lost"); })), Error);
}

TEST(MeteredCalls, RepeatsHaveAnInterval) {
  const auto repeat = [](double active_j) {
    return MeteredCalls{.source = "m",
                        .domain = "package",
                        .calls = 10,
                        .duration = std::chrono::seconds(1),
                        .active_j = active_j,
                        .idle_before_w = 2,
                        .idle_after_w = 2,
                        .reasons = {}};
  };
  // 0.8, 1.0 and 1.2 J a call above 2 W: the mean is 1, the deviation 0.2, and t of 2 is 4.303.
  const std::vector repeats = {repeat(10), repeat(12), repeat(14)};
  const MeteredCalls joined = joined_repeats(repeats);
  EXPECT_EQ(joined.calls, 30);
  EXPECT_NEAR(joined.call_j().value(), 1, 1e-12);
  const EnergyRecord energy = metered_energy(joined);
  EXPECT_NEAR(energy.ci_high_j.value() - 1, 4.303 * 0.2 / std::sqrt(3.0), 1e-3);
  EXPECT_NEAR(1 - energy.ci_low_j.value(), 4.303 * 0.2 / std::sqrt(3.0), 1e-3);
}

TEST(MeteredCalls, PowerAndTimeMustBelongTogether) {
  MeteredCalls metered;
  metered.calls = 100;
  metered.duration = std::chrono::seconds(1);  // 10 ms a call
  for (const auto& [timed_ms, agrees] :
       {std::pair{10.0, true}, {11.9, true}, {8.5, true}, {12.1, false}, {8.2, false}}) {
    metered.reasons.clear();
    check_call_time(metered, from_ms(timed_ms));
    EXPECT_EQ(metered.reasons.empty(), agrees) << timed_ms;
  }
  EXPECT_THAT(metered.reasons[0],
              HasSubstr("unstable: a call took 10 ms metered and 8.2 ms timed"));
}

TEST(MeteredCalls, AreDoubtedBesideOtherProgramsWhichABoardOfItsOwnDoesNotSee) {
  SimulatedCounter meter([](double seconds) { return seconds; });
  const std::vector<const Meter*> meters = {&meter};
  const auto record = [&](const Interference& during) {
    MeteredCalls metered{.source = "rapl: package-0",
                         .domain = "package",
                         .calls = 10,
                         .duration = std::chrono::seconds(1),
                         .active_j = 3,
                         .idle_before_w = 2,
                         .idle_after_w = 2,
                         .reasons = {}};
    check_disturbance(metered, meters, during);
    return metered_energy(metered);
  };
  EXPECT_THAT(record({.contended = true}).doubts, ElementsAre("contended"));
  EXPECT_THAT(record({.contended = true}).reasons, IsEmpty());
  EXPECT_EQ(record({.contended = true}).source, "rapl: package-0; contended");
  EXPECT_THAT(record({.throttled = true}).doubts, ElementsAre("throttled"));
  EXPECT_TRUE(is_valid(record({})));
  meter.mutable_info().domain = MeterDomain::kGpu;
  EXPECT_THAT(record({.contended = true}).doubts, IsEmpty());
  EXPECT_EQ(record({.contended = true}).source, "rapl: package-0; contended");
}

TEST(MeteredCalls, SlowSensorsGetLongerWindows) {
  MeterInfo gauge;
  gauge.kind = MeterKind::kPower;
  gauge.period = std::chrono::seconds(1);
  class Silent : public Meter {
   public:
    using Meter::Meter;
    [[nodiscard]] Attribute<std::int64_t> read() const override { return {1, "", 0}; }
  };
  const Silent slow(gauge);
  const SimulatedCounter counter([](double seconds) { return seconds; });
  const std::vector<const Meter*> both = {&counter, &slow}, one = {&counter};
  EXPECT_EQ(metering_window(both, std::chrono::seconds(1)), std::chrono::seconds(5));
  EXPECT_EQ(metering_window(one, std::chrono::seconds(1)), std::chrono::seconds(1));
}

}  // namespace
}  // namespace pirt
