// A unit that computes elsewhere: several calls under way, calls that are taken back, a link that
// is lost.
#include "scheduler/runtime/kernel_unit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "tests/support/errors.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

/// Has none, and counts who asks for it.
class CountedMemory final : public TensorMemory {
 public:
  [[nodiscard]] std::shared_ptr<std::byte> take(std::size_t) override {
    ++asked;
    return nullptr;
  }
  [[nodiscard]] bool holds(const std::byte*) const override { return false; }

  int asked = 0;
};

/// What happens elsewhere, as the test wants it.
struct Elsewhere {
  std::mutex mutex;
  std::condition_variable changed;
  int under_way = 0, prepared = 0, devices = 0;
  bool answers = false, reachable = true, opens = true;
  std::string name = "test";
  std::shared_ptr<CountedMemory> memory = nullptr;  ///< Of outputs.

  template <typename Until>
  [[nodiscard]] bool wait(Until until) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, 20s, until);
  }
  template <typename Change>
  void change(Change change) {
    {
      const std::lock_guard lock(mutex);
      change();
    }
    changed.notify_all();
  }
};

class FarKernel : public Kernel {
 public:
  explicit FarKernel(Elsewhere& there) : there_(there) {}
  void bind(std::span<const Tensor>, std::span<Tensor>) override {
    there_.change([this] { unwanted_ = false; });
  }
  std::optional<Nanos> execute(int) override {
    there_.change([this] { ++there_.under_way; });
    bool answered = false;
    const bool ended = there_.wait([&] {
      answered = there_.answers && there_.reachable && !unwanted_;
      return answered || !there_.reachable || unwanted_;
    });
    there_.change([this] { --there_.under_way; });
    if (!ended || !answered) throw_environment("it was not answered; answer it");
    return std::nullopt;
  }
  void give_up() {
    there_.change([this] { unwanted_ = true; });
  }

 private:
  Elsewhere& there_;
  bool unwanted_ = false;
};

class HereDevice : public Device {
 public:
  explicit HereDevice(Elsewhere& there) : there_(there) {
    there_.change([this] { ++there_.devices; });
  }
  ~HereDevice() override {
    there_.change([this] { --there_.devices; });
  }
  HereDevice(const HereDevice&) = delete;
  HereDevice& operator=(const HereDevice&) = delete;
  [[nodiscard]] DeviceInfo info() const override {
    const std::lock_guard lock(there_.mutex);
    return {.name = there_.name, .platform = {}, .version = {}};
  }
  [[nodiscard]] Support supports(const Workload&) const override { return {true, ""}; }
  [[nodiscard]] std::shared_ptr<TensorMemory> output_memory() const override {
    return there_.memory;
  }
  [[nodiscard]] bool is_lost() const override {
    const std::lock_guard lock(there_.mutex);
    return !there_.reachable;
  }

 protected:
  Elsewhere& there_;

 private:
  [[nodiscard]] std::unique_ptr<Kernel> make_kernel(const Workload&,
                                                    std::span<const Tensor>) override {
    there_.change([this] { ++there_.prepared; });
    return std::make_unique<FarKernel>(there_);
  }
};

class FarDevice : public HereDevice, public Remote {
 public:
  using HereDevice::HereDevice;
  [[nodiscard]] bool is_reachable() const override {
    const std::lock_guard lock(there_.mutex);
    return there_.reachable;
  }
  [[nodiscard]] LinkEstimate link() const override { return {from_ms(3), 1e6, 0}; }
  [[nodiscard]] std::uint64_t heard() const override { return 0; }
  [[nodiscard]] Nanos patience() const override { return 1s; }
  void expires_in(Kernel&, Nanos) override {}
  void withdraw(Kernel& kernel) override { dynamic_cast<FarKernel&>(kernel).give_up(); }
};

class TestBackend : public Backend {
 public:
  TestBackend(Elsewhere& there, bool far) : there_(there), far_(far) {}
  [[nodiscard]] std::string_view name() const override { return "test"; }
  [[nodiscard]] std::string_view description() const override { return "a test's"; }
  [[nodiscard]] std::vector<Phase> phases() const override { return {Phase::kExecute}; }
  [[nodiscard]] Probe probe() const override { return {true, "", {}}; }
  [[nodiscard]] Support supports(const Workload&) const override { return {true, ""}; }
  [[nodiscard]] std::unique_ptr<Device> open(const UnitRequest&) const override {
    {
      const std::lock_guard lock(there_.mutex);
      if (!there_.opens) throw_environment("no context");
    }
    if (far_) return std::make_unique<FarDevice>(there_);
    return std::make_unique<HereDevice>(there_);
  }

 private:
  Elsewhere& there_;
  bool far_;
};

