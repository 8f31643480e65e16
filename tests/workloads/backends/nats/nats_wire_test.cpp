// What robots and workers send each other, and what must never get through.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <limits>
#include <thread>

#include "tests/support/data.h"
#include "tests/support/errors.h"
#include "tests/workloads/backends/nats/hostile.h"
#include "tests/workloads/backends/nats/nats_server.h"
#include "workloads/backends/nats/robot/robot_link.h"
#include "workloads/backends/nats/service/computer.h"
#include "workloads/backends/registry.h"
#include "workloads/catalog/catalog.h"
#include "workloads/model/own_operation.h"
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

constexpr std::uint64_t kRoom = std::uint64_t{1} << 30;

TaskMessage task_of(const Workload& workload, std::span<const Tensor> inputs) {
  return {.kind = kind_of(workload),
          .spec = spec_digest(workload),
          .inputs = {encode_tensors(inputs), {}}};
}

TaskMessage small_task(const Workload& workload) {
  TaskMessage task = task_of(workload, small_inputs(workload));
  const Bytes parameters = encode_tensors(make_tensors(workload.parameters));
  task.task = {1, 2};
  task.send = 3;
  task.time_left = std::chrono::milliseconds(40);
  task.parameters = Blob{digest_of(parameters), parameters.size(), 32768};
  return task;
}

Bytes small_frame(const Workload& workload) { return encode(small_task(workload)); }

/// What is wrong with a frame of such a message.
template <typename Said>
std::string problem_of(const Bytes& frame) {
  return pirt::test::bad_input([&] { static_cast<void>(decode_as<Said>(frame)); });
}

std::string refusal(const Admission& admission, const TaskMessage& task) {
  return pirt::test::bad_input([&] { static_cast<void>(admission.admit(task)); });
}

TEST(CloudWire, ATaskArrivesAsItWasSent) {
  const Workload workload = small_workload();
  const Bytes frame = small_frame(workload);
  const auto task = decode_as<TaskMessage>(frame);
  EXPECT_EQ(task.task, (TaskId{1, 2}));
  EXPECT_EQ(task.send, 3U);
  EXPECT_EQ(task.time_left, std::chrono::milliseconds(40));
  const Workload* const known[] = {&workload};
  const auto admitted = Admission(known, kRoom).admit(task);
  const auto inputs = decode_tensors(task.inputs.bytes, admitted->inputs);
  EXPECT_EQ(inputs[0].as<std::uint8_t>()[23], 23);
  EXPECT_EQ(inputs[1].rows(), 3);
  EXPECT_EQ(inputs[1].used<float>()[5], 2.5F);
}

