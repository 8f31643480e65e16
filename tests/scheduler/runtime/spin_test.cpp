// How long a unit stays awake, as its platform and its program say: what is counted for it. No test
// looks at how long anything took.
#include "tests/scheduler/runtime/runtime_support.h"

namespace pirt::test {
namespace {

using namespace std::chrono_literals;

/// What a unit with that key has drawn power for beyond what it has computed.
Nanos awake_for(const std::string& key, Nanos spin) {
  const std::string platform =
      "platform: one\nunits: {cpu: {backend: cpu, cores: all, active_w: 1" + key + "}}\n";
  auto options = options_with({own("nothing", 0, [](auto, auto) {})}, platform.c_str());
  options.spin = spin;
  Runtime runtime(std::move(options));
  Nanos awake{0};
  // Now and then a task is there before the unit has looked for one.
  for (int i = 0; i < 1000 && awake == Nanos(0); ++i) {
    runtime.submit("nothing", {}).wait();
    const auto statistics = runtime.statistics();
    awake = statistics.units[0].powered - statistics.units[0].busy;
  }
  return awake;
}

TEST(Spin, IsWhatPlatformAndProgramBothAllow) {
  EXPECT_EQ(awake_for("", 0us), Nanos(0));
  EXPECT_EQ(awake_for(", spin_us: 0", kMostSpin), Nanos(0));
  EXPECT_EQ(awake_for(", spin_us: 5", 0us), Nanos(0));
  EXPECT_GT(awake_for("", kMostSpin), Nanos(0));
  EXPECT_GT(awake_for(", spin_us: 5", kMostSpin), Nanos(0));
}

}  // namespace
}  // namespace pirt::test