class KernelUnitElsewhere : public testing::Test {
 protected:
  KernelUnitElsewhere() { workload_.name = "far"; }
  std::unique_ptr<KernelUnit> open(int lanes, bool far = true, Nanos spin = Nanos(0)) {
    UnitSetup setup{.request = {.unit = "cloud", .cores = {}, .device = {}, .script = {}},
                    .backend = far ? &far_ : &here_,
                    .preparations = {{.workload = &workload_, .sample = sample_}},
                    .prepare_first = false,
                    .lanes = lanes,
                    .spin = spin};
    return std::make_unique<KernelUnit>(std::move(setup), [this](Call& call, CallEnd& end) {
      there_.change([&] { ends_[call.token] = std::move(end); });
    });
  }
  std::unique_ptr<KernelUnit> open_ready(int lanes, bool far = true, Nanos spin = Nanos(0)) {
    auto unit = open(lanes, far, spin);
    EXPECT_TRUE(unit->is_over_start(20s));
    return unit;
  }
  Call& call(std::uint64_t token) {
    Call& call = calls_[token];
    call.workload = &workload_;
    call.token = token;
    return call;
  }
  /// Once it has ended.
  const CallEnd& end_of(std::uint64_t token) {
    EXPECT_TRUE(there_.wait([&] { return ends_.contains(token); }));
    const std::lock_guard lock(there_.mutex);
    return ends_[token];
  }
  const CallEnd& run(KernelUnit& unit, std::uint64_t token) {
    unit.run(call(token));
    return end_of(token);
  }
  [[nodiscard]] bool wait_for_under_way(int number) {
    return there_.wait([&] { return there_.under_way == number; });
  }

  Elsewhere there_;
  Workload workload_;
  std::shared_ptr<const Data> sample_ = std::make_shared<Data>();
  TestBackend far_{there_, true}, here_{there_, false};
  std::map<std::uint64_t, Call> calls_;
  std::map<std::uint64_t, CallEnd> ends_;
};

TEST_F(KernelUnitElsewhere, HasAsManyCallsUnderWayAsLanes) {
  const auto unit = open_ready(3);
  for (std::uint64_t token = 1; token <= 5; ++token) unit->run(call(token));
  ASSERT_TRUE(wait_for_under_way(3));
  EXPECT_EQ(unit->running().size(), 3U);
  EXPECT_EQ(unit->remote()->link().round_trip, from_ms(3));
  there_.change([this] { there_.answers = true; });
  for (std::uint64_t token = 1; token <= 5; ++token) {
    EXPECT_EQ(end_of(token).outcome, Outcome::kCompleted);
    EXPECT_FALSE(end_of(token).excused);
  }
  EXPECT_EQ(there_.prepared, 3) << "a kernel is used by one thread at a time";
}

// A device's memory takes long to have, and the first call of a run need not wait for it.
TEST_F(KernelUnitElsewhere, ItsFirstRunHasItsOutputsWhereLaterOnesHaveThem) {
  there_.memory = std::make_shared<CountedMemory>();
  there_.answers = true;
  const TensorSpec made{.name = "made", .element = Element::kF64, .shape = {4}};
  workload_.outputs = {made, made};
  UnitSetup setup{.request = {.unit = "gpu", .cores = {}, .device = {}, .script = {}},
                  .backend = &here_,
                  .preparations = {{.workload = &workload_, .sample = sample_}}};
  KernelUnit unit(std::move(setup), [](Call&, CallEnd&) {});
  ASSERT_TRUE(unit.is_over_start(20s));
  EXPECT_EQ(there_.memory->asked, 4) << "two outputs, and two sets where both are read and written";
}

TEST_F(KernelUnitElsewhere, OpensALostDeviceAgain) {
  there_.change([this] { there_.reachable = false; });
  const auto unit = open_ready(1, false);
  EXPECT_EQ(run(*unit, 1).outcome, Outcome::kReturned);
  EXPECT_THAT(ends_[1].problem,
              AllOf(HasSubstr("not answered"), HasSubstr("lost, and is opened again")));
  EXPECT_THAT(ends_[1].problem, testing::Not(HasSubstr("answer it"))) << "no remedy any more";
  EXPECT_FALSE(ends_[1].excused) << "who breaks it each time is not asked for any more";
  there_.change([this] { there_.reachable = there_.answers = true; });
  EXPECT_EQ(run(*unit, 2).outcome, Outcome::kCompleted);
  EXPECT_EQ(there_.prepared, 2) << "kernels went with the device";
}

TEST_F(KernelUnitElsewhere, DoesNotTakeAnotherDeviceForALostOne) {
  there_.change([this] { there_.reachable = false; });
  const auto unit = open_ready(1, false);
  there_.change([this] { there_.name = "another"; });
  EXPECT_THAT(run(*unit, 1).problem, testing::HasSubstr("its device is lost"));
  EXPECT_THAT(unit->why_lost(), HasSubstr("another"));
  EXPECT_FALSE(unit->is_reachable());
}