TEST(CloudWire, RepliesWithdrawalsAndAnnouncementsArriveAsTheyWereSent) {
  const Bytes outputs{std::byte{1}, std::byte{2}};
  const auto read = decode_as<ReplyMessage>(encode(ReplyMessage{.task = {5, 6},
                                                                .send = 7,
                                                                .kind = ReplyKind::kFailedTry,
                                                                .worker = "w1",
                                                                .problem = "boom",
                                                                .execute = Nanos(8),
                                                                .outputs = {outputs, {}}}));
  EXPECT_EQ(read.kind, ReplyKind::kFailedTry);
  EXPECT_EQ(read.worker + read.problem, "w1boom");
  EXPECT_EQ(read.execute, Nanos(8));
  EXPECT_EQ(read.outputs.bytes, outputs);
  const Blob blob{digest_of(outputs), 500'000'000, 65'536};
  TaskMessage large = small_task(small_workload());
  large.inputs = {{}, blob};
  EXPECT_EQ(decode_as<TaskMessage>(encode(large)).inputs.blob, blob);
  EXPECT_EQ(decode_as<CancelMessage>(encode(CancelMessage{{1, 2}})).task, (TaskId{1, 2}));
  EXPECT_EQ(decode_as<OfferMessage>(encode(OfferMessage{3, 4})).waiting, 4U);
  EXPECT_EQ(decode_as<ClaimMessage>(encode(ClaimMessage{3, 4})).worker, 4U);
  EXPECT_EQ(problem_of<ClaimMessage>(encode(OfferMessage{3, 4})), "a message of another kind");
  const auto hello =
      decode_as<HelloMessage>(encode(HelloMessage{7, "w", "0.1", {{"sobel", blob.digest}}}));
  EXPECT_EQ(hello.workloads.at(0).workload, "sobel");
}

TEST(CloudWire, ARepliesKindIsOneThatThereIs) {
  const auto frame = [](int kind) {
    return encode(ReplyMessage{.kind = static_cast<ReplyKind>(kind)});
  };
  for (int kind = 0; kind < 8; ++kind) {
    EXPECT_EQ(decode_as<ReplyMessage>(frame(kind)).kind, static_cast<ReplyKind>(kind));
  }
  EXPECT_EQ(problem_of<ReplyMessage>(frame(8)), "unknown kind 8");
}

// They are shown on terminals, and written into documents.
TEST(CloudWire, TextsThatArriveArePrintable) {
  const auto reply =
      decode_as<ReplyMessage>(encode(ReplyMessage{.worker = "w\x1b[2J\n", .problem = "\xff\xfe"}));
  EXPECT_EQ(reply.worker, "w [2J ");
  EXPECT_EQ(reply.problem, "  ");
}

TEST(CloudWire, DurationsThatArriveAreInRange) {
  const Workload workload = small_workload();
  for (const Nanos time : {Nanos(-1), Nanos::min(), Nanos::max()}) {
    TaskMessage task = small_task(workload);
    task.time_left = time;
    EXPECT_THAT(problem_of<TaskMessage>(encode(task)), HasSubstr("negative, or of years"));
  }
}

TEST(CloudWire, ABlobHasAsManyChunksAsItsBytesNeed) {
  EXPECT_EQ((Blob{{}, 1, 32768}.chunks()), 1U);
  EXPECT_EQ((Blob{{}, 32768, 32768}.chunks()), 1U);
  EXPECT_EQ((Blob{{}, 32769, 32768}.chunks()), 2U);
}

TEST(CloudWire, NamesWhatIsWrongWithAMessage) {
  const Workload workload = small_workload();
  const Bytes good = small_frame(workload);
  EXPECT_THAT(problem_of<TaskMessage>(Bytes(3)), HasSubstr("no frame"));
  Bytes other = good;
  other[4] = std::byte{9};
  EXPECT_THAT(problem_of<TaskMessage>(other), HasSubstr("protocol 9, and this pirt speaks 2"));
  Bytes damaged = good;
  damaged.back() ^= std::byte{1};
  EXPECT_THAT(problem_of<TaskMessage>(damaged), HasSubstr("damaged"));
  Bytes shorter(good.begin(), good.end() - 1);
  EXPECT_FALSE(problem_of<TaskMessage>(shorter).empty());
}

TEST(CloudWire, AnotherSpecOfTheSameNameIsRefusedByName) {
  const Workload workload = small_workload();
  Workload other = workload;
  other.inputs[0].shape = {4, 7};
  const Workload* const known[] = {&other};
  EXPECT_THAT(refusal(Admission(known, kRoom), small_task(workload)),
              HasSubstr("small is something else here"));
}

std::vector<std::int64_t> sizes_of(const Workload& workload) { return kind_of(workload).sizes; }

TEST(CloudWire, SizesOfOnesOwnAreMadeWhereTheyArrive) {
  const Workload& sobel = find_workload("sobel");
  const Workload* const known[] = {&sobel, &find_workload("fc8"), &find_workload("pool5"),
                                   &find_workload("conv1"), &find_workload("conv3")};
  const Admission admission(known, kRoom);
  const auto task = [](const Workload& workload, std::vector<std::int64_t> sizes) {
    TaskMessage message = task_of(workload, make_tensors(workload.inputs));
    message.kind.sizes = std::move(sizes);
    return message;
  };
  const Workload own = vision::make_sobel(320, 200);
  EXPECT_EQ(sizes_of(own), (std::vector<std::int64_t>{320, 200}));
  EXPECT_EQ(admission.admit(task(own, sizes_of(own)))->inputs[0].shape,
            (std::vector<std::int64_t>{200, 320}));
  EXPECT_EQ(admission.admit(task(sobel, sizes_of(sobel))).get(), &sobel);
  const Workload& named = find_workload("pool5@13x13");
  EXPECT_EQ(admission.admit(task(named, sizes_of(named))).get(), &find_workload("pool5"));
  // The pictures of most layers are small.
  const Workload& layer = find_workload("conv3@26x20");
  TaskMessage small = task(layer, sizes_of(layer));
  small.parameters = Blob{{}, encoded_bytes(layer.parameters), 32768};
  EXPECT_EQ(admission.admit(small)->inputs[0].shape, layer.inputs[0].shape);
  const auto problem = [&](const Workload& workload, std::vector<std::int64_t> sizes) {
    return refusal(admission, task(workload, std::move(sizes)));
  };
  EXPECT_THAT(problem(find_workload("conv1@300x300"), {8, 8}), HasSubstr("conv1: "));
  EXPECT_THAT(problem(own, {}), HasSubstr("something else here"));
  EXPECT_THAT(problem(own, {200, 320}), HasSubstr("something else here"));
  EXPECT_THAT(problem(own, {320}), HasSubstr("no number of images"));
  EXPECT_THAT(problem(own, {8}), HasSubstr("made in one size only"));
  EXPECT_THAT(problem(own, {320, 200, 1}), HasSubstr("no sizes of a picture"));
  EXPECT_THAT(problem(own, {-320, 200}), HasSubstr("no sizes of a picture"));
  EXPECT_THAT(problem(own, {16384, 16384}), HasSubstr("no sizes of a picture"));
  EXPECT_THAT(problem(vision::make_gaussian_blur(320, 200), {320, 200}),
              HasSubstr("unknown workload"));
  // However many wrong ones there were, a right one is taken.
  for (int width = 64; width < 64 + 200; ++width) {
    TaskMessage wrong = task(vision::make_sobel(width, 64), {width, 64});
    wrong.spec = {};
    EXPECT_NE(refusal(admission, wrong), "");
  }
  EXPECT_NE(admission.admit(task(own, sizes_of(own))), nullptr);
}

// From the head alone: what is said to be larger, or smaller, is never read.
TEST(CloudWire, SizesFollowFromTheSpec) {
  const Workload workload = small_workload();
  const Workload* const known[] = {&workload};
  const Admission admission(known, kRoom);
  TaskMessage task = small_task(workload);
  ASSERT_NE(admission.admit(task), nullptr);
  const auto refused = [&](auto change) {
    TaskMessage other = task;
    change(other);
    return refusal(admission, other);
  };
  EXPECT_THAT(refused([](TaskMessage& t) {
                t.inputs = {{}, Blob{{}, 600'000'000, 32768}};
              }),
              HasSubstr("600000000 bytes of inputs"));
  EXPECT_THAT(refused([](TaskMessage& t) { t.inputs.bytes.resize(1000); }),
              HasSubstr("1000 bytes of inputs"));
  EXPECT_THAT(refused([](TaskMessage& t) { t.parameters->size_bytes = 600'000'000; }),
              HasSubstr("600000000 bytes of parameters"));
  EXPECT_THAT(refused([](TaskMessage& t) { t.parameters->size_bytes -= 4; }),
              HasSubstr("bytes of parameters"));
  EXPECT_THAT(refused([](TaskMessage& t) { t.parameters.reset(); }), HasSubstr("or none"));
  EXPECT_THAT(refusal(Admission(known, 100), task),
              HasSubstr("MB of tensors, and may have 0 here (pirt cloud-worker --cache-mb)"));
  EXPECT_EQ(admission.known().size(), 1U);
  EXPECT_TRUE(Admission(known, 100).known().empty()) << "no robot gives it what it has no room for";
}

/// Adds a number to bytes.
class AddKernel : public Kernel {
 public:
  explicit AddKernel(int more) : more_(more) {}
  void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
    from_ = inputs[0].as<std::uint8_t>();
    to_ = outputs[0].as<std::uint8_t>();
  }
  std::optional<Nanos> execute(int) override {
    std::ranges::transform(from_, to_.begin(),
                           [this](auto x) { return static_cast<std::uint8_t>(x + more_); });
    return std::nullopt;
  }

 private:
  int more_;
  std::span<const std::uint8_t> from_;
  std::span<std::uint8_t> to_;
};

