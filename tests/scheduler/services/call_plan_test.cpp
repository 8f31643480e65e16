// What a call takes, holds and draws, worked out by hand.
#include "scheduler/services/call_plan.h"

#include <gtest/gtest.h>

#include "scheduler/services/draws.h"
#include "scheduler/services/recall.h"
#include "tests/scheduler/profile_rows.h"
#include "tests/scheduler/virtual/virtual_support.h"

namespace pirt::test {
namespace {

using std::chrono::milliseconds;

TEST(CallPlan, CountsLinksContextsAndDataOnItsWay) {
  // 1 MB at 1,000 Mbit/s is 8 ms; latency 1 to 3 ms.
  const auto platform = platform_of(R"(
platform: p
units:
  cpu: {slots: 1}
  gpu: {slots: 1, active_w: 4, link: bus, contexts: {prepare_ms: 20}}
links: {bus: {mbit_s: 1000, active_w: 2, latency_ms: {uniform: [1, 3]}}}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  a:
    closed_loop: {frames: 1}
    tasks:
      - {name: make, service_ms: {cpu: 1}}
      - {name: use, service_ms: {gpu: 5, cpu: 9}, after: [{task: make, bytes: 1000000, transfer_ms: 1}]}
)");
  const Scenario scenario = make_scenario(platform, nullptr, mix, {}, CloudUse::kAll);
  const auto plans = plan_tasks(scenario, 0);
  const CallPlan& use = plans[1].calls[1];
  // The service is the mix's own: nothing to load, and its data comes along the edge.
  EXPECT_EQ(use.takes(Taken::kLeast), milliseconds(5));
  EXPECT_EQ(use.takes(Taken::kMean), milliseconds(5));
  EXPECT_EQ(use.takes(Taken::kUsualWorst), milliseconds(5 + 1 + 8 + 2)) << "at mean latency";
  EXPECT_EQ(use.on(1, Taken::kMean), milliseconds(5));
  EXPECT_EQ(plans[1].calls[0].takes(Taken::kUsualWorst), milliseconds(9)) << "it is there";
  // 5 ms at 4 W, and 8 ms of the bus at 2 W before it.
  EXPECT_NEAR(*use.energy_j(Taken::kMean), 0.020, 1e-12);
  EXPECT_NEAR(use.window_j(), 0.020 + 0.016, 1e-12);
}

TEST(CallPlan, OfACatalogueTaskMovesWhatTheCallMoves) {
  // gaussian_blur on one linked unit: its picture there and back, each time.
  const auto platform = platform_of(R"(
platform: p
units: {gpu: {slots: 1, active_w: 1, link: bus, contexts: {prepare_ms: 20}}}
links: {bus: {mbit_s: 1000, active_w: 3, latency_ms: {uniform: [1, 3]}}}
workloads: {gaussian_blur: {gpu: [{on: gpu, ms: {uniform: [1, 2]}}]}}
)");
  const auto mix = closed(1, "gaussian_blur");
  const Scenario scenario = make_scenario(platform, nullptr, mix, {}, CloudUse::kAll);
  const CallPlan call = plan_tasks(scenario, 0)[0].calls[0];
  const CallBytes bytes = call_bytes(mix.pipelines[0].tasks[0]);
  const Link& bus = platform.links.at("bus");
  const Nanos sending = sending_time(bus, bytes.in) + sending_time(bus, bytes.out);
  EXPECT_EQ(call.takes(Taken::kLeast), sending + milliseconds(2 * 1 + 1));
  EXPECT_EQ(call.takes(Taken::kUsualWorst), sending + milliseconds(2 * 3 + 20 + 2));
  EXPECT_EQ(call.prepares(), milliseconds(20));
  EXPECT_NEAR(*call.energy_j(Taken::kLeast), 0.001 + 3 * to_s(sending), 1e-12);
  // Of any second: all of it, with the program that it loads.
  EXPECT_NEAR(call.window_j(), 0.022 + 3 * to_s(sending), 1e-12);
  const CostTable costs = call_costs(scenario);
  EXPECT_EQ(costs[0][0]->total, call.takes(Taken::kMean));
}

TEST(CallPlan, OfOneThatTakesLongIsItsHandOver) {
  const auto platform = platform_of("platform: p\nunits: {cpu: {slots: 1}}\n");
  const auto mix = mix_of(
      "mix: m\npipelines: {a: {closed_loop: {frames: 1}, tasks: [{name: t, service_ms: {cpu: "
      "1}}]}}\n");
  Scenario scenario = make_scenario(platform, nullptr, mix, {}, CloudUse::kAll);
  scenario.services.units.resize(1);
  scenario.services.units[0].longest_handover = std::chrono::microseconds(100);
  const CallPlan call = plan_tasks(scenario, 0)[0].calls[0];
  EXPECT_EQ(call.takes(Taken::kMean), milliseconds(1));
  EXPECT_EQ(call.takes(Taken::kUsualWorst), std::chrono::microseconds(1100));
  EXPECT_EQ(call.takes(Taken::kWorst), std::chrono::microseconds(1100));
  EXPECT_EQ(call.longest_slice(), std::chrono::microseconds(1100));
}

// Twice as long beside one, three times beside both.
TEST(CallPlan, OfOneThatTakesLongIsBesideAllNeighbours) {
  const auto platform = platform_of(R"(
platform: board
units:
  cpu: {backend: cpu, memory: dram}
  gpu: {backend: cpu, memory: dram, role: gpu}
  dsp: {backend: cpu, memory: dram, role: dsp}
)");
  const auto row = [](int ms) {
    return row_of("gaussian_blur", "cpu", Phase::kExecute, milliseconds(ms));
  };
  Profile profile = profile_of({row(10)});
  profile.conditions = {row(20)};
  profile.conditions[0].condition = Condition::kBesideCompute;
  const auto mix = closed(1, "gaussian_blur");
  const Scenario scenario = make_scenario(platform, &profile, mix, {}, CloudUse::kAll);
  EXPECT_EQ(plan_tasks(scenario, 0)[0].calls[0].takes(Taken::kWorst), milliseconds(30));
}

// a on the cpu and then d, which the cloud alone may serve.
TEST(Recall, CountsWhatTheCloudHasToServeBehindATask) {
  const auto platform = platform_of(R"(
platform: two
units: {cpu: {slots: 1}, cloud: {role: cloud}}
workloads:
  alexnet: {cpu: 400, cloud: [{delay_ms: 20000}]}
  describe_scene: {cloud: [{delay_ms: 3000}]}
)");
  const auto mix = mix_of(R"(
mix: m
pipelines:
  far:
    rate_hz: 0.05
    deadline_ms: 15000
    real_time: false
    tasks:
      - {name: a, workload: alexnet, eligible: [cpu, cloud]}
      - {name: d, workload: describe_scene, eligible: [cloud], after: [a]}
)");
  const Scenario scenario = make_scenario(platform, nullptr, mix, {}, CloudUse::kAll);
  const auto leads = recall_leads(scenario, 0);
  ASSERT_TRUE(leads[0]);
  EXPECT_EQ(leads[0]->before_deadline, milliseconds(3400));
  EXPECT_FALSE(leads[1]);
}

TEST(CallPlan, OwnJoulesAreDrawnOnTheUnitOfTheCall) {
  const auto platform = platform_of(R"(
platform: p
units: {cpu: {active_w: 1}, dsp: {active_w: 1, energy: {call_j: 1}}}
workloads: {sobel: {dsp: [{on: cpu, ms: 5}, {on: dsp, ms: 5}]}}
)");
  const auto mix = closed(1, "sobel");
  const Scenario scenario = make_scenario(platform, nullptr, mix, {}, CloudUse::kAll);
  const CallPlan call = plan_tasks(scenario, 0)[0].calls[1];
  ASSERT_EQ(call.steps.size(), 2U);
  EXPECT_EQ(call.steps[0].own_j, 0) << "another unit works on it";
  EXPECT_EQ(call.steps[1].own_j, 1);
}

TEST(Draws, TheLatencyOfALinkIsDrawn) {
  const auto mix = closed(1, "sobel");
  const auto with_latency = [](const std::string& latency) {
    return platform_of(
        "platform: p\nunits: {gpu: {link: bus}}\nlinks: {bus: {mbit_s: 10, latency_ms: " + latency +
        "}}\nworkloads: {sobel: {gpu: 1}}\n");
  };
  EXPECT_TRUE(draws_times(with_latency("{uniform: [20, 60]}"), mix));
  EXPECT_FALSE(draws_times(with_latency("20"), mix));
}

TEST(CallPlan, LongestSliceIsFromOneTimeThatItCanBeSuspendedToTheNext) {
  static const std::vector<double> slices = {0.25, 0.5, 0.25};
  CallPlan call;
  const auto add = [&call](int ms, bool sliced) {
    CallStep& step = call.steps.emplace_back();
    step.servers = 0;
    step.usual = step.scaled = milliseconds(ms);
    step.time = Distribution::constant(step.scaled);
    if (sliced) step.slices = &slices;
  };
  add(10, false);
  add(40, true);
  add(7, false);
  // 10 + 10, 20, 10 + 7.
  EXPECT_EQ(call.longest_slice(), milliseconds(20));
  call.steps[2].usual = milliseconds(15);
  EXPECT_EQ(call.longest_slice(), milliseconds(25));
}

}  // namespace
}  // namespace pirt::test
