#include "characterize/worker/measure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "characterize/campaign/validity.h"
#include "characterize/statistics/statistics.h"
#include "tests/characterize/support.h"

namespace pirt {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// Time that passes only where a test says so, and, like a real clock, a little at each reading.
class TickingClock : public Clock {
 public:
  explicit TickingClock(Nanos cost) : cost_(cost) {}
  [[nodiscard]] Nanos now() const override { return std::exchange(now_, now_ + cost_); }
  void advance(Nanos by) { now_ += by; }

 private:
  mutable Nanos now_{0};
  Nanos cost_;
};

class TimedKernel : public Kernel {
 public:
  explicit TimedKernel(TickingClock& clock) : clock_(clock) {}
  void bind(std::span<const Tensor>, std::span<Tensor>) override {}
  void upload() override {
    clock_.advance(upload_time);
    ++uploads;
  }
  std::optional<Nanos> execute(int repeats) override {
    EXPECT_EQ(repeats, 1);
    const auto& time = execute_times[static_cast<std::size_t>(executes++) % execute_times.size()];
    clock_.advance(launch_time.value_or(Nanos(0)) + time);
    if (odd_each > 0 && executes % odd_each == 0) return milliseconds(1000);
    return reported_launch ? reported_launch : launch_time;
  }
  std::optional<Nanos> stamped_launch() override {
    if (asked_calls.empty()) return std::nullopt;
    const Nanos call = asked_calls[static_cast<std::size_t>(asked++) % asked_calls.size()];
    clock_.advance(call);
    return call / 4;
  }
  void download() override {
    clock_.advance(download_time);
    ++downloads;
  }

  Nanos upload_time{0}, download_time{0};
  std::optional<Nanos> launch_time, reported_launch;
  int odd_each = 0;  ///< One of so many stamps cannot be.
  std::vector<Nanos> execute_times = {milliseconds(5)};
  std::vector<Nanos> asked_calls;  ///< A quarter of each is launching.
  int uploads = 0, executes = 0, downloads = 0, asked = 0;

 private:
  TickingClock& clock_;
};

constexpr ClockQuality kSimulated;
constexpr ClockQuality kReal{25, Nanos(20)};
const std::vector<Phase> kTransfers = {Phase::kDeviceInit, Phase::kPrepare, Phase::kUpload,
                                       Phase::kLaunch,     Phase::kExecute, Phase::kDownload,
                                       Phase::kCall};
const std::vector<Phase> kHost = {Phase::kDeviceInit, Phase::kPrepare, Phase::kExecute,
                                  Phase::kCall};

SamplingOptions twenty() {
  SamplingOptions options;
  options.warm_up = options.slice = Nanos(0);
  options.min_samples = 20;
  return options;
}

const PhaseSamples& find(const std::vector<PhaseSamples>& all, Phase phase) {
  const auto it = std::ranges::find(all, phase, &PhaseSamples::phase);
  EXPECT_NE(it, all.end());
  return *it;
}

TEST(Measure, GivesThePhasesOfOneCallThatSumUpToIt) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.upload_time = milliseconds(1);
  kernel.launch_time = microseconds(300);
  kernel.download_time = milliseconds(2);
  const auto result = sample_calls(kernel, clock, kSimulated, kTransfers, twenty());
  ASSERT_EQ(result.size(), 5U);
  EXPECT_THAT(find(result, Phase::kUpload).samples, Each(Nanos(milliseconds(1))));
  EXPECT_THAT(find(result, Phase::kLaunch).samples, Each(Nanos(microseconds(300))));
  EXPECT_THAT(find(result, Phase::kExecute).samples, Each(Nanos(milliseconds(5))));
  EXPECT_THAT(find(result, Phase::kDownload).samples, Each(Nanos(milliseconds(2))));
  EXPECT_THAT(find(result, Phase::kCall).samples, Each(Nanos(microseconds(8300))));
  for (const auto& phase : result) {
    EXPECT_EQ(phase.samples.size(), 20U);
    EXPECT_EQ(phase.batch, 1);
  }
}