/// u8[4] -> u8[4], by a kernel of a user's own; all are of one file.
std::shared_ptr<Workload> own_workload(const std::string& name,
                                       std::function<std::unique_ptr<Kernel>()> make) {
  auto operation = std::make_shared<OwnOperation>();
  operation->digest = "one file";
  operation->backends = {"cpu"};
  operation->cpu = [make = std::move(make)](std::span<const Tensor>, int) { return make(); };
  auto workload = std::make_shared<Workload>();
  workload->name = name;
  workload->kernel = kOwnKernel;
  workload->inputs = {{"x", Element::kU8, {4}}};
  workload->outputs = {{"y", Element::kU8, {4}}};
  workload->operation = operation;
  return workload;
}

std::unique_ptr<Computer> cpu_computer(std::uint64_t kept_bytes = kRoom) {
  return make_device_computer(find_backend("cpu"),
                              {.unit = "cpu", .cores = {}, .device = {}, .script = {}}, kept_bytes);
}

ReplyMessage compute(Computer& computer, const std::shared_ptr<Workload>& workload) {
  const TaskMessage task = task_of(*workload, make_tensors(workload->inputs));
  return computer.compute({.robot = "r", .task = task, .workload = workload});
}

// Of one file: the same tensors, the same digest.
TEST(CloudComputer, OwnWorkloadsOfOneFileAreTwo) {
  const auto computer = cpu_computer();
  for (const auto& [name, more] : {std::pair("mine.one", 1), {"mine.two", 2}, {"mine.one", 1}}) {
    const auto workload =
        own_workload(name, [adds = more] { return std::make_unique<AddKernel>(adds); });
    const ReplyMessage reply = compute(*computer, workload);
    const auto outputs = decode_tensors(reply.outputs.bytes, workload->outputs);
    EXPECT_EQ(outputs.at(0).as<std::uint8_t>()[0], more) << name;
  }
}

