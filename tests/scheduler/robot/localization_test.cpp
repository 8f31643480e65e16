// Localization through the runtime: the same bits as the serial run, whatever the mode and the
// units, and what becomes of frames when something goes wrong. No test fails for how long anything
// took.
#include "scheduler/robot/localization.h"

#include <array>
#include <atomic>
#include <filesystem>
#include <latch>
#include <memory>
#include <semaphore>
#include <stop_token>
#include <thread>

#include "scheduler/trace/replay.h"
#include "tests/scheduler/support.h"
#include "tests/scheduler/trace_log.h"
#include "tests/support/data.h"
#include "tests/support/optional_backend.h"
#include "tests/workloads/inputs/sequence_support.h"
#include "workloads/inputs/sequence/stamps.h"
#include "workloads/mapping/keyframes.h"
#include "workloads/model/host_function.h"
#include "workloads/model/slices.h"
#include "workloads/slam/run/map_file.h"
#include "workloads/slam/workload/state_tensors.h"

namespace pirt {
namespace {

using testing::HasSubstr;

constexpr const char* kTwoUnits = R"(
platform: two
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)";

/// Pictures of 320x240, so that a frame takes little; each test asks for its own length.
Sequence small(double duration_s, bool stereo = true) {
  auto options = test::scene(4, duration_s, stereo);
  options.path.rest_s = 0.4;
  options.width = 320;
  options.height = 240;
  return test::remembering(generate_sequence(options));
}

LocalizationOptions options_of(const Sequence& sequence, const std::string& platform = kTwoUnits) {
  LocalizationOptions options;
  options.setup = slam::setup_of(sequence);
  options.runtime.platform = parse_platform("test.yaml", platform, {}, 2);
  options.own_rate = false;
  options.most_in_flight = 3;
  return options;
}

/// All of a state, byte by byte.
std::vector<std::vector<std::byte>> bytes_of(const slam::State& state, const slam::Setup& setup) {
  auto tensors = make_tensors(slam::state_specs(setup));
  slam::write_state(state, tensors);
  std::vector<std::vector<std::byte>> bytes;
  for (const Tensor& tensor : tensors) {
    bytes.emplace_back(tensor.used_bytes().begin(), tensor.used_bytes().end());
  }
  return bytes;
}

void expect_same(const slam::RunResult& live, const slam::RunResult& serial,
                 const slam::Setup& setup) {
  ASSERT_EQ(live.frames.size(), serial.frames.size());
  for (std::size_t i = 0; i < live.frames.size(); ++i) {
    SCOPED_TRACE(i);
    const auto& a = live.frames[i];
    const auto& b = serial.frames[i];
    EXPECT_EQ(a.pose.time, b.pose.time);
    EXPECT_EQ(a.pose.body.rotation, b.pose.body.rotation);
    EXPECT_EQ(a.pose.body.position, b.pose.body.position);
    EXPECT_EQ(a.position_covariance, b.position_covariance);
    EXPECT_EQ(a.status, b.status);
    EXPECT_EQ(a.in_map, b.in_map);
    EXPECT_EQ(a.unusable, b.unusable);
    const auto figures = [](const slam::FrameReport& r) {
      return std::array{r.tracks,   r.landmarks, r.recognized, r.points,
                        r.rejected, r.from_map,  r.stereo};
    };
    EXPECT_EQ(figures(a.report), figures(b.report));
  }
  EXPECT_EQ(bytes_of(live.last, setup), bytes_of(serial.last, setup));
}

slam::RunResult serial(const Sequence& sequence, const LocalizationOptions& options) {
  return localize_serially(sequence, options).run;
}

void expect_balance(const LocalizationResult& result) {
  EXPECT_EQ(result.arrived, result.run.frames.size() + result.dropped + result.failed);
  EXPECT_EQ(result.latencies.size(), result.run.frames.size());
  EXPECT_EQ(result.statistics.live, 0);
}

TEST(Localization, GivesTheSerialRunsBitsInEachMode) {
  const auto sequence = small(2.4);
  auto options = options_of(sequence);
  const auto expected = serial(sequence, options);
  ASSERT_EQ(expected.frames.back().status, slam::Status::kTracking);
  for (const char* mode : {"ect", "olb", "latency", "throughput", "energy", "edf", "advanced"}) {
    SCOPED_TRACE(mode);
    options.runtime.mode = mode;
    const auto live = localize_live(sequence, options);
    expect_same(live.run, expected, options.setup);
    expect_balance(live);
    EXPECT_EQ(live.dropped + live.failed, 0U);
  }
}

TEST(Localization, GivesTheSerialRunsBitsWithEachSetOfSensors) {
  const auto stereo = small(2.4);
  auto no_imu = stereo;
  no_imu.imu.clear();
  no_imu.imu_model.reset();
  const std::array sequences = {test::mono(stereo), no_imu, test::mono(no_imu)};
  for (const auto& sequence : sequences) {
    SCOPED_TRACE(sequence.cameras.size());
    SCOPED_TRACE(sequence.imu.size());
    const auto options = options_of(sequence);
    expect_same(localize_live(sequence, options).run, serial(sequence, options), options.setup);
  }
}

TEST(Localization, RightPicturesMayBeMissing) {
  auto sequence = small(1.6);
  for (std::size_t i = 0; i < sequence.frames.size(); i += 3) sequence.frames[i].present[1] = false;
  const auto options = options_of(sequence);
  expect_same(localize_live(sequence, options).run, serial(sequence, options), options.setup);
}

TEST(Localization, AMapThatWasLoadedIsKnownLiveToo) {
  const auto sequence = small(2.4);
  auto options = options_of(sequence);
  const test::ScratchFolder folder;
  test::put(folder.path() / "map", slam::map_text(serial(sequence, options).last, options.setup));
  auto known = *slam::load_map(folder.path() / "map", options.setup);
  // More points than a run of its own keeps, far away.
  slam::MapPoint far;
  far.covariance = 0.01 * Eigen::Matrix3d::Identity();
  for (int i = 0; i < 2500; ++i) {
    far.position = {100.0 + i, 0, 0};
    far.descriptor.fill(static_cast<std::uint8_t>(i));
    known.push_back(far);
  }
  options.setup.known = std::make_shared<const std::vector<slam::MapPoint>>(std::move(known));
  const auto live = localize_live(sequence, options);
  EXPECT_TRUE(live.run.last.in_map);
  EXPECT_EQ(live.failed, 0U);
  expect_same(live.run, serial(sequence, options), options.setup);
}

TEST(Localization, BlackFramesAreLostAndFoundAsInTheSerialRun) {
  const auto sequence = small(4.0);
  auto options = options_of(sequence);
  options.spoil = [](std::size_t frame, std::size_t, GreyImage& image) {
    if (frame >= 40 && frame < 65) std::ranges::fill(image.pixels, 0);
  };
  const auto live = localize_live(sequence, options);
  expect_same(live.run, serial(sequence, options), options.setup);
  EXPECT_EQ(live.run.frames[60].status, slam::Status::kLost);
  EXPECT_TRUE(live.run.frames[60].unusable);
  EXPECT_EQ(live.run.frames.back().status, slam::Status::kTracking);
}

TEST(Localization, RealPicturesGiveTheSerialRunsBits) {
  PIRT_DATA_OR_SKIP(kitti, "kitti-odometry-urban");
  const auto sequence = read_sequence(kitti);
  const auto options = options_of(sequence);
  expect_same(localize_live(sequence, options).run, serial(sequence, options), options.setup);
}

// Its features are within a hundredth of a pixel of the cpu's, not the same bits.
TEST(Localization, FeaturesFromOpenclGiveAsGoodATrajectory) {
  PIRT_BACKEND_OR_SKIP("opencl");
  const auto sequence = small(3.0);
  auto options = options_of(sequence, R"(
platform: mixed
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: opencl, cores: all, slots: 1, active_w: 1}
)");
  options.runtime.mode = "olb";
  const auto live = localize_live(sequence, options);
  EXPECT_GT(live.served.at("extract_features").at("gpu"), 0);
  const auto error_of = [&](const slam::RunResult& run) {
    return evaluate(run.trajectory(), sequence.truth, Alignment::kSe3).ate_rms_m;
  };
  const double expected = error_of(serial(sequence, options));
  EXPECT_LT(error_of(live.run), 2 * expected + 0.002);
  EXPECT_EQ(live.run.frames.back().status, slam::Status::kTracking);
}