// One that is asked takes longer than the others, and may be held up: its share counts.
TEST(Measure, AsksADeviceForWhatLaunchingTakesByCallsOfTheirOwn) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.execute_times = {milliseconds(4)};
  kernel.upload_time = kernel.download_time = milliseconds(1);
  kernel.asked_calls = {milliseconds(6), milliseconds(60)};
  const auto result = sample_calls(kernel, clock, kSimulated, kTransfers, twenty());
  EXPECT_EQ(kernel.asked, 20) << "one each sample of single calls";
  EXPECT_THAT(find(result, Phase::kLaunch).samples, Each(Nanos(milliseconds(1))));
  EXPECT_THAT(find(result, Phase::kExecute).samples, Each(Nanos(milliseconds(3))));
  EXPECT_THAT(find(result, Phase::kCall).samples, Each(Nanos(milliseconds(6))));
}

TEST(Measure, HasNoLaunchWithoutDeviceStamps) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.upload_time = kernel.download_time = milliseconds(1);
  const auto result = sample_calls(kernel, clock, kSimulated, kTransfers, twenty());
  EXPECT_EQ(std::ranges::count(result, Phase::kLaunch, &PhaseSamples::phase), 0);
  EXPECT_EQ(result.size(), 4U);
}

TEST(Measure, HasNoPhaseThatTakesNoSimulatedTime) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  const auto result = sample_calls(kernel, clock, kSimulated, kTransfers, twenty());
  ASSERT_EQ(result.size(), 2U);
  EXPECT_EQ(result[0].phase, Phase::kExecute);
  EXPECT_EQ(result[1].phase, Phase::kCall);
}