TEST_F(KernelUnitElsewhere, GivesBackAllCallsUntilItHasALostDeviceAgain) {
  there_.change([this] { there_.reachable = false; });
  const auto unit = open_ready(1, false);
  there_.change([this] { there_.opens = false; });
  EXPECT_EQ(run(*unit, 1).outcome, Outcome::kReturned);
  EXPECT_FALSE(ends_[1].excused);
  EXPECT_THAT(ends_[1].problem, testing::HasSubstr("its device is lost"));
  EXPECT_EQ(unit->why_lost(), "no context");
  EXPECT_FALSE(unit->is_reachable());
  unit->open_again();
  EXPECT_EQ(run(*unit, 2).outcome, Outcome::kReturned);
  EXPECT_TRUE(ends_[2].excused) << "it is not this one's fault";
  there_.change([this] { there_.opens = there_.reachable = there_.answers = true; });
  EXPECT_EQ(run(*unit, 3).outcome, Outcome::kReturned) << "nobody has asked it to open";
  unit->open_again();
  EXPECT_EQ(run(*unit, 4).outcome, Outcome::kCompleted);
  EXPECT_TRUE(unit->is_reachable());
}

TEST_F(KernelUnitElsewhere, GivesBackWhatNobodyWantsThereAndThatAlone) {
  const auto unit = open_ready(2);
  unit->run(call(1));
  unit->run(call(2));
  ASSERT_TRUE(wait_for_under_way(2));
  unit->request_stop(call(1));
  EXPECT_EQ(end_of(1).outcome, Outcome::kReturned);
  EXPECT_TRUE(ends_[1].excused);
  EXPECT_EQ(ends_.size(), 1U);
  there_.change([this] { there_.answers = true; });
  EXPECT_EQ(end_of(2).outcome, Outcome::kCompleted);
  // The lane whose call was taken back is as good as new.
  unit->run(call(3));
  unit->run(call(4));
  EXPECT_EQ(end_of(3).outcome, Outcome::kCompleted);
  EXPECT_EQ(end_of(4).outcome, Outcome::kCompleted);
}

TEST_F(KernelUnitElsewhere, GivesBackWhatIsNotWantedBeforeItBegan) {
  for (const bool far : {true, false}) {
    there_.answers = false;
    calls_.clear();
    ends_.clear();
    const auto unit = open_ready(1, far);
    unit->run(call(1));
    ASSERT_TRUE(wait_for_under_way(1));
    unit->run(call(2));
    unit->run(call(3));
    unit->request_stop(call(2));
    there_.change([this] { there_.answers = true; });
    EXPECT_EQ(end_of(3).outcome, Outcome::kCompleted);
    EXPECT_EQ(ends_[1].outcome, Outcome::kCompleted);
    EXPECT_EQ(ends_[2].outcome, Outcome::kReturned);
    EXPECT_TRUE(ends_[2].excused);
  }
}

TEST_F(KernelUnitElsewhere, LetsGoOfItsDeviceWhenACallThatWasGivenUpEndsAfterAll) {
  const auto unit = open_ready(1, false);
  unit->run(call(1));
  ASSERT_TRUE(wait_for_under_way(1));
  EXPECT_TRUE(unit->abandon(unit->running().front()).has_value());
  there_.change([this] { there_.answers = true; });
  EXPECT_TRUE(there_.wait([this] { return there_.devices == 0; }));
  EXPECT_TRUE(ends_.empty());
}

TEST_F(KernelUnitElsewhere, ItsEndWaitsForNoAnswer) {
  auto unit = open_ready(2);
  for (std::uint64_t token = 1; token <= 3; ++token) unit->run(call(token));
  ASSERT_TRUE(wait_for_under_way(2));
  unit.reset();
  EXPECT_EQ(there_.under_way, 0);
  EXPECT_FALSE(ends_.contains(3)) << "it had not begun";
}

TEST_F(KernelUnitElsewhere, WhatIsGivenBackWhileItIsOutOfReachIsExcused) {
  const auto unit = open_ready(1);
  unit->run(call(1));
  ASSERT_TRUE(wait_for_under_way(1));
  there_.change([this] { there_.reachable = false; });
  EXPECT_EQ(end_of(1).outcome, Outcome::kReturned);
  EXPECT_TRUE(ends_[1].excused);
}

TEST_F(KernelUnitElsewhere, CountsWhatItStaysAwakeForTheNextCallWhereItMay) {
  there_.answers = true;
  for (const Nanos spin : {Nanos(0), Nanos(20us)}) {
    const auto unit = open_ready(1, false, spin);
    Nanos awake{0};
    // Now and then a call is there before the unit has looked for one.
    for (std::uint64_t token = 1; token <= 1000 && awake == Nanos(0); ++token) {
      ends_.clear();
      awake += run(*unit, token).awake;
      std::this_thread::sleep_for(100us);
    }
    EXPECT_EQ(awake > Nanos(0), spin > Nanos(0));
  }
}

TEST_F(KernelUnitElsewhere, WhatComputesHereServesOneCallAfterTheOther) {
  const auto unit = open(4, false);
  ASSERT_TRUE(unit->is_over_start(20s));
  EXPECT_THAT(test::bad_input([&] { unit->rethrow_failure(); }),
              AllOf(HasSubstr("4 servers"), HasSubstr("one call after the other")));
}

}  // namespace
}  // namespace pirt
