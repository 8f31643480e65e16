// The unit of role cloud as whoever drives it sees it: a device whose calls are computed elsewhere.
#include "workloads/backends/nats/nats_backend.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "tests/workloads/backends/nats/nats_server.h"
#include "workloads/catalog/catalog.h"
#include "workloads/model/own_operation.h"
#include "workloads/model/remote.h"

namespace pirt::cloud::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

TEST(CloudUnit, HasNoStatefulWorkloads) {
  const auto backend = make_nats_backend();
  const Support support = backend->supports(find_workload("update_pose"));
  EXPECT_FALSE(support.ok);
  EXPECT_EQ(support.reason, "stateful workloads: unsupported in the cloud");
}

TEST(CloudUnit, NamesTheSettingThatIsWrong) {
  const auto backend = make_nats_backend();
  const auto opening = [&](const std::string& script) {
    return error_of([&] {
      static_cast<void>(
          backend->open({.unit = "cloud", .cores = {}, .device = {}, .script = script}));
    });
  };
  EXPECT_THAT(opening("server: nats://10.1.2.3:4222"), HasSubstr("without TLS"));
  EXPECT_THAT(opening("robot: a.b"), HasSubstr("robot 'a.b' cannot be called that"));
  EXPECT_THAT(opening("serve: x"), HasSubstr("serve"));
  EXPECT_THAT(opening("hedge: soon"), HasSubstr("after p95, or after a time such as 20ms"));
  EXPECT_THAT(opening("hedge: -1ms"), HasSubstr("after p95"));
}

class CloudUnitOnAServer : public ::testing::Test {
 protected:
  void SetUp() override {
    if (nats_server_program().empty()) GTEST_SKIP() << "skipped: nats-server is not installed";
  }
  void start_server() {
    ASSERT_TRUE(server_.start()) << server_.log();
    administer({.server = server_.url()}, {});
  }
  void start_worker() {
    worker_ = std::make_unique<WorkerLink>(worker_options(server_.url()), known_);
  }
  /// Once its server and its worker are heard of.
  std::unique_ptr<Device> open_within_reach(double patience_s = 30) {
    auto device = open(patience_s);
    const auto* const remote = dynamic_cast<const Remote*>(device.get());
    EXPECT_TRUE(eventually([&] { return remote->is_reachable(); })) << device->info().remark;
    return device;
  }
  std::unique_ptr<Device> open(double patience_s = 30) {
    return open_unit(server_.url(), "", patience_s);
  }
  /// Inputs and outputs of a call.
  struct Bound {
    std::vector<Tensor> in, out;
  };
  static Bound bind(Kernel& kernel, const Workload& workload, std::uint8_t tens_of_ms = 0) {
    Bound bound{make_tensors(workload.inputs), make_tensors(workload.outputs)};
    bound.in[0].as<std::uint8_t>()[1] = tens_of_ms;
    bound.in[0].as<std::uint8_t>()[5] = 41;
    kernel.bind(bound.in, bound.out);
    return bound;
  }

  NatsServer server_;
  static Workload wide() {
    Workload workload = adding("wide", 1000);
    workload.outputs[0].shape = {3'000'000};
    return workload;
  }