/// Adjusts its keyframes at once, so that its points come to the same frame however it runs.
class Correcting final : public Companion {
 public:
  explicit Correcting(const slam::Setup& setup) : setup_(setup), keyframes_(setup) {}
  void list_workloads(RuntimeOptions&) const override {}
  void begin(Caller&) override {}
  void arrived(Nanos, const GreyImage&) override {}
  void localized(const slam::FrameResult& frame,
                 const std::function<slam::State()>& state) override {
    replaced += frame.map_change.replaced;
    added += frame.map_change.added;
    if (!keyframes_.add(state()) || keyframes_.all().size() < 5) return;
    better_ =
        mapping::better_map(mapping::refine(std::exchange(keyframes_, mapping::Keyframes(setup_))));
  }
  slam::BetterMap better_map() override { return std::exchange(better_, {}); }

  int replaced = 0, added = 0;

 private:
  slam::Setup setup_;
  mapping::Keyframes keyframes_;
  slam::BetterMap better_;
};

TEST(Localization, PointsThatAreKnownBetterComeIntoTheMapLiveAsInTheSerialRun) {
  const auto sequence = small(4.0);
  auto options = options_of(sequence);
  Correcting live(options.setup), serially(options.setup);
  options.companion = &live;
  const auto result = localize_live(sequence, options).run;
  options.companion = &serially;
  expect_same(result, serial(sequence, options), options.setup);
  EXPECT_GT(live.replaced + live.added, 0);
  EXPECT_EQ(live.replaced, serially.replaced);
  EXPECT_EQ(live.added, serially.added);
}

