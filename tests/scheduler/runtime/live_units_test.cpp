// When a unit is taken for one that hangs. Nobody looks here but the test.
#include "scheduler/runtime/live_units.h"

#include <gtest/gtest.h>

#include <semaphore>
#include <thread>
#include <vector>

#include "tests/scheduler/support.h"
#include "tests/support/optional_backend.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;

class Driver final : public LiveDriver {
 public:
  void ended(UnitId, Call&, CallEnd&) override {}
  void slice_ended(UnitId, Call&) override {}
  [[nodiscard]] std::vector<Preparation> preparations(UnitId) override { return {prepared}; }
  void add_problem(std::string) override {}
  [[nodiscard]] Expectation expected(UnitId, const Call&) override { return {}; }
  void set_unit(UnitId, UnitState) override {}
  void give_up(UnitId, Call&, CallEnd) override { ++given_up; }

  Preparation prepared;
  int given_up = 0;
};

void pass(Nanos time) {
  const MachineClock clock;
  for (const Nanos until = clock.now() + time; clock.now() <= until;) std::this_thread::yield();
}

TEST(LiveUnits, ACallDoesNotRunWhileTheProcessStandsStill) {
  // Static: the call never comes back.
  static std::binary_semaphore begun(0), never(0);
  static Workload workload;
  workload.name = "hangs";
  const auto platform = platform_of("platform: one\nunits: {cpu: {backend: fake, active_w: 1}}\n");
  Driver driver;
  LiveUnits units(platform, {.time_limit = 1ms}, driver);
  driver.prepared = {.workload = &workload, .sample = nullptr, .function = [](auto, auto) {
                       begun.release();
                       never.acquire();
                     }};
  units.open();
  Call& call = *new Call;  // Its unit's for good.
  units.fill(0, call, workload, {}, {}, Nanos(0));
  units.run(0, call);
  begun.acquire();
  pass(2ms);
  const MachineClock clock;
  const Nanos now = clock.now();
  units.look_for_hung(now - 3s);  // As after Ctrl-Z.
  EXPECT_EQ(driver.given_up, 0);
  EXPECT_GE(units.next_overdue(), now + 1ms);
  EXPECT_LE(units.look_every(), 1s);
  pass(2ms);
  units.look_for_hung(clock.now());
  EXPECT_EQ(driver.given_up, 1);
}

// What is elsewhere is looked for more rarely than that.
TEST(LiveUnits, LookForCallsThatHangAsOftenBesideACloud) {
  PIRT_BACKEND_OR_SKIP("nats");
  static Workload workload;
  workload.name = "any";
  const auto platform = platform_of(
      "platform: far\nunits: {cloud: {role: cloud, backend: nats, active_w: 1, "
      "server: \"nats://127.0.0.1:1\"}}\n");
  Driver driver;
  driver.prepared = {.workload = &workload, .sample = nullptr, .function = [](auto, auto) {}};
  LiveUnits units(platform, {.time_limit = 5ms}, driver);
  units.open();
  EXPECT_LE(units.look_every(), 5ms);
}

}  // namespace
}  // namespace pirt::test
