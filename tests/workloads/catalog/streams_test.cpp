// Workloads with a state, with lists whose length varies, and with a sequence of inputs: tensors,
// playing, judging, and every backend against the reference.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/support/data.h"
#include "tests/workloads/backends/opencl/opencl_device_support.h"
#include "tests/workloads/catalog/workload_support.h"
#include "workloads/backends/cpu/cpu_backend.h"
#include "workloads/backends/fake/fake_backend.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/model/player.h"
#include "workloads/vision/image_data.h"

namespace pirt {
namespace {

using testing::HasSubstr;

Data first_frame(const Workload& workload) {
  auto frames = test::sequence_of(workload);
  return std::move(frames[0]);
}

// ----------------------------------------------------------------------------------------- tensors

TEST(Lists, KnowTheirRowsWithinTheirCapacity) {
  Tensor list({"corners", Element::kF32, {500, 2}, true});
  EXPECT_EQ(list.spec().describe(), "corners f32[<=500,2]");
  EXPECT_EQ(list.rows(), 500);
  list.set_rows(3);
  EXPECT_EQ(list.rows(), 3);
  EXPECT_EQ(list.used_bytes().size(), 3U * 2 * 4);
  EXPECT_EQ(list.used<float>().size(), 6U);
  EXPECT_EQ(list.count(), 1000);
  list.set_rows(0);
  EXPECT_TRUE(list.used_bytes().empty());
  EXPECT_THROW(list.set_rows(501), std::logic_error);
  EXPECT_THROW(list.set_rows(-1), std::logic_error);
  EXPECT_EQ(list.rows(), 0) << "a refused number changes nothing";
  Tensor picture({"image", Element::kU8, {4, 4}});
  EXPECT_EQ(picture.rows(), 4);
  EXPECT_THROW(picture.set_rows(4), std::logic_error) << "its size is fixed";
  EXPECT_THROW(copy_tensor(picture, list), std::logic_error);
}

// Pictures of 8x4: 32 + 32 bytes and a capacity of 500 points of 8 bytes in, as many out with a
// byte of status each. With 2 points: 64 + 16 + 18. The background of 8x4: 32 in, 32 out, and
// 4 * 32 + 4 bytes of state, read and written.
TEST(Lists, BytesOfACallFollowFromItsRows) {
  const auto tracking = vision::make_track_features(8, 4);
  EXPECT_EQ(tracking.bytes(), 64 + 500 * 8 + 500 * 9);
  Data data = first_frame(tracking);
  data.inputs[2].set_rows(2);
  EXPECT_EQ(tracking.bytes(data, tracking.reference(data)), 64 + 16 + 18);
  EXPECT_EQ(vision::make_background_model(8, 4).bytes(), 64 + 2 * (4 * 32 + 4));
}

// A window: 17x17 samples of 7 operations and 225 of 12. A step: 225 samples of 13; a look: 225
// of 3; how it has deformed, where it is not followed back: 225 of 64. Pyramids of 64x48: two of
// 32x24, 16x12 and 8x6 pixels of 18 operations.
TEST(Lists, OperationsOfACallAreWhatItsPointsTake) {
  constexpr std::int64_t kWindow = 289 * 7 + 225 * 12, kStep = 225 * 13;
  constexpr std::int64_t kLook = 225 * 67;
  constexpr std::int64_t kPyramids = 2 * 18 * (32 * 24 + 16 * 12 + 8 * 6);
  const auto tracking = vision::make_track_features(64, 48);
  EXPECT_EQ(tracking.ops, std::nullopt);
  Data data = first_frame(tracking);
  data.inputs[2].set_rows(0);
  EXPECT_EQ(tracking.ops_of(data), kPyramids);
  // At (20,20) the window leaves the pictures of the third and fourth level. One picture twice:
  // each level and the way back take a window and a step, the finest level a look; where nothing
  // is, there is no step.
  data.inputs[2].set_rows(1);
  std::ranges::fill(data.inputs[2].as<float>().first(2), 20.0F);
  for (std::size_t i = 0; i < 2; ++i) {
    const auto pixels = data.inputs[i].as<std::uint8_t>();
    for (std::size_t at = 0; at < pixels.size(); ++at) {
      const double x = static_cast<double>(at % 64), y = static_cast<double>(at / 64);
      pixels[at] = static_cast<std::uint8_t>(128 + 100 * std::sin(0.5 * x) * std::sin(0.4 * y));
    }
  }
  EXPECT_EQ(tracking.ops_of(data), kPyramids + 3 * (kWindow + kStep) + kLook);
  for (std::size_t i = 0; i < 2; ++i) {
    std::ranges::fill(data.inputs[i].as<std::uint8_t>(), std::uint8_t{128});
  }
  EXPECT_EQ(tracking.ops_of(data), kPyramids + 2 * kWindow);
}

// --------------------------------------------------------------------------------------- sequences

/// A workload of one number: the state counts calls, the output is the sum of all inputs so far.
Workload counting(int frames) {
  Workload w;
  w.name = "counting";
  w.frames = frames;
  w.inputs = {{"number", Element::kF64, {1}}};
  w.outputs = {{"sum", Element::kF64, {1}}};
  w.state = StateSpec{.name = "sum", .tensors = {{"sum", Element::kF64, {1}}}};
  w.make_state = [specs = w.state->tensors] { return make_tensors(specs); };
  w.make_data = [](const DataRequest& request) {
    Data data;
    data.inputs.push_back(test::tensor_of<double>({1}, {request.frame + 1.0}));
    return data;
  };
  w.step = [](std::span<Tensor> state, const Data& data) {
    double& sum = state[0].as<double>()[0];
    sum += data.inputs[0].as<double>()[0];
    return vision::only(test::tensor_of<double>({1}, {sum}));
  };
  w.verify = verify_close(0.0);
  return w;
}

std::unique_ptr<Device> fake_device(const std::string& script = "") {
  return make_fake_backend()->open({"fake", {}, "", script});
}

std::vector<double> sums(const std::vector<PlayedFrame>& played) {
  std::vector<double> all;
  for (const PlayedFrame& frame : played) all.push_back(frame.outputs[0].as<double>()[0]);
  return all;
}

TEST(Player, GoesFromFrameToFrameWithTheStateAndBeginsAnew) {
  const Workload workload = counting(3);
  const auto frames = test::sequence_of(workload);
  const auto expected = reference_of(workload, frames);
  const auto device = fake_device();
  Player player(device->prepare(workload, {}), workload, frames);
  for (int repetition = 0; repetition < 3; ++repetition) {
    player.scribble();
    for (int frame = 0; frame < 3; ++frame) {
      player.call();
      player.call();  // commits nothing
      player.next();
    }
    EXPECT_EQ(sums(player.played(expected)), (std::vector<double>{1, 3, 6}));
  }
  player.call();
  player.next();
  player.restart();
  player.scribble();
  player.complete();
  EXPECT_EQ(sums(player.played(expected)), (std::vector<double>{1, 3, 6}));
  EXPECT_EQ(sequence_note(workload), "sequence of 3 frames");
  EXPECT_EQ(sequence_note(find_workload("sobel")), "");
}

TEST(Player, BeginsWithTheStateThatItIsGiven) {
  Workload workload = counting(3);
  const auto frames = test::sequence_of(workload);
  const auto expected = reference_of(workload, frames);
  auto begin = workload.make_state();
  workload.make_state = []() -> std::vector<Tensor> { throw_bad_input("made a second time"); };
  const auto device = fake_device();
  Player player(device->prepare(workload, {}), workload, frames, std::move(begin));
  player.complete();
  EXPECT_EQ(sums(player.played(expected)), (std::vector<double>{1, 3, 6}));
}

TEST(Player, WhatWasNotCalledIsNeverRight) {
  const Workload workload = counting(2);
  const auto frames = test::sequence_of(workload);
  const auto expected = reference_of(workload, frames);
  const auto device = fake_device();
  Player player(device->prepare(workload, {}), workload, frames);
  player.complete();
  EXPECT_TRUE(verify_sequence(workload, player.played(expected)).ok);
  player.scribble();
  player.call();
  const Verdict verdict = verify_sequence(workload, player.played(expected));
  EXPECT_FALSE(verdict.ok);
  EXPECT_THAT(verdict.detail, HasSubstr("frame 2 of 2"));
}

// A measure of the workload: how far the last sum is off, 0.5 at most. By each frame it would fail.
TEST(Judging, AMeasureOverTheSequenceReplacesTheFrames) {
  Workload workload = counting(3);
  const auto frames = test::sequence_of(workload);
  const auto expected = reference_of(workload, frames);
  auto outputs = reference_of(workload, frames);
  outputs[0][0].as<double>()[0] = 100;
  outputs[2][0].as<double>()[0] = 6.25;
  std::vector<PlayedFrame> played;
  for (std::size_t i = 0; i < 3; ++i) played.push_back({&frames[i], outputs[i], expected[i]});
  EXPECT_FALSE(verify_sequence(workload, played).ok);
  workload.judge = [](std::span<const PlayedFrame> sequence) {
    const auto last = [](std::span<const Tensor> tensors) { return tensors[0].as<double>()[0]; };
    const double off = std::abs(last(sequence.back().outputs) - last(sequence.back().expected));
    return Verdict{off <= 0.5, off, "the last sum"};
  };
  const Verdict verdict = verify_sequence(workload, played);
  EXPECT_TRUE(verdict.ok);
  EXPECT_EQ(verdict.worst_error, 0.25);
  EXPECT_EQ(verdict.detail, "the last sum");
}

TEST(Sequences, PicturesMoveSteadilyFromFrameToFrame) {
  const auto images = generated_images(1);
  // 0.75 pixels right and 0.5 up a frame: after 4 frames whole pixels, 3 and 2.
  const Picture first = images->gray_frame(0, 0, 64, 48);
  const Picture fifth = images->gray_frame(0, 4, 64, 48);
  const auto from = first.pixels.as<std::uint8_t>();
  const auto to = fifth.pixels.as<std::uint8_t>();
  int same = 0;
  for (std::size_t y = 2; y < 46; ++y) {
    for (std::size_t x = 4; x < 60; ++x) same += from[y * 64 + x] == to[(y - 2) * 64 + x + 3];
  }
  EXPECT_EQ(same, 44 * 56);
  EXPECT_TRUE(std::ranges::equal(first.pixels.bytes(), images->gray(0, 64, 48).pixels.bytes()));
}

// ------------------------------------------------------------------------------------ the
// reference

// 100, then 110 twice: the second picture counts half, the third a quarter.
TEST(BackgroundModel, FollowsThePicturesEverMoreSlowly) {
  const auto workload = vision::make_background_model(1, 1);
  auto state = workload.make_state();
  const auto see = [&](std::uint8_t value) {
    Data data;
    data.inputs.push_back(test::tensor_of<std::uint8_t>({1, 1}, {value}));
    return workload.step(state, data)[0].as<std::uint8_t>()[0];
  };
  EXPECT_EQ(see(100), 0) << "nothing differs from what was never seen";
  EXPECT_EQ(state[0].as<float>()[0], 100.0F);
  EXPECT_EQ(see(110), 0);
  EXPECT_EQ(state[0].as<float>()[0], 105.0F);
  EXPECT_EQ(see(129), 0) << "24 is not above 24";
  EXPECT_EQ(state[0].as<float>()[0], 111.0F);
  EXPECT_EQ(see(136), 255);
  EXPECT_EQ(state[0].as<float>()[0], 111.0F + 25.0F / 8);
  for (int i = 0; i < 3; ++i) see(0);
  EXPECT_EQ(state[1].as<std::int32_t>()[0], 4);
}

// What the generated pictures are known to have moved by, where the window lies inside. What says
// too little there may be lost, but is not said to be elsewhere.
TEST(TrackFeatures, FindsTheMotionOfThePictures) {
  const auto workload = vision::make_track_features(320, 240);
  const Data data = first_frame(workload);
  const auto outputs = workload.reference(data);
  const auto corners = data.inputs[2].used<float>();
  const auto tracks = outputs[0].used<double>();
  const auto status = outputs[1].used<std::uint8_t>();
  ASSERT_GT(status.size(), 50U);
  std::size_t inside = 0, found = 0, close = 0;
  for (std::size_t i = 0; i < status.size(); ++i) {
    const float x = corners[2 * i], y = corners[2 * i + 1];
    if (x < 40 || x > 279 || y < 40 || y > 199) continue;
    ++inside;
    const double off = std::hypot(tracks[2 * i] - x - 0.75, tracks[2 * i + 1] - y + 0.5);
    found += status[i];
    close += status[i] == 1 && off < 0.15 ? 1 : 0;
  }
  EXPECT_GT(inside, 20U);
  // Some that have their gradients at one side: how a window deforms is looked for beside its
  // motion.
  EXPECT_GE(close * 10, found * 8) << close << " of " << found;
  EXPECT_GE(close * 10, inside * 7) << close << " of " << inside;
}

TEST(TrackFeatures, LosesWhatIsOutsideOrSaysNothing) {
  const auto workload = vision::make_track_features(64, 48);
  Data data = first_frame(workload);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> points = {-0.5F, 10, 63.5F, 10, 10, 1e30F, nan, 10, 20, 20};
  std::ranges::copy(points, data.inputs[2].as<float>().begin());
  data.inputs[2].set_rows(5);
  for (std::size_t i = 0; i < 2; ++i) {
    std::ranges::fill(data.inputs[i].as<std::uint8_t>(), std::uint8_t{128});
  }
  const auto outputs = workload.reference(data);
  EXPECT_THAT(outputs[1].used<std::uint8_t>(), testing::Each(0));
  EXPECT_EQ(outputs[0].used<double>()[8], 20.0) << "a lost point stays where it is";
}

// --------------------------------------------------------------------------------- every backend

struct BackendCase {
  const char* name;
  std::unique_ptr<Device> (*open)();
};

std::unique_ptr<Device> open_cpu() { return make_cpu_backend()->open({"cpu", {}, "", ""}); }
std::unique_ptr<Device> open_fake() { return fake_device(); }

class Streams : public testing::TestWithParam<BackendCase> {
 protected:
  void SetUp() override {
    device_ = GetParam().open();
    if (!device_) GTEST_SKIP() << "skipped: no OpenCL device";
  }
  std::unique_ptr<Device> device_;
};

INSTANTIATE_TEST_SUITE_P(Backends, Streams,
                         testing::Values(BackendCase{"cpu", open_cpu},
                                         BackendCase{"opencl", test::open_first_device},
                                         BackendCase{"fake", open_fake}),
                         [](const auto& test) { return test.param.name; });

constexpr std::array<std::pair<int, int>, 9> kSizes = {
    {{1, 1}, {2, 1}, {1, 3}, {7, 5}, {16, 1}, {17, 13}, {64, 48}, {129, 31}, {641, 479}}};

TEST_P(Streams, AgreeOnPicturesOfAnySize) {
  for (const auto& [width, height] : kSizes) {
    for (const auto make : {vision::make_background_model, vision::make_track_features,
                            vision::make_feature_detect}) {
      const Workload workload = make(width, height);
      const Verdict verdict =
          test::play_and_verify(*device_, workload, test::sequence_of(workload));
      EXPECT_TRUE(verdict.ok) << workload.description << ": " << verdict.detail;
    }
  }
}

TEST_P(Streams, AgreeOnListsOfAnyLength) {
  const auto workload = vision::make_track_features(160, 120);
  auto frames = test::sequence_of(workload);
  // Points anywhere, also between pixels, on the border and outside.
  Random random(3);
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    Tensor& points = frames[frame].inputs[2];
    for (std::size_t i = 0; i < 500; ++i) {
      points.as<float>()[2 * i] = static_cast<float>(random.below(1640)) / 10 - 2;
      points.as<float>()[2 * i + 1] = static_cast<float>(random.below(1240)) / 10 - 2;
    }
    points.set_rows(std::array{500, 0, 1, 7}[frame]);
  }
  const Verdict verdict = test::play_and_verify(*device_, workload, frames);
  EXPECT_TRUE(verdict.ok) << verdict.detail;
}

TEST_P(Streams, APictureWithoutCornersGivesAnEmptyList) {
  const auto workload = vision::make_feature_detect(40, 30);
  std::vector<Data> frames(1);
  frames[0].inputs.emplace_back(workload.inputs[0]);
  Player player(device_->prepare(workload, {}), workload, frames);
  player.scribble();
  player.complete();
  EXPECT_EQ(player.played(reference_of(workload, frames))[0].outputs[0].rows(), 0);
}

/// A kernel with its two sets of the state on the host, driven as a runtime does.
struct Driven {
  Driven(Device& device, const Workload& workload)
      : spec(workload),
        kernel(device.prepare(workload, {})),
        outputs(make_tensors(workload.outputs)),
        current(workload.make_state()),
        next(make_tensors(workload.state->tensors)) {}