/// Ends no frame before it is let go.
class Holding final : public Companion {
 public:
  void list_workloads(RuntimeOptions&) const override {}
  void begin(Caller&) override {}
  void arrived(Nanos, const GreyImage&) override {}
  void localized(const slam::FrameResult&, const std::function<slam::State()>&) override {
    go_.wait();
  }
  void let_go() { go_.count_down(); }

 private:
  std::latch go_{1};
};

TEST(Localization, FramesThatComeTooFastAreDroppedAndCounted) {
  auto sequence = test::mono(small(1.0));
  sequence.imu.clear();
  sequence.imu_model.reset();
  // All at once: while one is in flight, the others come.
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    sequence.frames[i].time = Nanos(static_cast<std::int64_t>(1000 * (i + 1)));
  }
  auto options = options_of(sequence);
  options.own_rate = true;
  options.most_in_flight = 1;
  const auto serially = localize_serially(sequence, options);
  EXPECT_EQ(serially.arrived, sequence.frames.size());
  EXPECT_GT(serially.dropped, 0U);
  EXPECT_GT(serially.run.frames.size(), 0U);
  expect_balance(serially);

  // However long a picture takes to make, the first frame is in flight until the last one comes.
  Holding holding;
  options.companion = &holding;
  options.spoil = [&](std::size_t frame, std::size_t, GreyImage&) {
    if (frame + 1 == sequence.frames.size()) holding.let_go();
  };
  const auto live = localize_live(sequence, options);
  EXPECT_EQ(live.arrived, sequence.frames.size());
  EXPECT_GE(live.dropped, sequence.frames.size() - 2);
  EXPECT_GT(live.run.frames.size(), 0U);
  expect_balance(live);
}

