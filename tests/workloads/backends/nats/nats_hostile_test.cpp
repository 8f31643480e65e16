// A robot that speaks the protocol by hand, and wants to read, stop or starve a worker: the worker
// stays up, its memory is bounded, other robots are served, and every refusal says why.
#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <deque>
#include <fstream>
#include <thread>

#include "tests/workloads/backends/nats/hostile.h"
#include "tests/workloads/backends/nats/nats_server.h"
#include "workloads/backends/nats/link/stream.h"
#include "workloads/backends/nats/service/computer.h"
#include "workloads/backends/nats/wire/wire.h"
#include "workloads/backends/registry.h"
#include "workloads/base/math/random.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"
#include "workloads/vision/vision.h"

namespace pirt::cloud::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
constexpr Nanos kLong = 30s;
constexpr std::uint64_t kCacheBytes = std::uint64_t{64} << 20;

std::vector<const Workload*> known_workloads() {
  std::vector<const Workload*> all;
  for (const char* name : {"conv3", "conv5", "fc7", "fc8", "gaussian_blur", "optical_flow",
                           "avoid_obstacles", "plan_path", "track_features", "bundle_adjust"}) {
    all.push_back(&find_workload(name));
  }
  for (const vision::Entry& entry : vision::entries()) {
    const Workload& each = find_workload(entry.make(entry.width, entry.height).name);
    if (!each.state && std::ranges::find(all, &each) == all.end()) all.push_back(&each);
  }
  return all;
}

TEST(CloudProcess, IsADeviceSlot) {
  if (std::getenv("PIRT_TEST_DEVICE_SLOT") == nullptr) {
    GTEST_SKIP() << "the body of the processes that compute in other tests";
  }
  const auto known = known_workloads();
  const auto computer = make_device_computer(
      find_backend("cpu"), {.unit = "cpu", .cores = {}, .device = {}, .script = {}}, kCacheBytes);
  serve_computer(*computer, Admission(known, std::uint64_t{512} << 20));
}

/// Whose memory is not the program's.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

/// By hand: it says what it likes.
class HostileRobot {
 public:
  HostileRobot(const std::string& url, std::string name)
      : name_(std::move(name)), connection_({.server = url}, {}) {
    EXPECT_TRUE(connection_.wait_until_up(kLong));
    connection_.subscribe(subject("claim", name_), [this](const Incoming& message) {
      const auto claim = decode_as<ClaimMessage>(message.data);
      const std::lock_guard lock(mutex_);
      worker_ = claim.worker;
      if (waiting_.empty()) return;  // It offers, and gives nothing.
      const TaskMessage task = waiting_.front();
      waiting_.pop_front();
      connection_.publish(task_subject(name_, worker_), encode(task));
    });
    connection_.subscribe(subject("answer", name_), [this](const Incoming& message) {
      auto reply = decode_as<ReplyMessage>(message.data);
      if (reply.kind == ReplyKind::kRunning) return;
      const std::lock_guard lock(mutex_);
      replies_.push_back(std::move(reply));
      changed_.notify_all();
    });
  }

  static TaskMessage task_of(const Workload& workload) {
    return {.kind = kind_of(workload), .spec = spec_digest(workload)};
  }
  /// What becomes of a task that a worker asked for.
  ReplyMessage ask(TaskMessage task) {
    task.task = {1, ++number_};
    std::unique_lock lock(mutex_);
    waiting_.push_back(task);
    for (int i = 0; i < 60; ++i) {
      offer(1, 1);
      const bool came = changed_.wait_for(
          lock, 500ms, [&] { return !replies_.empty() && replies_.back().task == task.task; });
      if (came) return replies_.back();
    }
    ADD_FAILURE() << "no answer";
    return {};
  }
  void offer(std::uint64_t run, std::uint32_t waiting) {
    connection_.publish(subject("offer", name_), encode(OfferMessage{run, waiting}));
  }
  Blob put(std::string_view what, const std::string& name, const Bytes& bytes) {
    const Blob blob{digest_of(bytes), bytes.size(), 512 << 10};
    EXPECT_EQ(
        put_blob(connection_, blob_subject(name_, what, name), blob, bytes, [] { return false; }),
        "");
    return blob;
  }
  Blob put_parameters(const Bytes& bytes) { return put("par", digest_of(bytes).hex(), bytes); }
  /// The name of the next task.
  [[nodiscard]] std::string next_task() const { return TaskId{1, number_ + 1}.hex(); }
  [[nodiscard]] std::uint64_t worker() const {
    const std::lock_guard lock(mutex_);
    return worker_;
  }
  Connection& connection() { return connection_; }