class FailingKernel : public AddKernel {
 public:
  FailingKernel() : AddKernel(1) {}
  std::optional<Nanos> execute(int) override { throw CallFailed("no plan"); }
};

TEST(CloudComputer, KeepsAKernelWhoseCallFailed) {
  int made = 0;
  const auto workload = own_workload("mine.plan", [&] {
    ++made;
    return std::make_unique<FailingKernel>();
  });
  const auto computer = cpu_computer();
  for (int i = 0; i < 2; ++i) {
    const ReplyMessage reply = compute(*computer, workload);
    EXPECT_EQ(reply.kind, ReplyKind::kCallFailed);
    EXPECT_EQ(reply.problem, "no plan");
    EXPECT_TRUE(reply.outputs.bytes.empty());
  }
  EXPECT_EQ(made, 1);
}

/// Computed by a process that has 40 MB.
class FarKernel : public AddKernel, public OtherProcess {
 public:
  explicit FarKernel(int& alive) : AddKernel(1), alive_(alive) { ++alive_; }
  ~FarKernel() override { --alive_; }
  [[nodiscard]] std::optional<std::int64_t> peak_bytes() const override { return 40 << 20; }
  [[nodiscard]] std::optional<Nanos> processor_time() const override { return std::nullopt; }

 private:
  int& alive_;
};