TEST(Localization, AfterALongGapAllSamplesAreTaken) {
  auto sequence = small(12.0, false);
  // More samples than one call takes.
  const auto far = [&](const Frame& frame) {
    return frame.time > sequence.frames[30].time && frame.time < sequence.frames[295].time;
  };
  auto frames = sequence.frames;
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!far(frames[i])) kept.push_back(i);
  }
  sequence.frames.clear();
  for (const std::size_t i : kept) sequence.frames.push_back(frames[i]);
  sequence.image = [kept, image = sequence.image](std::size_t frame, std::size_t camera) {
    return image(kept[frame], camera);
  };
  ASSERT_GT(
      slam::samples_between(sequence, sequence.frames[30].time, sequence.frames[31].time).size(),
      1024U);
  const auto options = options_of(sequence);
  const auto live = localize_live(sequence, options).run;
  const auto expected = serial(sequence, options);
  ASSERT_EQ(live.frames.size(), expected.frames.size());
  // The cut is at a sample, so that only rounding differs.
  EXPECT_LT((live.frames[31].pose.body.position - expected.frames[31].pose.body.position).norm(),
            1e-6);
}

TEST(Localization, WhatAnImuFeltLongBeforeTheFirstPictureCountsForNothing) {
  auto sequence = small(12.0);
  // 7 s before it, which are more samples than one call takes.
  const auto frames = sequence.frames;
  const auto first = std::ranges::lower_bound(frames, frames[0].time + from_s(7), {}, &Frame::time);
  sequence.frames.assign(first, first + 20);
  sequence.image = [before = static_cast<std::size_t>(first - frames.begin()),
                    image = sequence.image](std::size_t frame, std::size_t camera) {
    return image(before + frame, camera);
  };
  const auto options = options_of(sequence);
  const auto expected = serial(sequence, options);
  expect_same(localize_live(sequence, options).run, expected, options.setup);
  for (ImuSample& sample : sequence.imu) {
    if (sample.time < sequence.frames[0].time - from_s(0.6)) sample.accel_m_s2 *= -1;
  }
  expect_same(serial(sequence, options), expected, options.setup);
}

TEST(Localization, AClockThatJumpsAheadIsNotWaitedFor) {
  auto sequence = small(1.0, false);
  sequence.frames.resize(5);
  sequence.frames.back().time += std::chrono::hours(24);
  auto options = options_of(sequence);
  options.own_rate = true;
  for (const auto& drive : {localize_live, localize_serially}) {
    const auto result = drive(sequence, options);
    EXPECT_EQ(result.arrived, 5U);
    expect_balance(result);
  }
}

/// A unit whose features fail in some way from the first call on, beside one that works.
LocalizationOptions with_failing_unit(const Sequence& sequence, const std::string& failure) {
  auto options = options_of(sequence, R"(
platform: failing
units:
  gpu: {backend: fake, slots: 1, active_w: 1, script: {)" +
                                          failure + R"(: [extract_features],
    unsupported: [imu_propagate, update_pose, extend_map]}}
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
)");
  // Otherwise it would fail as it is prepared, and nothing would begin.
  options.runtime.prepare_first = false;
  options.runtime.mode = "olb";
  return options;
}

TEST(Localization, AUnitThatFailsIsLeftOutAndNoFrameIsLost) {
  const auto sequence = test::mono(small(1.6));
  const auto options = with_failing_unit(sequence, "fail_execute");
  const auto live = localize_live(sequence, options);
  EXPECT_EQ(live.failed, 0U);
  EXPECT_FALSE(live.statistics.units[0].in_service);
  EXPECT_GT(live.statistics.returned, 0);
  ASSERT_FALSE(live.statistics.problems.empty());
  EXPECT_THAT(live.statistics.problems[0], HasSubstr("extract_features on gpu"));
  expect_same(live.run, serial(sequence, options), options.setup);
}

TEST(Localization, AUnitThatHangsCostsItsFrameAndNoOther) {
  const auto sequence = test::mono(small(1.6));
  auto options = with_failing_unit(sequence, "hang");
  options.runtime.time_limit = std::chrono::seconds(2);
  const auto live = localize_live(sequence, options);
  EXPECT_EQ(live.failed, 1U);
  EXPECT_FALSE(live.statistics.units[0].in_service);
  EXPECT_EQ(live.run.frames.size() + 1, sequence.frames.size());
  EXPECT_EQ(live.run.frames.back().status, slam::Status::kTracking);
  expect_balance(live);
}