 private:
  std::string name_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<TaskMessage> waiting_;
  std::vector<ReplyMessage> replies_;
  std::uint64_t worker_ = 0, number_ = 0;
  Connection connection_;
};

class CloudHostile : public ::testing::Test {
 protected:
  void SetUp() override {
    if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
    ASSERT_TRUE(server_.start()) << server_.log();
    administer({.server = server_.url()},
               {.robots = {"honest", "hostile"}, .robot_bytes = std::uint64_t{1} << 30});
    ::setenv("PIRT_TEST_DEVICE_SLOT", "1", 1);
    WorkerOptions options = worker_options(server_.url());
    options.make_computer = [] {
      return make_process_computer(
          {.command = {"/proc/self/exe", "--gtest_filter=CloudProcess.IsADeviceSlot"},
           .call_limit = [](const Workload&) { return 60s; }});
    };
    worker_ = std::make_unique<WorkerLink>(options, known_);
    robot_ = std::make_unique<HostileRobot>(server_.url(), "hostile");
    device_ = open_unit(server_.url(), "robot: honest");
    is_served();
  }
  void TearDown() override {
    if (device_ != nullptr) is_served();
    ::unsetenv("PIRT_TEST_DEVICE_SLOT");
  }

  /// Another robot, with a right result.
  void is_served() {
    const Workload& blur = find_workload("gaussian_blur");
    if (kernel_ == nullptr) {
      images_ = generated_images(1);
      kernel_ = device_->prepare(blur, {});
    }
    const Data data = blur.make_data({.seed = 1, .images = images_.get()});
    auto outputs = make_tensors(blur.outputs);
    kernel_->bind(data.inputs, outputs);
    kernel_->upload();
    static_cast<void>(kernel_->execute(1));
    kernel_->download();
    kernel_->unbind();
    const Verdict verdict = blur.verify(outputs, blur.reference(data));
    EXPECT_TRUE(verdict.ok) << verdict.detail;
  }
  /// Of the worker's slot, the youngest child of this process but for the server.
  [[nodiscard]] double slot_mb() const {
    double most = 0;
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
      std::ifstream list(task.path() / "children");
      for (int id = 0; list >> id;) {
        if (id != server_.process()) most = std::max(most, resident_mb(std::to_string(id)));
      }
    }
    return most;
  }
  static Bytes zeros(std::span<const TensorSpec> specs) {
    return encode_tensors(make_tensors(specs));
  }

  NatsServer server_;
  std::vector<const Workload*> known_ = known_workloads();
  std::unique_ptr<WorkerLink> worker_;
  std::unique_ptr<Device> device_;
  std::unique_ptr<ImageSource> images_;
  std::unique_ptr<Kernel> kernel_;
  std::unique_ptr<HostileRobot> robot_;  ///< Goes first.
};

// conv5 has fewer channels than conv3, fc8 fewer rows than fc7: what lies behind is the worker's.
TEST_F(CloudHostile, ReadsNothingWithAnothersParameters) {
  for (const auto& [has, wants] : {std::pair("conv5", "conv3"), std::pair("fc8", "fc7")}) {
    const Workload& right = find_workload(has);
    const Workload& other = find_workload(wants);
    const Blob blob = robot_->put_parameters(zeros(right.parameters));
    TaskMessage task = HostileRobot::task_of(right);
    task.parameters = blob;
    task.inputs.bytes = zeros(right.inputs);
    EXPECT_EQ(robot_->ask(task).kind, ReplyKind::kDone) << "its own: they are known from now on";
    task = HostileRobot::task_of(other);
    task.parameters = blob;
    task.inputs.bytes = zeros(other.inputs);
    ReplyMessage reply = robot_->ask(task);
    EXPECT_EQ(reply.kind, ReplyKind::kRefused);
    EXPECT_THAT(reply.problem, HasSubstr("bytes of parameters"));
    // With a right size in its head, and the same content's name.
    task.parameters->size_bytes = encoded_bytes(other.parameters);
    reply = robot_->ask(task);
    EXPECT_EQ(reply.kind, ReplyKind::kMissing);
    // And as much of something that is no such tensors.
    task.parameters = robot_->put_parameters(Bytes(encoded_bytes(other.parameters)));
    reply = robot_->ask(task);
    EXPECT_EQ(reply.kind, ReplyKind::kRefused);
    EXPECT_THAT(reply.problem, HasSubstr("parameters: 0 tensors, and 2 are expected"));
  }
}