TEST(CloudComputer, CountsWhatAProgramHasItself) {
  for (const auto& [kept_mb, most] : {std::pair(100U, 2), std::pair(30U, 1)}) {
    int alive = 0;
    const auto computer = cpu_computer(std::uint64_t{kept_mb} << 20);
    for (int i = 0; i < 5; ++i) {
      const auto workload = own_workload("mine." + std::to_string(i),
                                         [&alive] { return std::make_unique<FarKernel>(alive); });
      EXPECT_EQ(compute(*computer, workload).kind, ReplyKind::kDone);
      EXPECT_GE(alive, 1) << "also one that is larger than all of it";
      EXPECT_LE(alive, most);
    }
  }
}

class IdleKernel : public Kernel {
 public:
  void bind(std::span<const Tensor>, std::span<Tensor>) override {}
  std::optional<Nanos> execute(int) override { return std::nullopt; }
};

// What another robot called once does not end it after each of its calls.
TEST(CloudComputer, AProgramLargerThanTheCacheStaysBesideWhatIsSmall) {
  int alive = 0, made = 0;
  const auto computer = cpu_computer(std::uint64_t{30} << 20);
  const auto small = own_workload("mine.small", [] { return std::make_unique<IdleKernel>(); });
  const auto large = own_workload("mine.large", [&] {
    ++made;
    return std::make_unique<FarKernel>(alive);
  });
  for (const auto& workload : {small, large, large, large}) {
    const auto inputs = make_tensors(workload->inputs);
    const Call call{.robot = workload == small ? "b" : "a",
                    .task = task_of(*workload, inputs),
                    .workload = workload};
    EXPECT_EQ(computer->compute(call).kind, ReplyKind::kDone);
  }
  EXPECT_EQ(made, 1);
}

// Points without a return are no numbers: on the robot's units it takes them, too.
TEST(CloudComputer, AnOwnWorkloadTakesAnyNumbersWhereItGivesNoRange) {
  const auto computer = cpu_computer();
  const auto workload = own_workload("mine.icp", [] { return std::make_unique<IdleKernel>(); });
  workload->inputs = {{"cloud", Element::kF32, {4}}};
  auto inputs = make_tensors(workload->inputs);
  inputs[0].as<float>()[1] = std::numeric_limits<float>::quiet_NaN();
  const Call call{.robot = "r", .task = task_of(*workload, inputs), .workload = workload};
  EXPECT_EQ(computer->compute(call).kind, ReplyKind::kDone);
  workload->inputs[0].ranges.push_back({0, 1});
  EXPECT_THAT(pirt::test::bad_input([&] { static_cast<void>(computer->compute(call)); }),
              HasSubstr("mine.icp: cloud f32[4]: "));
}

/// Has room for one kernel, and an input that begins with 99 ends it.
class OneKernelDevice : public Device {
 public:
  [[nodiscard]] DeviceInfo info() const override {
    return {.name = "one", .platform = "one", .version = "1"};
  }
  [[nodiscard]] Support supports(const Workload&) const override { return {true, ""}; }
  [[nodiscard]] bool is_lost() const override { return lost_; }

 private:
  class OneKernel : public AddKernel {
   public:
    explicit OneKernel(OneKernelDevice& device) : AddKernel(1), device_(device) {
      ++device_.kernels_;
    }
    ~OneKernel() override { --device_.kernels_; }
    void bind(std::span<const Tensor> inputs, std::span<Tensor> outputs) override {
      AddKernel::bind(inputs, outputs);
      device_.lost_ = inputs[0].as<std::uint8_t>()[0] == 99;
      if (device_.lost_) throw_environment("CL_OUT_OF_RESOURCES");
    }

   private:
    OneKernelDevice& device_;
  };
  std::unique_ptr<Kernel> make_kernel(const Workload&, std::span<const Tensor>) override {
    if (kernels_ > 0) throw_environment("CL_MEM_OBJECT_ALLOCATION_FAILURE");
    return std::make_unique<OneKernel>(*this);
  }

  int kernels_ = 0;
  bool lost_ = false;
};

