// What robots and workers send each other, and what must never get through.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "tests/support/data.h"
#include "workloads/backends/nats/robot/caller.h"
#include "workloads/backends/nats/worker/admission.h"
#include "workloads/backends/nats/worker/attendant.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"
#include "workloads/recognition/scene_workload.h"
#include "workloads/vision/vision.h"

namespace pirt::cloud {
namespace {

using ::testing::HasSubstr;

Workload small_workload() {
  Workload workload;
  workload.name = "small";
  workload.kernel = "small";
  workload.inputs = {{"image", Element::kU8, {4, 6}}, {"points", Element::kF32, {8, 2}, true}};
  workload.parameters = {{"weights", Element::kF32, {5}}};
  workload.outputs = {{"sum", Element::kI32, {1}}};
  return workload;
}

std::vector<Tensor> small_inputs(const Workload& workload) {
  auto inputs = make_tensors(workload.inputs);
  for (std::size_t i = 0; i < 24; ++i)
    inputs[0].as<std::uint8_t>()[i] = static_cast<std::uint8_t>(i);
  inputs[1].set_rows(3);
  inputs[1].used<float>()[5] = 2.5F;
  return inputs;
}

Bytes small_body(const Workload& workload) {
  const Bytes tensors = encode_tensors(small_inputs(workload));
  const Bytes parameters = encode_tensors(make_tensors(workload.parameters));
  TaskBody body{.workload = workload.name, .spec = spec_digest(workload)};
  body.parameters = Blob{digest_of(parameters), parameters.size(), 4096};
  body.tensors = tensors;
  return encode(body);
}

Bytes small_frame(const Workload& workload) {
  return encode(TaskMessage{.task = {1, 2},
                            .send = 3,
                            .time_left = std::chrono::milliseconds(40),
                            .body = small_body(workload)});
}

/// With the checksum that fits.
Bytes sealed(Bytes frame) {
  constexpr std::size_t kHeader = 24;
  if (frame.size() < kHeader) return frame;
  const std::uint64_t length = frame.size() - kHeader;
  std::memcpy(frame.data() + 8, &length, sizeof length);
  const Digest digest = digest_of(ByteView(frame).subspan(kHeader));
  std::memcpy(frame.data() + 16, digest.bytes.data(), 8);
  return frame;
}

TEST(CloudWire, ATaskArrivesAsItWasSent) {
  const Workload workload = small_workload();
  const Bytes frame = small_frame(workload);
  const auto decoded = decode(frame);
  ASSERT_TRUE(decoded.value) << decoded.problem;
  const auto& task = std::get<TaskMessage>(*decoded.value);
  EXPECT_EQ(task.task, (TaskId{1, 2}));
  EXPECT_EQ(task.send, 3U);
  EXPECT_EQ(task.time_left, std::chrono::milliseconds(40));
  const Workload* const known[] = {&workload};
  const auto admitted = Admission(known).admit(std::get<Bytes>(task.body));
  ASSERT_TRUE(admitted.value) << admitted.problem;
  const auto& inputs = admitted.value->inputs;
  EXPECT_EQ(inputs[0].as<std::uint8_t>()[23], 23);
  EXPECT_EQ(inputs[1].rows(), 3);
  EXPECT_EQ(inputs[1].used<float>()[5], 2.5F);
}

TEST(CloudWire, RepliesWithdrawalsAndAnnouncementsArriveAsTheyWereSent) {
  const Bytes outputs{std::byte{1}, std::byte{2}};
  const auto reply = decode(encode(ReplyMessage{.task = {5, 6},
                                                .send = 7,
                                                .kind = ReplyKind::kFailedTry,
                                                .worker = "w1",
                                                .problem = "boom",
                                                .execute = Nanos(8),
                                                .held = Nanos(9),
                                                .outputs = outputs}));
  ASSERT_TRUE(reply.value) << reply.problem;
  const auto& read = std::get<ReplyMessage>(*reply.value);
  EXPECT_EQ(read.kind, ReplyKind::kFailedTry);
  EXPECT_EQ(read.worker + read.problem, "w1boom");
  EXPECT_EQ(read.held, Nanos(9));
  EXPECT_EQ(std::get<Bytes>(read.outputs), outputs);
  const Blob blob{digest_of(outputs), 5'000'000'00, 65'536};
  const auto withdraw = decode(encode(WithdrawMessage{{1, 2}, 3, {blob}}));
  ASSERT_TRUE(withdraw.value) << withdraw.problem;
  EXPECT_EQ(std::get<WithdrawMessage>(*withdraw.value).blobs.at(0), blob);
  const auto hello = decode(encode(AnnouncementMessage{"w", "0.1", 2, {{"sobel", blob.digest}}}));
  ASSERT_TRUE(hello.value) << hello.problem;
  EXPECT_EQ(std::get<AnnouncementMessage>(*hello.value).workloads.at(0).workload, "sobel");
}

TEST(CloudWire, ABlobHasAsManyChunksAsItsBytesNeed) {
  EXPECT_EQ((Blob{{}, 1, 4096}.chunks()), 1U);
  EXPECT_EQ((Blob{{}, 4096, 4096}.chunks()), 1U);
  EXPECT_EQ((Blob{{}, 4097, 4096}.chunks()), 2U);
}

TEST(CloudWire, NamesWhatIsWrongWithAMessage) {
  const Workload workload = small_workload();
  const Bytes good = small_frame(workload);
  EXPECT_THAT(decode(Bytes(3)).problem, HasSubstr("no frame"));
  Bytes other = good;
  other[4] = std::byte{9};
  EXPECT_THAT(decode(other).problem, HasSubstr("protocol 9, and this pirt speaks 1"));
  Bytes damaged = good;
  damaged.back() ^= std::byte{1};
  EXPECT_THAT(decode(damaged).problem, HasSubstr("damaged"));
  Bytes shorter(good.begin(), good.end() - 1);
  EXPECT_FALSE(decode(shorter).problem.empty());
}

TEST(CloudWire, AnotherSpecOfTheSameNameIsRefusedByName) {
  const Workload workload = small_workload();
  Workload other = workload;
  other.inputs[0].shape = {4, 7};
  const Workload* const known[] = {&other};
  EXPECT_THAT(Admission(known).admit(small_body(workload)).problem,
              HasSubstr("small is something else here"));
}

std::vector<std::int64_t> sizes_of(const Workload& workload) { return kind_of(workload).sizes; }

TEST(CloudWire, SizesOfOnesOwnAreMadeWhereTheyArrive) {
  const Workload& sobel = find_workload("sobel");
  const Workload* const known[] = {&sobel, &find_workload("fc8")};
  const Admission admission(known);
  const auto body_of = [](const Workload& workload, std::vector<std::int64_t> sizes) {
    const Bytes tensors = encode_tensors(make_tensors(workload.inputs));
    return encode(TaskBody{.workload = workload.name,
                           .sizes = std::move(sizes),
                           .spec = spec_digest(workload),
                           .tensors = tensors});
  };
  const Workload own = vision::make_sobel(320, 200);
  EXPECT_EQ(sizes_of(own), (std::vector<std::int64_t>{320, 200}));
  const auto made = admission.admit(body_of(own, sizes_of(own)));
  ASSERT_TRUE(made.value) << made.problem;
  EXPECT_EQ(made.value->inputs[0].spec().shape, (std::vector<std::int64_t>{200, 320}));
  EXPECT_EQ(admission.admit(body_of(own, sizes_of(own))).value->workload, made.value->workload)
      << "a kernel may know it";
  EXPECT_EQ(admission.admit(body_of(sobel, sizes_of(sobel))).value->workload, &sobel);
  const auto problem = [&](const Workload& workload, std::vector<std::int64_t> sizes) {
    return admission.admit(body_of(workload, std::move(sizes))).problem;
  };
  EXPECT_THAT(problem(own, {}), HasSubstr("something else here"));
  EXPECT_THAT(problem(own, {200, 320}), HasSubstr("something else here"));
  EXPECT_THAT(problem(own, {320}), HasSubstr("no number of images"));
  EXPECT_THAT(problem(own, {8}), HasSubstr("made in one size only"));
  EXPECT_THAT(problem(own, {320, 200, 1}), HasSubstr("no sizes of a picture"));
  EXPECT_THAT(problem(own, {-320, 200}), HasSubstr("no sizes of a picture"));
  EXPECT_THAT(problem(own, {16384, 16384}), HasSubstr("no sizes of a picture"));
  EXPECT_THAT(problem(vision::make_gaussian_blur(320, 200), {320, 200}),
              HasSubstr("unknown workload"));
  std::string last;
  for (int width = 64; width < 64 + 65; ++width) {
    const Workload each = vision::make_sobel(width, 64);
    last = problem(each, sizes_of(each));
  }
  EXPECT_THAT(last, HasSubstr("other sizes are known already"));
}

TEST(CloudWire, ScenesAreDescribedByTheSameModelsInAnySize) {
  PIRT_DATA_OR_SKIP(folder, "yolo-fastest-1.1");
  recognition::ModelOptions detector{folder / "yolo-fastest-1.1.weights",
                                     folder / "yolo-fastest-1.1.cfg"};
  const auto describe = [&](int width, int height) {
    return recognition::make_describe({.detector = detector}, width, height);
  };
  const Workload here = describe(640, 480);
  const Workload* const known[] = {&here};
  const Admission admission(known);
  const auto admit = [&](const Workload& workload) {
    auto inputs = make_tensors(workload.inputs);
    recognition::set_text(inputs[1], "17");
    const Bytes tensors = encode_tensors(inputs);
    const Kind kind = kind_of(workload);
    return admission.admit(encode(TaskBody{.workload = kind.name,
                                           .sizes = kind.sizes,
                                           .spec = spec_digest(workload),
                                           .tensors = tensors}));
  };
  const Workload own = describe(320, 240);
  const auto admitted = admit(own);
  ASSERT_TRUE(admitted.value) << admitted.problem;
  EXPECT_EQ(admitted.value->inputs[0].spec(), own.inputs[0]);
  EXPECT_EQ(recognition::text_of(admitted.value->inputs[1]), "17");
  EXPECT_EQ(kind_of(own).known_by, admission.known().at(0).spec);
  // Other names of the classes are other models.
  detector.names = folder / "coco.names";
  const Workload named = describe(320, 240);
  EXPECT_NE(kind_of(named).known_by, admission.known().at(0).spec);
  EXPECT_THAT(admit(named).problem, HasSubstr("other models"));
}

TEST(CloudWire, ABatchTravelsAsItsLayerAndTheNumberOfImages) {
  const Workload* const known[] = {&find_workload("fc8"), &find_workload("alexnet")};
  const Admission admission(known);
  for (const char* const name : {"fc8@batch8", "alexnet@batch2"}) {
    const Workload& batch = find_workload(name);
    const Kind kind = kind_of(batch);
    const Bytes tensors = encode_tensors(make_tensors(batch.inputs));
    const auto admitted = admission.admit(encode(TaskBody{.workload = kind.name,
                                                          .sizes = kind.sizes,
                                                          .spec = spec_digest(batch),
                                                          .parameters = Blob{{}, 8, 4096},
                                                          .tensors = tensors}));
    ASSERT_TRUE(admitted.value) << admitted.problem;
    EXPECT_EQ(admitted.value->workload->name, name);
    EXPECT_EQ(kind_of(*admitted.value->workload).sizes, kind.sizes) << "to a slot's process";
  }
  EXPECT_EQ(kind_of(find_workload("sobel@map")).name, "sobel@map");
  EXPECT_TRUE(kind_of(find_workload("bundle_adjust")).sizes.empty());
}

TEST(CloudWire, SpecsDifferInWhateverChangesTheResult) {
  const Workload workload = small_workload();
  const Digest spec = spec_digest(workload);
  const auto differs = [&](auto change) {
    Workload other = workload;
    change(other);
    return spec_digest(other) != spec;
  };
  EXPECT_TRUE(differs([](Workload& w) { w.kernel = "other"; }));
  EXPECT_TRUE(differs([](Workload& w) { w.precision = Precision::kInt8; }));
  EXPECT_TRUE(differs([](Workload& w) { w.batch = 8; }));
  EXPECT_TRUE(differs([](Workload& w) { w.inputs[1].varies = false; }));
  EXPECT_TRUE(differs([](Workload& w) { std::swap(w.inputs[0], w.inputs[1]); }));
  EXPECT_FALSE(differs([](Workload& w) { w.description = "another text"; }));
}

/// A message that is no good one: random, cut, longer, or with other bytes in places that mean
/// something; its checksum fits in half of the cases, so that what lies behind it is reached.
class Hostile {
 public:
  Hostile(std::uint64_t seed, Bytes good, std::size_t meaning)
      : random_(seed), good_(std::move(good)), meaning_(meaning) {}