TEST(Localization, StopsWhenAskedAndKeepsWhatRan) {
  const auto sequence = small(1.6);
  for (const auto& drive : {localize_live, localize_serially}) {
    auto options = options_of(sequence);
    std::atomic<int> seen = 0;
    options.spoil = [&](std::size_t frame, std::size_t, GreyImage&) {
      seen = static_cast<int>(frame);
    };
    options.stops = [&] { return seen >= 20 ? 1 : 0; };
    const auto result = drive(sequence, options);
    EXPECT_TRUE(result.stopped);
    EXPECT_GE(result.run.frames.size(), 19U);
    EXPECT_LE(result.run.frames.size(), 21U);
    expect_balance(result);
  }
}

TEST(Localization, StoppedTwiceItWaitsForNothing) {
  const auto sequence = small(1.6);
  auto options = options_of(sequence);
  std::atomic<int> seen = 0;
  options.spoil = [&](std::size_t frame, std::size_t, GreyImage&) {
    seen = static_cast<int>(frame);
  };
  options.stops = [&] { return seen >= 20 ? 2 : 0; };
  const auto result = localize_live(sequence, options);
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(result.arrived, result.run.frames.size() + result.failed);
}

/// Has a kernel that is prepared until somebody asks whether to stop.
class SlowToPrepare final : public Companion {
 public:
  void list_workloads(RuntimeOptions& options) const override {
    Workload workload;
    workload.name = "slow";
    workload.kernel = "bundle_adjust";
    auto function = std::make_shared<HostFunction>();
    function->prepare = [asked = asked_](std::span<const Tensor>) -> KernelFunction {
      static_cast<void>(asked->try_acquire_for(std::chrono::seconds(5)));
      return [](auto, auto) {};
    };
    workload.operation = std::move(function);
    workload.make_data = [](const DataRequest&) { return Data(); };
    options.workloads.emplace_back(std::move(workload));
  }
  void begin(Caller&) override {}
  void arrived(Nanos, const GreyImage&) override {}
  void localized(const slam::FrameResult&, const std::function<slam::State()>&) override {}
  int stop() {
    asked_->release(2);  // Both units.
    return 1;
  }

 private:
  std::shared_ptr<std::counting_semaphore<>> asked_ =
      std::make_shared<std::counting_semaphore<>>(0);
};

TEST(Localization, StoppedWhileItsUnitsArePreparedItDoesNotBegin) {
  const auto sequence = small(1.0);
  auto options = options_of(sequence);
  SlowToPrepare slow;
  options.companion = &slow;
  options.stops = [&] { return slow.stop(); };
  try {
    static_cast<void>(localize_live(sequence, options));
    ADD_FAILURE() << "it has begun";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kEnvironment);
    EXPECT_THAT(error.what(), HasSubstr("interrupted while unit"));
  }
}

constexpr Nanos kHeld = std::chrono::milliseconds(50);

/// The first frame does not end before the second one has waited for that so long.
class HoldingTheFirst final : public Companion {
 public:
  void list_workloads(RuntimeOptions&) const override {}
  void begin(Caller&) override {}
  void arrived(Nanos, const GreyImage&) override {
    if (++arrived_ != 2) return;
    std::this_thread::sleep_for(kHeld);
    go_.count_down();
  }
  void localized(const slam::FrameResult&, const std::function<slam::State()>&) override {
    go_.wait();
  }
  [[nodiscard]] int stops() const { return arrived_ >= 2 ? 1 : 0; }

 private:
  std::atomic<int> arrived_ = 0;
  std::latch go_{1};
};