TEST(Measure, BatchesShortCallsSoThatTheClockDoesNotShow) {
  TickingClock clock{Nanos(25)};
  TimedKernel kernel(clock);
  kernel.execute_times = {microseconds(10)};
  const auto result = sample_calls(kernel, clock, kReal, kHost, twenty());
  // The warm-up's last calls took 10 us and up to 3 readings; ceil(1 ms / 10.075 us) = 100 calls a
  // batch. A batch starts and ends with a reading, of which one falls into it: (100 * 10000 + 25) /
  // 100 = 10000.25 ns a call, 10000 in whole ns.
  EXPECT_EQ(find(result, Phase::kCall).batch, 100);
  EXPECT_THAT(find(result, Phase::kCall).samples, Each(Nanos(10'000)));
  EXPECT_THAT(find(result, Phase::kExecute).samples, Each(Nanos(10'000)));
  EXPECT_EQ(kernel.executes, 2 + 20 * 100);  // executing is the call: not timed twice
}

TEST(Measure, TimesTransfersOfShortCallsOnTheirOwn) {
  TickingClock clock{Nanos(25)};
  TimedKernel kernel(clock);
  kernel.upload_time = microseconds(20);
  kernel.launch_time = microseconds(5);
  kernel.execute_times = {microseconds(200)};
  kernel.download_time = microseconds(40);
  const auto result = sample_calls(kernel, clock, kReal, kTransfers, twenty());
  // A call takes 265 us: 4 a batch. Batches of 1 ms of each phase: 50 uploads and 25 downloads (one
  // fewer where a reading of the clock made the estimate longer), whose samples are free of the
  // clock's cost in whole nanoseconds.
  EXPECT_EQ(find(result, Phase::kCall).batch, 4);
  EXPECT_EQ(find(result, Phase::kUpload).batch, 50);
  EXPECT_EQ(find(result, Phase::kDownload).batch, 25);
  EXPECT_EQ(find(result, Phase::kExecute).batch, 5);
  EXPECT_THAT(find(result, Phase::kUpload).samples, Each(Nanos(microseconds(20))));
  EXPECT_THAT(find(result, Phase::kLaunch).samples, Each(Nanos(microseconds(5))));
  EXPECT_THAT(find(result, Phase::kDownload).samples, Each(Nanos(40'001)));  // 25 ns / 25 calls
  EXPECT_THAT(find(result, Phase::kExecute).samples, Each(Nanos(200'005)));  // 25 ns / 5 calls
  EXPECT_THAT(find(result, Phase::kCall).samples, Each(Nanos(265'006)));     // 25 ns / 4 calls
}

TEST(Measure, TimesATinyTransferOfALongCallOnItsOwn) {
  TickingClock clock{Nanos(25)};
  TimedKernel kernel(clock);
  kernel.upload_time = milliseconds(1);
  kernel.download_time = microseconds(2);  // 25 ns would be 1.2 % of it
  const auto result = sample_calls(kernel, clock, kReal, kTransfers, twenty());
  EXPECT_EQ(find(result, Phase::kCall).batch, 1);
  EXPECT_EQ(find(result, Phase::kUpload).batch, 1);
  EXPECT_EQ(find(result, Phase::kDownload).batch, 494);  // ceil(1 ms / 2.025 us)
  EXPECT_THAT(find(result, Phase::kDownload).samples, Each(Nanos(microseconds(2))));
  EXPECT_EQ(kernel.uploads, 2 + 20);
}

TEST(Measure, SamplesForItsSliceWhateverTheSamplesSay) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  SamplingOptions options = twenty();
  options.slice = milliseconds(500);  // of calls of 5 ms
  EXPECT_EQ(
      find(sample_calls(kernel, clock, kSimulated, kHost, options), Phase::kCall).samples.size(),
      100U);
  options.max_samples = 30;
  EXPECT_EQ(
      find(sample_calls(kernel, clock, kSimulated, kHost, options), Phase::kCall).samples.size(),
      30U);
}

TEST(Measure, TakesItsFewestSamplesHoweverShortTheSlice) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.execute_times = {std::chrono::seconds(1)};
  SamplingOptions options = twenty();
  options.slice = milliseconds(10);
  const auto result = sample_calls(kernel, clock, kSimulated, kHost, options);
  EXPECT_EQ(find(result, Phase::kCall).samples.size(), 20U);
  options.limit = std::chrono::seconds(7);  // the limit goes before
  const auto cut = sample_calls(kernel, clock, kSimulated, kHost, options);
  EXPECT_EQ(find(cut, Phase::kCall).samples.size(), 7U);
}

// Frames of 1, 2 and 3 ms in turns: 20 samples at least are 7 sequences. The calls of a sample are
// on one frame, and what lies between is not in it.
TEST(Measure, PlaysSequencesToTheirEnd) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  int frame = 0;
  const auto show = [&] {
    kernel.execute_times = {milliseconds(1 + frame % 3)};
    ++frame;
  };
  show();
  const PlayedCalls sequence{.next =
                                 [&] {
                                   clock.advance(milliseconds(100));
                                   show();
                                 },
                             .frames = 3};
  const auto result = sample_calls(kernel, clock, kSimulated, kHost, twenty(), sequence);
  const auto& calls = find(result, Phase::kCall).samples;
  ASSERT_EQ(calls.size(), 21U);
  for (const int ms : {1, 2, 3}) {
    EXPECT_EQ(std::ranges::count(calls, Nanos(milliseconds(ms))), 7) << ms;
  }
}

// A frame's calls but the first are not what a sequence costs where the kernel keeps what it made.
TEST(Measure, CallsOfASequenceAreRepeatedOnlyAsTheClockAsks) {
  const auto batch_of = [](Nanos call, std::int64_t frames) {
    TickingClock clock{Nanos(25)};
    TimedKernel kernel(clock);
    kernel.execute_times = {call};
    const PlayedCalls sequence{.next = [] {}, .frames = frames};
    const auto result = sample_calls(kernel, clock, kReal, kHost, twenty(), sequence);
    return find(result, Phase::kCall).batch;
  };
  // The clock costs 25 ns, a thousandth of 25 us.
  EXPECT_EQ(batch_of(microseconds(50), 3), 1);
  EXPECT_EQ(batch_of(microseconds(10), 3), 3);
  EXPECT_EQ(batch_of(microseconds(50), 1), 20);
}

TEST(Measure, TimesExecutionsAloneAfterWhatComesBeforeEach) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.upload_time = milliseconds(2);
  kernel.execute_times = {milliseconds(3)};
  int swept = 0;
  int frames = 0;
  const PlayedCalls sequence{.next = [&frames] { ++frames; }, .frames = 2};
  const auto result = sample_executions(
      kernel, clock, 4,
      [&] {
        clock.advance(milliseconds(50));
        ++swept;
      },
      sequence);
  EXPECT_EQ(result.phase, Phase::kExecute);
  EXPECT_THAT(result.samples,
              ElementsAre(milliseconds(3), milliseconds(3), milliseconds(3), milliseconds(3)));
  EXPECT_EQ(swept, 4);
  EXPECT_EQ(frames, 4);
}

TEST(Measure, WarmsUpForAsLongAsAsked) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  SamplingOptions options = twenty();
  options.warm_up = milliseconds(100);
  static_cast<void>(sample_calls(kernel, clock, kSimulated, kHost, options));
  EXPECT_EQ(kernel.executes, 20 + 20);  // 100 ms of 5 ms calls, then the samples
}

TEST(Measure, WarmsUpForItsTimeHoweverShortTheCalls) {
  TickingClock clock{Nanos(25)};
  TimedKernel kernel(clock);
  kernel.execute_times = {Nanos(900)};
  SamplingOptions options = twenty();
  options.warm_up = milliseconds(80);
  options.min_samples = 1;
  const auto result = sample_calls(kernel, clock, kReal, kHost, options);
  // A call is 900 ns and 5 readings, its own 4 and that of the loop: 1025 ns; ceil(80 ms / that).
  EXPECT_EQ(kernel.executes - find(result, Phase::kCall).batch, 78'049);
}

TEST(Measure, EndsTheWarmUpOfSimulatedCallsThatTakeNoTime) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.execute_times = {Nanos(0)};
  SamplingOptions options = twenty();
  options.warm_up = milliseconds(80);
  static_cast<void>(sample_calls(kernel, clock, kSimulated, kHost, options));
  EXPECT_EQ(kernel.executes, 1000 + 20);
}

TEST(Measure, DoesNotBelieveStampsLongerThanTheExecution) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.reported_launch = milliseconds(6);
  EXPECT_THAT(
      test::error_of(ErrorCode::kEnvironment,
                     [&] { return sample_calls(kernel, clock, kSimulated, kTransfers, twenty()); }),
      ::testing::HasSubstr("time stamps"));
}

TEST(Measure, LeavesOutAndCountsAFewStampsThatCannotBe) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.upload_time = milliseconds(1);
  kernel.launch_time = microseconds(300);
  kernel.odd_each = 5;
  const auto result = sample_calls(kernel, clock, kSimulated, kTransfers, twenty());
  EXPECT_THAT(find(result, Phase::kLaunch).samples, Each(Nanos(microseconds(300))));
  EXPECT_THAT(find(result, Phase::kExecute).samples, Each(Nanos(milliseconds(5))));
  EXPECT_EQ(find(result, Phase::kExecute).samples.size(), 16U);
  EXPECT_EQ(find(result, Phase::kCall).samples.size(), 20U);
  EXPECT_GE(find(result, Phase::kExecute).odd_stamps, 4);
  EXPECT_EQ(find(result, Phase::kCall).odd_stamps, 0);
}

TEST(Measure, SizesBatchesToAMillisecond) {
  EXPECT_EQ(batch_size(milliseconds(1)), 1);
  EXPECT_EQ(batch_size(Nanos(999'999)), 2);
  EXPECT_EQ(batch_size(microseconds(3)), 334);
  EXPECT_EQ(batch_size(Nanos(0)), 100'000);  // the most
}

// A counter of 32.768 kHz; and a clock that takes 50 us to read.
TEST(Measure, SizesBatchesToWhatTheClockCanTell) {
  for (const ClockQuality& quality : {ClockQuality{200, Nanos(30'500)}, ClockQuality{5e4}}) {
    const std::int64_t batch = batch_size(microseconds(100), quality);
    EXPECT_GT(batch, 10);
    EXPECT_FALSE(is_clock_bound(microseconds(100), batch, quality));
    EXPECT_TRUE(is_clock_bound(microseconds(100), 10, quality));
    EXPECT_EQ(batch_size(milliseconds(6), quality), 1);
  }
  EXPECT_EQ(batch_size(microseconds(3), kReal), 334);
}

// Calls of 2 ms as they are, and as the phases of a batch.
TEST(Measure, OnACoarseClockNothingIsClockBound) {
  TickingClock clock{Nanos(0)};
  TimedKernel kernel(clock);
  kernel.upload_time = microseconds(500);
  kernel.download_time = microseconds(500);
  kernel.execute_times = {milliseconds(1)};
  const ClockQuality coarse{200, Nanos(30'500)};
  const PlayedCalls repeated{};
  const PlayedCalls sequence{[] {}, 2};
  for (const PlayedCalls* calls : {&repeated, &sequence}) {
    for (const PhaseSamples& phase :
         sample_calls(kernel, clock, coarse, kTransfers, twenty(), *calls)) {
      EXPECT_FALSE(is_clock_bound(median(phase.samples), phase.batch, coarse))
          << to_string(phase.phase);
    }
  }
}

TEST(Measure, KnowsTheCostOfAClock) {
  const ClockQuality quality = measure_clock(TickingClock(Nanos(40)));
  EXPECT_DOUBLE_EQ(quality.cost_ns, 40);
  EXPECT_EQ(quality.resolution, Nanos(40));
}

/// Steps of 4 ms, as jiffies.
class Jiffies : public Clock {
 public:
  explicit Jiffies(const Clock& fine) : fine_(fine) {}
  [[nodiscard]] Nanos now() const override {
    const Nanos fine = fine_.now();
    return fine - fine % milliseconds(4);
  }

 private:
  const Clock& fine_;
};

// Of five calls most take no time that it shows.
TEST(Measure, OnAClockOfMillisecondsBatchesAreOfWhatTheWholeWarmUpSays) {
  TickingClock fine{Nanos(40)};
  TimedKernel kernel(fine);
  kernel.execute_times = {milliseconds(1)};
  auto options = twenty();
  options.warm_up = milliseconds(80);
  const ClockQuality quality{40, milliseconds(4)};
  const auto result = sample_calls(kernel, Jiffies(fine), quality, kHost, options);
  EXPECT_GT(find(result, Phase::kCall).batch, 300);
  EXPECT_LT(find(result, Phase::kCall).batch, 600);
}

// A clock that stands still through all of the rounds.
TEST(Measure, KnowsTheCostAndStepOfAClockOfMilliseconds) {
  const ClockQuality quality = measure_clock(Jiffies(TickingClock(Nanos(40))));
  EXPECT_NEAR(quality.cost_ns, 40, 0.1);
  EXPECT_EQ(quality.resolution, Nanos(milliseconds(4)));
  EXPECT_EQ(measure_clock(TickingClock(Nanos(0))).cost_ns, 0.1) << "0 is a simulated clock's";
}

TEST(Measure, KnowsTheMachinesClock) {
  const ClockQuality quality = measure_clock(MachineClock());
  EXPECT_GT(quality.cost_ns, 0);
  EXPECT_GT(quality.resolution, Nanos(0));
}

TEST(Validity, CallsAFigureClockBoundAboveOnePercent) {
  EXPECT_FALSE(is_clock_bound(Nanos(2500), 1, kReal));  // 25 ns of 2500: exactly 1 %
  EXPECT_TRUE(is_clock_bound(Nanos(2499), 1, kReal));
  EXPECT_FALSE(is_clock_bound(Nanos(25), 100, kReal));  // a batch of 100 counts
  EXPECT_TRUE(is_clock_bound(milliseconds(50), 1, {30, Nanos(milliseconds(1))}));  // a coarse clock
  EXPECT_FALSE(is_clock_bound(Nanos(1), 1, kSimulated));
}

TEST(Validity, CallsADriftUnstable) {
  std::vector<Nanos> samples(40, Nanos(1000));
  EXPECT_FALSE(is_unstable(samples));
  std::fill(samples.begin() + 20, samples.end(), Nanos(1200));
  EXPECT_FALSE(is_unstable(samples));  // exactly 20 %
  std::fill(samples.begin() + 20, samples.end(), Nanos(1201));
  EXPECT_TRUE(is_unstable(samples));
  std::ranges::reverse(samples);
  EXPECT_TRUE(is_unstable(samples));
  std::vector<Nanos> alternating;
  for (int i = 0; i < 40; ++i) alternating.emplace_back(i % 2 == 0 ? 1000 : 2000);
  EXPECT_FALSE(is_unstable(alternating));  // noisy, but the same in both halves
  EXPECT_FALSE(is_unstable(test::ramp(1, 11)));
}

/// @p size samples of @p time in each of @p count processes.
CellSamples processes_of(std::size_t count, std::size_t size, Nanos time) {
  CellSamples all;
  for (std::size_t process = 0; process < count; ++process) {
    all.samples.resize(all.samples.size() + size, time);
    all.processes.resize(all.samples.size(), static_cast<std::int32_t>(process));
  }
  return all;
}

bool unstable(std::initializer_list<std::int64_t> process_medians) {
  CellSamples all;
  for (const std::int64_t time : process_medians) {
    all.samples.resize(all.samples.size() + 5, Nanos(time));
    all.processes.resize(all.samples.size(), all.processes.empty() ? 0 : all.processes.back() + 1);
  }
  return is_unstable(all.samples, all.processes);
}

TEST(Validity, CallsALaterHalfOfProcessesThatIsElsewhereUnstable) {
  EXPECT_FALSE(unstable({1000, 1000, 1200, 1200}));  // exactly 20 %
  EXPECT_TRUE(unstable({1000, 1000, 1201, 1201}));
  EXPECT_TRUE(unstable({1201, 1201, 1000, 1000}));
  EXPECT_FALSE(unstable({1000, 1500, 1000, 1500}));        // noisy all the time
  EXPECT_FALSE(unstable({1000, 1400, 1500, 1400, 1500}));  // of the later ones one like the first
  EXPECT_FALSE(unstable({1000, 1500, 1500}));              // too few to say
}

TEST(Validity, CallsProcessesThatDriftUnstable) {
  CellSamples all;
  for (std::int32_t process = 0; process < 3; ++process) {
    for (int i = 0; i < 40; ++i) {
      all.samples.emplace_back(process < 2 && i >= 20 ? 1500 : 1000);
      all.processes.push_back(process);
    }
  }
  EXPECT_TRUE(is_unstable(all.samples, all.processes));  // two of three
  std::fill(all.samples.begin() + 40, all.samples.end(), Nanos(1000));
  EXPECT_FALSE(is_unstable(all.samples, all.processes));  // one of three
}

TEST(Validity, DisregardsWhatBefellFewProcesses) {
  EXPECT_FALSE(concerns_row(0, 1));
  EXPECT_TRUE(concerns_row(1, 4));
  EXPECT_FALSE(concerns_row(1, 5));
  EXPECT_TRUE(concerns_row(3, 12));
}

TEST(Validity, CollectsEveryReason) {
  CellConditions all{kReal, false, true, true, true};
  CellSamples call = processes_of(3, 6, Nanos(100));  // 18 samples
  EXPECT_THAT(held_against(judge(call, all)),
              ElementsAre("clock_bound", "few_samples", "throttled", "unstable"));
  all.wrong_output = true;  // which is why there are few
  EXPECT_THAT(held_against(judge(call, all)),
              ElementsAre("wrong_output", "clock_bound", "throttled", "unstable"));
  const CellConditions fine{kReal, false, false, false, false};
  EXPECT_THAT(held_against(judge(processes_of(3, 7, Nanos(100'000)), fine)), IsEmpty());
  EXPECT_THAT(held_against(judge(processes_of(2, 20, Nanos(100'000)), fine)),
              ElementsAre("few_samples"));
  CellSamples launch = processes_of(3, 7, Nanos(100));
  launch.phase = Phase::kLaunch;
  EXPECT_THAT(held_against(judge(launch, fine)),
              IsEmpty());  // the device's stamps, not the clock's
}

TEST(Validity, DoubtsStampsOfWhichMoreThanOneInAHundredCannotBe) {
  const CellConditions fine{kReal, false, false, false, false};
  CellSamples launch = processes_of(3, 40, Nanos(100'000));
  launch.phase = Phase::kLaunch;
  launch.odd_stamps = 1;  // of 120
  EXPECT_THAT(held_against(judge(launch, fine)), IsEmpty());
  EXPECT_THAT(annotate(launch, fine, 0.02), ElementsAre("odd_stamps"));
  launch.odd_stamps = 2;
  EXPECT_THAT(held_against(judge(launch, fine)), ElementsAre("odd_stamps"));
  EXPECT_THAT(annotate(launch, fine, 0.02), IsEmpty());
}

TEST(Validity, NotesWhatWasReachedAndWhatElseHappened) {
  CellSamples even = processes_of(4, 5, Nanos(1000));
  EXPECT_THAT(annotate(even, {}, 0.02), IsEmpty());
  CellConditions busy;
  busy.contended = true;
  EXPECT_THAT(annotate(even, busy, 0.02), ElementsAre("contended"));
  // Processes at 1000 and 1100 in turns: two groups 10 % apart. Mean 1050, deviation 57.7, half
  // width 3.182 * 57.7 / 2 = 91.9, but not below 1000: 1000 to 1141.9, half of it 6.8 % of 1050.
  for (std::size_t i = 0; i < even.samples.size(); ++i) {
    if (even.processes[i] % 2 == 1) even.samples[i] = Nanos(1100);
  }
  EXPECT_THAT(annotate(even, {}, 0.02), ElementsAre("precision_not_reached", "bimodal"));
  EXPECT_THAT(annotate(even, {}, 0.06), Contains("precision_not_reached"));
  EXPECT_THAT(annotate(even, {}, 0.07), ElementsAre("bimodal"));
  EXPECT_THAT(annotate(processes_of(2, 20, Nanos(1000)), {}, 0.02),
              ElementsAre("precision_not_reached"));  // no interval: nothing was reached
}

TEST(Validity, CallsAnIntervalOfMoreThanAFifthEitherWayImprecise) {
  const auto half = [](std::int64_t ns) { return Interval{Nanos(1000 - ns), Nanos(1000 + ns)}; };
  EXPECT_FALSE(is_imprecise(half(200), Nanos(1000), std::nullopt));
  EXPECT_TRUE(is_imprecise(half(201), Nanos(1000), std::nullopt));
  EXPECT_FALSE(is_imprecise(std::nullopt, Nanos(1000), std::nullopt));
  // A part of a call: 300 ns are 5 % of 6000.
  EXPECT_FALSE(is_imprecise(half(300), Nanos(1000), Nanos(6000)));
  EXPECT_TRUE(is_imprecise(half(301), Nanos(1000), Nanos(6000)));
  EXPECT_TRUE(is_imprecise(half(1), Nanos(0), std::nullopt));
}

TEST(Validity, JudgesOneRowByItsInterval) {
  CellSamples wide = processes_of(6, 5, Nanos(1000));
  for (std::size_t i = 0; i < wide.samples.size(); ++i) {
    if (wide.processes[i] % 2 == 1) wide.samples[i] = Nanos(2000);
  }
  EXPECT_THAT(held_against(judge(wide, {})), ElementsAre("imprecise"));
  CellConditions repeats;
  repeats.deterministic = true;
  EXPECT_THAT(held_against(judge(wide, repeats)), IsEmpty());
}

TEST(Validity, ContendedIsAReasonWhereItIsNotPreciseOrOthersTookMuch) {
  CellConditions found;
  EXPECT_FALSE(is_spoilt_by_others(found));
  found.contended = true;
  EXPECT_FALSE(is_spoilt_by_others(found));
  found.precise = false;
  EXPECT_TRUE(is_spoilt_by_others(found));
  found.precise = true;
  found.crowded = true;
  EXPECT_TRUE(is_spoilt_by_others(found));
  const CellSamples even = processes_of(4, 5, Nanos(1000));
  EXPECT_THAT(held_against(judge(even, found)), ElementsAre("contended"));
  EXPECT_THAT(annotate(even, found, 0.02), IsEmpty());  // a reason is no note as well
}

TEST(Validity, JudgesSetUps) {
  const auto judged = [](std::initializer_list<std::int64_t> ms) {
    std::vector<Nanos> times;
    for (const std::int64_t each : ms) times.emplace_back(milliseconds(each));
    return held_against(judge_setups(times, {}));
  };
  EXPECT_THAT(judged({}), IsEmpty());
  EXPECT_THAT(judged({700}), IsEmpty());
  EXPECT_THAT(judged({700, 1000}), IsEmpty());  // half of it 150 of 850
  EXPECT_THAT(judged({700, 1100}), ElementsAre("imprecise"));
  EXPECT_THAT(judged({1, 3}), IsEmpty());  // half of it 1 ms
  EXPECT_THAT(judged({1, 4}), ElementsAre("imprecise"));
  EXPECT_THAT(judged({20, 20, 27, 27}), Contains("unstable"));
  EXPECT_THAT(judged({2, 2, 3, 3}), ::testing::Not(Contains("unstable")));  // 1 ms
  CellConditions found;
  found.throttled = found.contended = found.crowded = true;
  EXPECT_THAT(held_against(judge_setups(std::vector<Nanos>(3, Nanos(milliseconds(5))), found)),
              ElementsAre("throttled", "contended"));
}

}  // namespace
}  // namespace pirt