class OneKernelBackend : public Backend {
 public:
  [[nodiscard]] std::string_view name() const override { return "one"; }
  [[nodiscard]] std::string_view description() const override { return ""; }
  [[nodiscard]] std::vector<Phase> phases() const override { return {Phase::kCall}; }
  [[nodiscard]] Probe probe() const override { return {true, "", {}}; }
  [[nodiscard]] Support supports(const Workload&) const override { return {true, ""}; }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest&) const override {
    return std::make_unique<OneKernelDevice>();
  }
};

class CloudOneKernel : public ::testing::Test {
 protected:
  ReplyMessage compute(const std::string& name, std::uint8_t first = 0) {
    const auto workload = std::make_shared<const Workload>(test::adding(name, 4));
    auto inputs = make_tensors(workload->inputs);
    inputs[0].as<std::uint8_t>()[0] = first;
    const TaskMessage task = task_of(*workload, inputs);
    return computer_->compute({.robot = robot_, .task = task, .workload = workload});
  }
  const std::string robot_ = "r";
  OneKernelBackend backend_;
  const std::unique_ptr<Computer> computer_ = make_device_computer(
      backend_, {.unit = "one", .cores = {}, .device = {}, .script = {}}, kRoom);
};

// As a GPU whose context a kernel's fault has ended: its process goes, and the next one opens it.
TEST_F(CloudOneKernel, ALostDeviceIsTheEndOfItsProcess) {
  EXPECT_EQ(compute("a").kind, ReplyKind::kDone);
  EXPECT_THROW(compute("a", 99), ProcessGone);
}

// A GPU's memory is not in what is counted.
TEST_F(CloudOneKernel, WhatIsKeptGivesWayToACallThatHasNoRoom) {
  EXPECT_EQ(compute("a").kind, ReplyKind::kDone);
  EXPECT_EQ(compute("b").kind, ReplyKind::kDone);
}

// What it has answered is read, however long this process was stopped meanwhile.
TEST(CloudProcessComputer, ReadsWhatIsThereWhenItsTimeIsOver) {
  ::setenv("PIRT_TEST_SLOT", "1", 1);
  const auto computer = make_process_computer(
      {.command = {"/proc/self/exe", "--gtest_filter=CloudProcess.IsASlot"},
       .call_limit = [](const Workload&) { return std::chrono::milliseconds(1500); }});
  const auto workload = std::make_shared<const Workload>(test::adding("small", 1000));
  const TaskMessage task = task_of(*workload, test::adding_inputs(*workload, {.value = 3}));
  const std::string robot = "r";
  int looks = 0;
  const auto compute = [&](int stopped_at) {
    return computer->compute(
        {.robot = robot, .task = task, .workload = workload, .stop = [&, stopped_at] {
           // All of the call is sent then; it is over its limit, and not yet a pause.
           if (++looks == stopped_at) std::this_thread::sleep_for(std::chrono::milliseconds(1900));
           return false;
         }});
  };
  EXPECT_EQ(compute(-1).kind, ReplyKind::kDone);
  looks = 0;
  EXPECT_EQ(compute(6).kind, ReplyKind::kDone);
  ::unsetenv("PIRT_TEST_SLOT");
}