TEST(Localization, StepsAreDueWhenTheNextFrameComesHoweverLateTheyBegin) {
  const test::ScratchFolder folder;
  const auto sequence = small(1.0);
  auto options = options_of(sequence);
  HoldingTheFirst holding;
  options.companion = &holding;
  options.stops = [&] { return holding.stops(); };
  options.runtime.trace = (folder.path() / "trace.json").string();
  EXPECT_EQ(localize_live(sequence, options).run.frames.size(), 2U);
  const auto log = test::load_trace_log(*options.runtime.trace);
  const LogEntry* last = nullptr;  // Of the second frame.
  for (const LogEntry& each : log.entries) {
    if (each.input.kind == DispatcherInput::Kind::kSubmit) last = &each;
  }
  ASSERT_NE(last, nullptr);
  EXPECT_LE(last->tasks.at(0).deadline.value() - last->input.now,
            usual_step(stamps_of(sequence.frames)) - kHeld);
}

struct Held {
  std::atomic<int> waiting = 0;
  std::latch go{1};
};

/// The first frame does not end before a task of its own is cancelled, which runs until then.
class HoldingUntilCancelled final : public Companion {
 public:
  void list_workloads(RuntimeOptions& options) const override {
    const auto hold = [held = held_](auto, auto) {
      ++held->waiting;
      const std::stop_callback cancelled(stop_of_call(), [&] { held->go.count_down(); });
      held->go.wait();
    };
    options.workloads.emplace_back(
        OwnWorkload{.name = "hold", .inputs = {}, .outputs = {}, .kernels = {{"holding", hold}}});
  }
  void begin(Caller& caller) override {
    caller.call("hold", {}, {}, [](auto) {});
  }
  void arrived(Nanos, const GreyImage&) override {}
  void localized(const slam::FrameResult&, const std::function<slam::State()>&) override {
    ++held_->waiting;
    held_->go.wait();
  }
  [[nodiscard]] bool both_wait() const { return held_->waiting >= 2; }

 private:
  std::shared_ptr<Held> held_ = std::make_shared<Held>();
};

// Frames have come and their pyramids are made while the first one is held: none of them begins
// once all that is under way is cancelled for the trace's sake.
TEST(Localization, StoppedTwiceNoFrameBeginsThatWaitedWithATraceEither) {
  const test::ScratchFolder folder;
  const auto sequence = test::mono(small(1.6));
  auto options = options_of(sequence, R"(
platform: three
units:
  cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  gpu: {backend: cpu, cores: all, slots: 1, active_w: 1}
  holding: {backend: fake, slots: 1, active_w: 1,
            script: {unsupported: [extract_features, imu_propagate, update_pose, extend_map]}}
)");
  options.runtime.mode = "olb";
  options.runtime.time_limit = std::chrono::minutes(10);
  options.runtime.trace = (folder.path() / "trace.json").string();
  options.most_in_flight = 20;
  HoldingUntilCancelled holding;
  options.companion = &holding;
  std::atomic<std::size_t> seen = 0;
  options.spoil = [&](std::size_t frame, std::size_t, GreyImage&) { seen = frame; };
  options.stops = [&] { return holding.both_wait() && seen >= 20 ? 2 : 0; };
  const auto result = localize_live(sequence, options);
  EXPECT_EQ(result.run.frames.size(), 1U);
  EXPECT_EQ(result.arrived, result.run.frames.size() + result.failed);
  EXPECT_EQ(result.trace_problem, "");
}

TEST(Localization, ItsTraceReplays) {
  const test::ScratchFolder folder;
  const auto sequence = small(1.2);
  auto options = options_of(sequence);
  options.runtime.trace = (folder.path() / "trace.json").string();
  const auto result = localize_live(sequence, options);
  const auto replayed = replay_file(*options.runtime.trace).result;
  EXPECT_FALSE(replayed.difference.has_value());
  EXPECT_GT(replayed.decisions, static_cast<std::int64_t>(5 * result.run.frames.size()));
}

TEST(Localization, PicturesThatCannotBeReadEndTheRunWithTheirError) {
  auto sequence = small(1.6);
  sequence.image = [image = sequence.image](std::size_t frame, std::size_t camera) {
    if (frame == 20) throw_bad_input("picture 20 is damaged");
    return image(frame, camera);
  };
  const auto options = options_of(sequence);
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(localize_live(sequence, options)); }),
              HasSubstr("picture 20"));
}

}  // namespace
}  // namespace pirt