  void bind(const Data& data) {
    kernel->bind(data.inputs, outputs);
    kernel->bind_state(current, next);
  }
  void call() {
    kernel->upload();
    kernel->execute(2);
    kernel->download();
  }
  void commit() {
    kernel->commit_state();
    std::swap(current, next);
  }
  /// Bytes of the state on the host that is committed.
  [[nodiscard]] std::vector<std::byte> committed() const {
    std::vector<std::byte> all;
    for (const Tensor& tensor : current) {
      all.insert(all.end(), tensor.bytes().begin(), tensor.bytes().end());
    }
    return all;
  }

  const Workload& spec;
  std::unique_ptr<Kernel> kernel;
  std::vector<Tensor> outputs, current, next;
};

std::vector<std::byte> bytes_of(std::span<const Tensor> tensors) {
  std::vector<std::byte> all;
  for (const Tensor& tensor : tensors) {
    all.insert(all.end(), tensor.bytes().begin(), tensor.bytes().end());
  }
  return all;
}

// The state of the reference to the bit, after each commit; calls that are not committed, as one
// that failed is not, leave no trace, neither on the host nor on the device.
TEST_P(Streams, OnlyCommittedCallsChangeTheState) {
  const auto workload = vision::make_background_model(33, 21);
  const auto frames = test::sequence_of(workload);
  Driven driven(*device_, workload);
  driven.bind(frames[0]);
  driven.kernel->upload_state();
  auto expected = workload.make_state();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto before = driven.committed();
    driven.bind(frames[(i + 5) % frames.size()]);
    driven.call();  // of another picture; given up
    EXPECT_EQ(driven.committed(), before);
    driven.bind(frames[i]);
    driven.call();
    EXPECT_EQ(driven.committed(), before);
    const auto outputs = workload.step(expected, frames[i]);
    EXPECT_TRUE(workload.verify(driven.outputs, outputs).ok) << i;
    driven.commit();
    EXPECT_EQ(driven.committed(), bytes_of(expected)) << i;
  }
}