TEST_F(CloudHostile, TakesNoSlotWithNumbersThatAreOutOfRange) {
  const Workload& avoid = find_workload("avoid_obstacles");
  for (const double speed : {1e300, 1e9, -1e9, 101.0, double(INFINITY), double(NAN)}) {
    auto inputs = make_tensors(avoid.inputs);
    inputs[1].as<double>()[2] = 0.05;
    inputs[2].as<double>()[0] = inputs[2].as<double>()[1] = 1e6;
    inputs[2].as<double>()[3] = speed;
    inputs[4].set_rows(0);
    TaskMessage task = HostileRobot::task_of(avoid);
    task.inputs.bytes = encode_tensors(inputs);
    const ReplyMessage reply = robot_->ask(task);
    EXPECT_EQ(reply.kind, ReplyKind::kRefused) << speed;
    EXPECT_THAT(reply.problem, HasSubstr("avoid_obstacles: robot f64[5]")) << speed;
  }
}

/// Numbers of every kind in every input: whatever comes of it, it comes, and in time.
TEST_F(CloudHostile, MayPutAnyNumbersIntoItsInputs) {
  Random random(7);
  const double values[] = {0, -1, 1, 1e-300, 99, -99, 1e5, -1e5, 1e7, 1e30, 1e300, -1e300};
  int answered = 0;
  for (const char* name : {"avoid_obstacles", "plan_path", "track_features", "bundle_adjust"}) {
    const Workload& workload = find_workload(name);
    for (int i = 0; i < 30; ++i) {
      auto inputs = make_tensors(workload.inputs);
      for (Tensor& tensor : inputs) {
        if (tensor.spec().varies) {
          tensor.set_rows(static_cast<std::int64_t>(random.below(
              1 + static_cast<std::uint64_t>(std::min<std::int64_t>(tensor.dim(0), 50)))));
        }
        const auto value = [&] {
          const double any = values[random.below(std::size(values))];
          const auto& ranges = tensor.spec().ranges;
          return ranges.empty() || random.below(20) == 0
                     ? any
                     : std::clamp(any, ranges[0].low, ranges[0].high);
        };
        switch (tensor.spec().element) {
          case Element::kI32:
            for (auto& each : tensor.used<std::int32_t>()) {
              each = static_cast<std::int32_t>(std::clamp(value(), -2e9, 2e9));
            }
            break;
          case Element::kF32:
            for (auto& each : tensor.used<float>()) each = static_cast<float>(value());
            break;
          case Element::kF64:
            for (auto& each : tensor.used<double>()) each = value();
            break;
          default:
            for (auto& each : tensor.used<std::uint8_t>()) {
              each = static_cast<std::uint8_t>(random.below(3));
            }
        }
      }
      TaskMessage task = HostileRobot::task_of(workload);
      const Bytes bytes = encode_tensors(inputs);
      if (bytes.size() < 900'000) {
        task.inputs.bytes = bytes;
      } else {
        task.inputs.blob = robot_->put("in", robot_->next_task(), bytes);
      }
      const ReplyMessage reply = robot_->ask(task);
      answered += reply.kind == ReplyKind::kDone || !reply.problem.empty();
      EXPECT_EQ(reply.problem.find("its process"), std::string::npos) << name << reply.problem;
    }
  }
  EXPECT_EQ(answered, 120);
}

/// Whatever a kind's maker takes: it is computed, and no process ends.
TEST_F(CloudHostile, MayAskForPicturesOfAnySize) {
  int done = 0;
  for (const vision::Entry& entry : vision::entries()) {
    for (const auto& [width, height] :
         {std::pair(64, 64), std::pair(65, 67), std::pair(127, 64), std::pair(64, 16384),
          std::pair(16384, 64), std::pair(1001, 99)}) {
      const Workload workload = entry.make(width, height);
      if (workload.state) continue;
      TaskMessage task = HostileRobot::task_of(workload);
      auto inputs = make_tensors(workload.inputs);
      Random random(5);
      for (auto& each : inputs[0].as<std::uint8_t>())
        each = static_cast<std::uint8_t>(random.next());
      task.inputs.blob = robot_->put("in", robot_->next_task(), encode_tensors(inputs));
      if (!workload.parameters.empty()) {
        task.parameters = robot_->put_parameters(zeros(workload.parameters));
      }
      const ReplyMessage reply = robot_->ask(task);
      EXPECT_EQ(reply.kind, ReplyKind::kDone)
          << workload.name << " " << width << "x" << height << ": " << reply.problem;
      ++done;
    }
  }
  EXPECT_GT(done, 30);
}