  Bytes next() {
    Bytes bytes = good_;
    switch (random_.below(5)) {
      case 0:
        bytes.resize(random_.below(200));
        for (std::byte& each : bytes) each = static_cast<std::byte>(random_.next());
        return bytes;
      case 1:
        bytes.resize(random_.below(bytes.size()));
        break;
      case 2:
        bytes.insert(bytes.end(), 1 + random_.below(64), std::byte{0x41});
        break;
      case 3: {  // A length, a count, a number of rows that is enormous or negative.
        const std::size_t at = 24 + random_.below(meaning_ - 24 - 8);
        const std::uint64_t value =
            random_.below(2) == 0 ? ~std::uint64_t{0} >> random_.below(40) : random_.next();
        std::memcpy(bytes.data() + at, &value, sizeof value);
        break;
      }
      default:
        for (std::uint64_t i = 0; i <= random_.below(4); ++i) {
          bytes[random_.below(meaning_)] ^= static_cast<std::byte>(1 + random_.below(255));
        }
    }
    return random_.below(2) == 0 ? bytes : sealed(std::move(bytes));
  }

 private:
  Random random_;
  Bytes good_;
  std::size_t meaning_;
};

TEST(CloudWire, TenThousandHostileMessagesRunNothingElseOnAWorker) {
  const Workload workload = small_workload();
  const Workload* const known[] = {&workload};
  const Admission admission(known);
  const Bytes good = small_frame(workload);
  const Bytes tensors = encode_tensors(small_inputs(workload));
  // All bytes before the pixels mean something; 3 rows of 2 floats, a number of rows and 24 pixels
  // end the message.
  const std::size_t pixels = good.size() - (3 * 2 * 4 + 8 + 24);
  Hostile hostile(11, good, pixels);
  int admitted = 0, refused = 0;
  for (int i = 0; i < 10'000; ++i) {
    const Bytes message = hostile.next();
    const auto decoded = decode(message);
    if (!decoded.value) {
      ++refused;
      continue;
    }
    const auto* const task = std::get_if<TaskMessage>(&*decoded.value);
    const auto* const body = task == nullptr ? nullptr : std::get_if<Bytes>(&task->body);
    if (body == nullptr || !admission.admit(*body).value) {
      ++refused;
      continue;
    }
    // What was changed in its id, number, time or the name of its parameters' content, which is
    // checked when they arrive, leaves the same computation.
    const auto read = decode_body(*body);
    ASSERT_TRUE(read.value);
    EXPECT_EQ(read.value->workload, "small");
    EXPECT_EQ(read.value->spec, spec_digest(workload));
    EXPECT_TRUE(std::ranges::equal(read.value->tensors, tensors));
    ++admitted;
  }
  EXPECT_GT(refused, 9000);
  EXPECT_LT(admitted, 1000);
}

TEST(CloudWire, TenThousandHostileMessagesEndNothingAtARobot) {
  const auto outbox = make_memory_outbox(1 << 20);
  CallerActions out;
  Caller caller(*outbox, {}, Nanos(0), out);
  caller.link_up(Nanos(0), out);
  ASSERT_EQ(caller.submit({1, 2}, "", Bytes(8), {}, {}, Nanos(0), out), Caller::Submission::kTaken);
  // Of another task: what only changes the id hits ours in 1 of 2^128 cases.
  const Bytes good = encode(ReplyMessage{.task = {77, 78}, .worker = "w", .outputs = Bytes(16)});
  Hostile hostile(12, good, good.size());
  for (int i = 0; i < 10'000; ++i) {
    const auto decoded = decode(hostile.next());
    if (!decoded.value) continue;
    if (const auto* const reply = std::get_if<ReplyMessage>(&*decoded.value)) {
      caller.replied(*reply, Nanos(i), out);
    }
  }
  for (const CallerAction& action : out) EXPECT_FALSE(std::holds_alternative<TellEnd>(action));
  EXPECT_EQ(caller.live(), 1U);
}

TEST(CloudWire, AReplyThatDoesNotFitLeavesTheOutputsAsTheyWere) {
  const Workload workload = small_workload();
  auto outputs = make_tensors(workload.outputs);
  outputs[0].as<std::int32_t>()[0] = 5;
  const Bytes other = encode_tensors(make_tensors(workload.inputs));
  EXPECT_THAT(decode_tensors_into(other, outputs), HasSubstr("2 tensors, and 1 are expected"));
  EXPECT_EQ(outputs[0].as<std::int32_t>()[0], 5);
}

}  // namespace
}  // namespace pirt::cloud