// As when another unit held it meanwhile: the device's copy is old until the state is taken there.
TEST_P(Streams, AStateThatComesFromElsewhereIsTakenToTheDevice) {
  const auto workload = vision::make_background_model(20, 10);
  const auto frames = test::sequence_of(workload);
  Driven driven(*device_, workload);
  driven.bind(frames[0]);
  driven.kernel->upload_state();
  driven.call();
  driven.commit();
  auto expected = workload.make_state();
  for (std::size_t i = 1; i < 4; ++i) {
    const auto ignored = workload.step(expected, frames[i]);
  }
  for (std::size_t i = 0; i < expected.size(); ++i) copy_tensor(expected[i], driven.current[i]);
  driven.bind(frames[4]);
  driven.kernel->upload_state();
  driven.call();
  driven.commit();
  const auto outputs = workload.step(expected, frames[4]);
  EXPECT_TRUE(workload.verify(driven.outputs, outputs).ok);
  EXPECT_EQ(driven.committed(), bytes_of(expected));
}

TEST_P(Streams, WithoutAStateThereIsNothingToBind) {
  const auto workload = vision::make_sobel(8, 8);
  const auto kernel = device_->prepare(workload, {});
  EXPECT_THROW(kernel->bind_state({}, {}), std::logic_error);
}

// Real pictures lose points, repeat themselves and move farther than generated ones.
TEST_P(Streams, AgreeOnRealPictures) {
  PIRT_DATA_OR_SKIP(data, "tum-fr3-office-640x480");
  const auto images = images_from(data);
  for (const auto make : {vision::make_track_features, vision::make_background_model}) {
    const Workload workload = make(640, 480);
    const auto frames = make_sequence(workload, {.seed = 2, .images = images.get()});
    const Verdict verdict = test::play_and_verify(*device_, workload, frames);
    EXPECT_TRUE(verdict.ok) << verdict.detail;
  }
}

}  // namespace
}  // namespace pirt