TEST_F(CloudHostile, MakesTheWorkerReadNothingThatIsTooLarge) {
  const Workload& blur = find_workload("gaussian_blur");
  const double before = resident_mb("self");
  TaskMessage task = HostileRobot::task_of(blur);
  task.inputs.blob = robot_->put("in", robot_->next_task(), Bytes(std::size_t{200} << 20));
  ReplyMessage reply = robot_->ask(task);
  EXPECT_EQ(reply.kind, ReplyKind::kRefused);
  EXPECT_THAT(reply.problem, HasSubstr("209715200 bytes of inputs"));
  // As much as it says, and nothing of it is there.
  task.inputs.blob = Blob{{}, encoded_bytes(blur.inputs), 32768};
  EXPECT_EQ(robot_->ask(task).kind, ReplyKind::kMissing);
  EXPECT_LT(resident_mb("self"), before + (kSanitized ? 1000 : 100))
      << "the bytes that it sent are gone again";
}

TEST_F(CloudHostile, FillsNoMemoryWithKernels) {
  double most = 0;
  const double before = slot_mb();
  for (int i = 0; i < 8; ++i) {
    const Workload flow = find_workload("optical_flow").at_size(2048, 2048 - 16 * i);
    TaskMessage task = HostileRobot::task_of(flow);
    task.inputs.blob = robot_->put("in", robot_->next_task(), zeros(flow.inputs));
    EXPECT_EQ(robot_->ask(task).kind, ReplyKind::kDone);
    most = std::max(most, slot_mb());
  }
  EXPECT_LT(most, before + (kSanitized ? 3000 : 300)) << "one call's, and 64 MB";
  const Workload huge = find_workload("optical_flow").at_size(8192, 8192);
  const ReplyMessage reply = robot_->ask(HostileRobot::task_of(huge));
  EXPECT_EQ(reply.kind, ReplyKind::kRefused);
  EXPECT_THAT(reply.problem, HasSubstr("MB of tensors, and may have 512 here"));
}

TEST_F(CloudHostile, ClosesNoDoorWithWrongSizes) {
  const auto ask = [&](int width, int height, bool right) {
    const Workload blur = vision::make_gaussian_blur(width, height);
    TaskMessage task = HostileRobot::task_of(blur);
    task.inputs.bytes = zeros(blur.inputs);
    if (!right) task.spec = {};
    return robot_->ask(task);
  };
  for (int i = 0; i < 100; ++i) {
    const ReplyMessage reply = ask(64 + i, 64, false);
    EXPECT_EQ(reply.kind, ReplyKind::kRefused);
    EXPECT_THAT(reply.problem, HasSubstr("is something else here"));
  }
  EXPECT_EQ(ask(320, 240, true).kind, ReplyKind::kDone);
}

// It offers tasks without end, under many names, and gives none.
TEST_F(CloudHostile, HoldsNobodyUpWithEmptyOffers) {
  for (int i = 0; i < 20'000; ++i) {
    robot_->offer(static_cast<std::uint64_t>(i), 1'000'000);
    robot_->connection().publish("pirt.offer.r" + std::to_string(i % 5000),
                                 encode(OfferMessage{static_cast<std::uint64_t>(i), 1}));
  }
  const auto begin = MachineClock().now();
  is_served();
  EXPECT_LT(MachineClock().now() - begin, 60s);
  EXPECT_LT(resident_mb("self"), kSanitized ? 3000 : 600);
}