TEST(CloudWire, ValuesAreInTheirSpecsRanges) {
  Workload workload = small_workload();
  workload.inputs[1].ranges = {{-10, 10}, {0, 5}};
  auto inputs = small_inputs(workload);
  const auto decode = [&] {
    static_cast<void>(decode_tensors(encode_tensors(inputs), workload.inputs));
  };
  const auto problem = [&] { return pirt::test::bad_input(decode); };
  decode();
  inputs[1].used<float>()[2] = -10;
  decode();
  inputs[1].used<float>()[3] = -1;
  EXPECT_THAT(problem(), HasSubstr("points f32[<=8,2]: -1.000000 at 3 is not from 0.0"));
  inputs[1].used<float>()[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(problem(), HasSubstr("at 3"));
  workload.inputs[1].ranges.clear();
  EXPECT_THAT(problem(), HasSubstr("is no number"));
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
  const Admission admission(known, kRoom);
  const auto task = [](const Workload& workload) {
    return task_of(workload, make_tensors(workload.inputs));
  };
  const Workload own = describe(320, 240);
  EXPECT_EQ(admission.admit(task(own))->inputs[0], own.inputs[0]);
  EXPECT_EQ(kind_of(own).known_by, admission.known().at(0).spec);
  // Other names of the classes are other models.
  detector.names = folder / "coco.names";
  const Workload named = describe(320, 240);
  EXPECT_NE(kind_of(named).known_by, admission.known().at(0).spec);
  EXPECT_THAT(refusal(admission, task(named)), HasSubstr("other models"));
}

TEST(CloudWire, ABatchTravelsAsItsLayerAndTheNumberOfImages) {
  const Workload* const known[] = {&find_workload("fc8"), &find_workload("alexnet")};
  const Admission admission(known, kRoom);
  for (const char* const name : {"fc8@batch8", "alexnet@batch2"}) {
    const Workload& batch = find_workload(name);
    TaskMessage task = task_of(batch, make_tensors(batch.inputs));
    task.parameters = Blob{{}, encoded_bytes(batch.parameters), 32768};
    const auto admitted = admission.admit(task);
    EXPECT_EQ(admitted->name, name);
    EXPECT_EQ(kind_of(*admitted).sizes, task.kind.sizes) << "to a slot's process";
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

TEST(CloudWire, TenThousandHostileMessagesRunNothingElseOnAWorker) {
  const Workload workload = small_workload();
  const Workload* const known[] = {&workload};
  const Admission admission(known, kRoom);
  const Bytes good = small_frame(workload);
  const Bytes tensors = encode_tensors(small_inputs(workload));
  // All bytes before the pixels mean something; 3 rows of 2 floats, a number of rows and 24 pixels
  // end the message.
  const std::size_t pixels = good.size() - (3 * 2 * 4 + 8 + 24);
  test::Hostile hostile(11, good, pixels);
  int admitted = 0, refused = 0;
  for (int i = 0; i < 10'000; ++i) {
    const Bytes message = hostile.next();
    try {
      const auto task = decode_as<TaskMessage>(message);
      const auto made = admission.admit(task);
      if (task.inputs.blob) throw_bad_input("its inputs are elsewhere");
      static_cast<void>(decode_tensors(task.inputs.bytes, made->inputs));
      // What was changed in its id, number, time or the name of its parameters' content, which is
      // checked when they arrive, leaves the same computation.
      EXPECT_EQ(made.get(), &workload);
      EXPECT_EQ(task.inputs.bytes, tensors);
      ++admitted;
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 9000);
  EXPECT_LT(admitted, 1000);
}

TEST(CloudWire, TenThousandHostileMessagesEndNothingAtARobot) {
  Caller caller("r", 1, {}, [](const std::string&, const Bytes&) {});
  caller.link_up(Nanos(0));
  const auto progress = caller.submit({.task = {1, 2}}, Nanos(0));
  // Of another task: what only changes the id hits ours in 1 of 2^128 cases.
  const Bytes good =
      encode(ReplyMessage{.task = {77, 78}, .worker = "w", .outputs = {Bytes(16), {}}});
  test::Hostile hostile(12, good, good.size());
  for (int i = 0; i < 10'000; ++i) {
    try {
      caller.replied(decode_as<ReplyMessage>(hostile.next()), Nanos(i));
    } catch (const Error&) {  // No message.
    }
  }
  EXPECT_FALSE(progress->end);
}

TEST(CloudWire, AReplyThatDoesNotFitLeavesTheOutputsAsTheyWere) {
  const Workload workload = small_workload();
  auto outputs = make_tensors(workload.outputs);
  outputs[0].as<std::int32_t>()[0] = 5;
  const Bytes other = encode_tensors(make_tensors(workload.inputs));
  EXPECT_THAT(pirt::test::bad_input([&] { decode_tensors_into(other, outputs); }),
              HasSubstr("2 tensors, and 1 are expected"));
  EXPECT_EQ(outputs[0].as<std::int32_t>()[0], 5);
}

}  // namespace
}  // namespace pirt::cloud