  Workload small_ = adding("small", 1000), large_ = adding("large", 3'000'000),
           weighed_ = adding("weighed", 100, 1'500'000);
  Workload big_ = adding("big", 900'000), wide_ = wide();
  std::vector<const Workload*> known_ = {&small_, &large_, &weighed_};
  std::unique_ptr<WorkerLink> worker_;
};

TEST_F(CloudUnitOnAServer, ComputesInPhases) {
  start_server();
  start_worker();
  const auto device = open_within_reach();
  EXPECT_EQ(device->info().remark, "");
  for (const Workload* each : known_) {
    auto parameters = make_tensors(each->parameters);
    for (Tensor& tensor : parameters) tensor.as<std::uint8_t>()[0] = 1;
    const auto kernel = device->prepare(*each, parameters);
    const Bound bound = bind(*kernel, *each, 3);
    for (int call = 0; call < 2; ++call) {
      bound.out[0].share().as<std::uint8_t>()[5] = 0;
      kernel->upload();
      const auto begin = MachineClock().now();
      const auto launch = kernel->execute(1);
      const Nanos took = MachineClock().now() - begin;
      ASSERT_TRUE(launch.has_value());
      // On a busy machine it had begun before the upload was known to be over.
      EXPECT_LE(*launch, std::max<Nanos>(took - 25ms, 0ms))
          << "the worker computed for 30 ms, " << each->name;
      kernel->download();
      EXPECT_EQ(bound.out[0].as<std::uint8_t>()[5], each == &weighed_ ? 43 : 42) << each->name;
    }
    // As whoever measures batches calls them.
    static_cast<void>(kernel->execute(2));
    kernel->upload();
    kernel->upload();
    static_cast<void>(kernel->execute(1));
    kernel->download();
    kernel->download();
    EXPECT_EQ(bound.out[0].as<std::uint8_t>()[5], each == &weighed_ ? 43 : 42) << each->name;
    kernel->unbind();
  }
}

TEST_F(CloudUnitOnAServer, IsWithinReachOnceServerAndWorkerAre) {
  const auto device = open();
  const auto* const remote = dynamic_cast<const Remote*>(device.get());
  ASSERT_NE(remote, nullptr);
  EXPECT_FALSE(remote->is_reachable());
  EXPECT_THAT(device->info().remark, HasSubstr("no connection to server " + server_.url()));
  EXPECT_THAT(error_of([&] { static_cast<void>(device->prepare(small_, {})); }),
              HasSubstr("start one (nats-server -js), or name another"));
  start_server();
  const std::string remedy = "start one (pirt cloud-worker --server";
  EXPECT_TRUE(eventually([&] { return device->info().remark.find(remedy) != std::string::npos; }))
      << device->info().remark;
  EXPECT_FALSE(remote->is_reachable()) << "nobody computes";
  start_worker();
  ASSERT_TRUE(eventually([&] { return remote->is_reachable(); }));
  const auto kernel = device->prepare(small_, {});
  const Bound bound = bind(*kernel, small_);
  kernel->upload();
  server_.kill();
  EXPECT_TRUE(eventually([&] { return !remote->is_reachable(); }));
  ASSERT_TRUE(server_.start()) << server_.log();
  static_cast<void>(kernel->execute(1));
  kernel->download();
  EXPECT_EQ(bound.out[0].as<std::uint8_t>()[5], 42);
}

TEST_F(CloudUnitOnAServer, GivesACallBackThatNobodyAnswersForTooLong) {
  start_server();
  start_worker();
  const auto device = open_within_reach(0.5);
  const auto kernel = device->prepare(small_, {});
  const Bound bound = bind(*kernel, small_, 200);
  kernel->upload();
  server_.kill();
  const std::string why = error_of([&] { static_cast<void>(kernel->execute(1)); });
  EXPECT_THAT(why, HasSubstr("small was not answered: no connection to server"));
}

TEST_F(CloudUnitOnAServer, NamesAStreamThatIsGoneAndGoesOnWithAnother) {
  start_server();
  start_worker();
  const auto device = open_within_reach();
  const auto* const remote = dynamic_cast<const Remote*>(device.get());
  const auto kernel = device->prepare(large_, {});
  Connection admin({.server = server_.url()}, {});
  ASSERT_TRUE(admin.wait_until_up(30s));
  ASSERT_TRUE(admin.request("$JS.API.STREAM.DELETE.PIRT_robot", {}).came);
  EXPECT_THAT(call_and_check(*kernel, large_, {.value = 3}),
              HasSubstr("run `pirt cloud-admin setup --robots robot`"));
  EXPECT_TRUE(eventually([&] { return !remote->is_reachable(); }));
  EXPECT_THAT(device->info().remark, HasSubstr("no stream for robot 'robot'"));
  set_up(admin, {});
  EXPECT_TRUE(eventually([&] { return remote->is_reachable(); })) << device->info().remark;
  EXPECT_EQ(call_and_check(*kernel, large_, {.value = 3}), "");
}

// What is sent fits into messages.
TEST_F(CloudUnitOnAServer, NamesAStreamThatIsGoneWhereAWorkerNeedsIt) {
  known_.push_back(&wide_);
  start_server();
  start_worker();
  const auto device = open_within_reach();
  const auto* const remote = dynamic_cast<const Remote*>(device.get());
  const auto kernel = device->prepare(wide_, {});
  Connection admin({.server = server_.url()}, {});
  ASSERT_TRUE(admin.wait_until_up(30s));
  ASSERT_TRUE(admin.request("$JS.API.STREAM.DELETE.PIRT_robot", {}).came);
  std::string problem = "no end";
  std::jthread call([&] { problem = call_and_check(*kernel, wide_, {.value = 3}); });
  EXPECT_TRUE(eventually([&] { return !remote->is_reachable(); }));
  EXPECT_THAT(device->info().remark, HasSubstr("no stream for robot 'robot'"));
  set_up(admin, {});
  call.join();
  EXPECT_EQ(problem, "");
  EXPECT_LT(worker_->counts().taken, 10);
}

TEST_F(CloudUnitOnAServer, CallsThatAreUnderWayLeaveEachOtherRoomOnTheStream) {
  known_.push_back(&big_);
  ASSERT_TRUE(server_.start()) << server_.log();
  administer({.server = server_.url()}, {.robot_bytes = 1 << 20});
  WorkerOptions options = worker_options(server_.url());
  options.limits.slots = 2;
  worker_ = std::make_unique<WorkerLink>(options, known_);
  const auto device = open_unit(server_.url(), "", 0);  // who waits for room waits for a worker
  ASSERT_TRUE(eventually([&] { return dynamic_cast<Remote&>(*device).is_reachable(); }));
  const auto one = device->prepare(big_, {}), other = device->prepare(big_, {});
  std::vector<std::jthread> lanes;
  for (Kernel* kernel : {one.get(), other.get()}) {
    lanes.emplace_back([this, kernel] {
      for (std::uint8_t i = 0; i < 10; ++i) {
        EXPECT_EQ(call_and_check(*kernel, big_, {.value = i}), "");
      }
    });
  }
  lanes.clear();
  EXPECT_EQ(worker_->counts().ended(ReplyKind::kMissing), 0);
  EXPECT_EQ(worker_->counts().ended(ReplyKind::kDone), 20);
}

TEST_F(CloudUnitOnAServer, ACallThatItsFunctionSaysFailedIsComputedOnce) {
  start_server();
  start_worker();
  const auto device = open_within_reach();
  const auto kernel = device->prepare(small_, {});
  const Bound bound = bind(*kernel, small_);
  bound.in[0].share().as<std::uint8_t>()[0] = static_cast<std::uint8_t>(Ask::kFail);
  const auto call = [&] {
    kernel->upload();
    static_cast<void>(kernel->execute(1));
  };
  EXPECT_THROW(call(), CallFailed);
  EXPECT_EQ(worker_->counts().taken, 1);
  EXPECT_EQ(worker_->counts().ended(ReplyKind::kCallFailed), 1);
}

TEST_F(CloudUnitOnAServer, SupportsWhatItsWorkersKnow) {
  start_server();
  start_worker();
  const auto device = open_within_reach();
  EXPECT_TRUE(device->supports(small_).ok);
  const Workload other = adding("small", 10);
  EXPECT_THAT(device->supports(other).reason, HasSubstr("has another small"));
  EXPECT_THAT(error_of([&] { static_cast<void>(device->prepare(other, {})); }),
              HasSubstr("has another small"));
}

}  // namespace
}  // namespace pirt::cloud::test