TEST_F(CloudHostile, FillsNoMemoryWithTasksThatNobodyAskedFor) {
  const Workload& blur = find_workload("gaussian_blur");
  TaskMessage task = HostileRobot::task_of(blur);
  EXPECT_THAT(robot_->ask(task).problem, HasSubstr("0 bytes of inputs"));
  task.inputs.bytes = Bytes(900'000);
  const Bytes frame = encode(task);
  const double before = resident_mb("self");
  double most = 0;
  for (int i = 0; i < 1000; ++i) {
    robot_->connection().publish(task_subject("hostile", robot_->worker()), frame);
    if (i % 50 == 0) most = std::max(most, resident_mb("self"));
  }
  EXPECT_LT(most, before + (kSanitized ? 1000 : 200));
}

// Offers, tasks and withdrawals faster than anybody reads them.
TEST_F(CloudHostile, StarvesNobodyWithAFlood) {
  const Workload& avoid = find_workload("avoid_obstacles");
  TaskMessage task = HostileRobot::task_of(avoid);
  task.inputs.bytes = zeros(avoid.inputs);
  EXPECT_NE(robot_->ask(task).problem, "");
  const Bytes given = encode(task), offer = encode(OfferMessage{1, 1'000'000}),
              cancel = encode(CancelMessage{{1, 1}});
  const std::string to = task_subject("hostile", robot_->worker());
  std::atomic<bool> over = false;
  std::atomic<std::int64_t> said = 0;
  std::jthread flood([&] {
    const RawClient client(server_.port());
    while (!over) {
      for (int i = 0; i < 100; ++i) {
        client.publish("pirt.offer.hostile", offer);
        client.publish("pirt.cancel.hostile", cancel);
      }
      client.publish(to, given);
      said += 201;
    }
  });
  ASSERT_TRUE(eventually([&] { return said > 10'000; }));
  const auto begin = MachineClock().now();
  for (int i = 0; i < 5; ++i) is_served();
  EXPECT_LT(MachineClock().now() - begin, 60s);
  over = true;
}

TEST_F(CloudHostile, HearsNothingOfHeadersOddNamesAndWrongLengths) {
  const RawClient raw(server_.port());
  const std::string offer(text_of(encode(OfferMessage{1, 1})));
  const WorkerCounts before = worker_->counts();
  // Every name that a subject may have, and some that none may.
  for (const char* name :
       {"*", ">", "a.b", "\x1b[2J", "\xff\xfe", "..", "\"'`$(x)", "_INBOX", "PIRT_"}) {
    raw.send(fmt::format("PUB pirt.offer.{} {}\r\n{}\r\n", name, offer.size(), offer));
  }
  const std::string longest(4000, 'a');
  raw.send(fmt::format("PUB pirt.offer.{} {}\r\n{}\r\n", longest, offer.size(), offer));
  raw.flush();
  EXPECT_TRUE(eventually([&] { return worker_->counts().malformed > before.malformed; }));
  for (const char c : worker_->connection().problem())
    EXPECT_TRUE(c >= ' ' && c <= '~') << worker_->connection().problem();
  // Headers as large as a message may be: an offer of another, and a task.
  const std::string head = "NATS/1.0\r\nx: " + std::string(900'000, 'y') + "\r\n\r\n";
  for (const std::string to : {"pirt.offer.other", "pirt.cancel.other"}) {
    raw.send(fmt::format("HPUB {} {} {}\r\n{}{}\r\n", to, head.size(), head.size() + offer.size(),
                         head, offer));
  }
  raw.flush();
  EXPECT_EQ(robot_->worker(), 0U) << "nobody was asked for a task";
  // Whom the server hangs up on: lengths that are not so, and lines that are none.
  for (const char* wrong :
       {"PUB pirt.offer.hostile 999999999999\r\n", "PUB pirt.offer.hostile -1\r\n",
        "PUB pirt.offer. hostile x 4\r\nabcd\r\n", "HPUB x 99 4\r\nabcd\r\n"}) {
    const RawClient another(server_.port());
    another.send(wrong);
    another.flush();
  }
}

TEST_F(CloudHostile, StopsNothingWithTenThousandMutatedMessages) {
  const Workload& avoid = find_workload("avoid_obstacles");
  TaskMessage task = HostileRobot::task_of(avoid);
  task.inputs.bytes = zeros(avoid.inputs);
  EXPECT_NE(robot_->ask(task).problem, "");
  std::vector<std::pair<std::string, Hostile>> all;
  for (const auto& [to, good] :
       {std::pair(task_subject("hostile", robot_->worker()), encode(task)),
        std::pair(std::string("pirt.offer.hostile"), encode(OfferMessage{1, 1})),
        std::pair(std::string("pirt.cancel.hostile"), encode(CancelMessage{{1, 1}})),
        std::pair(task_subject("hostile", robot_->worker()), encode(OfferMessage{1, 0}))}) {
    all.emplace_back(to, Hostile(all.size(), good, std::min<std::size_t>(good.size(), 200)));
  }
  const WorkerCounts before = worker_->counts();
  for (std::size_t i = 0; i < 10'000; ++i) {
    auto& [to, messages] = all[i % all.size()];
    if (i % 100 == 0) robot_->offer(1, 1);  // So that some are asked for.
    robot_->connection().publish(to, messages.next());
  }
  EXPECT_TRUE(eventually([&] { return worker_->counts().malformed > before.malformed + 5000; }))
      << worker_->counts().malformed;
}

}  // namespace
}  // namespace pirt::cloud::test
