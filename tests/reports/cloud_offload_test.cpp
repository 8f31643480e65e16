// Each workload here or in the cloud: times, joules, and from which bandwidth on.
#include "reports/paper/cloud_offload.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace pirt {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

PhaseRow row(const std::string& workload, const std::string& unit, Phase phase, double ms) {
  PhaseRow row;
  row.platform = "board";
  row.workload = workload;
  row.unit = unit;
  row.phase = phase;
  row.samples = 20;
  row.median = row.mean = row.p95 = row.p99 = from_ms(ms);
  return row;
}

/// fc8 takes 10 ms on the cpu; in the cloud 2 + 1 + 3 + 1 ms, of which 3 ms move its bytes. pool5
/// was not measured in the cloud.
Profile profile() {
  Profile profile;
  profile.path = "p.db";
  profile.runs.emplace_back().platform = "board";
  profile.phases = {
      row("fc8", "cpu", Phase::kExecute, 10),  row("fc8", "cpu", Phase::kCall, 10),
      row("fc8", "cloud", Phase::kUpload, 2),  row("fc8", "cloud", Phase::kLaunch, 1),
      row("fc8", "cloud", Phase::kExecute, 3), row("fc8", "cloud", Phase::kDownload, 1),
      row("fc8", "cloud", Phase::kCall, 7),    row("pool5", "cpu", Phase::kCall, 1)};
  return profile;
}

Platform board(const std::string& cloud, const std::string& more = "") {
  return parse_platform("board.yaml",
                        R"(
platform: board
assumptions: The watts are a test's.
units:
  cpu: {backend: cpu, cores: all, active_w: 10}
  cloud: {role: cloud, )" + cloud +
                            "}\n" + more,
                        {}, 2);
}

/// 4096 values in and 1000 out, 4 bytes each.
constexpr std::int64_t kBytes = 4 * (4096 + 1000);

TEST(CloudOffload, ChargesTheRobotForItsRadioAlone) {
  const auto found = offload_choices(profile(), board("backend: nats, active_w: 0.8"));
  ASSERT_EQ(found.choices.size(), 1U);
  const OffloadChoice& fc8 = found.choices[0];
  EXPECT_EQ(fc8.bytes, kBytes);
  EXPECT_EQ(fc8.cloud.time, from_ms(7));
  EXPECT_EQ(fc8.fixed, from_ms(4)) << "launch and execute";
  EXPECT_DOUBLE_EQ(fc8.cloud.energy_j.value(), 0.8 * 0.003);
  EXPECT_DOUBLE_EQ(fc8.frugal.value().energy_j.value(), 10 * 0.010);
  EXPECT_TRUE(fc8.cloud_is_faster());
  EXPECT_TRUE(fc8.cloud_is_frugal().value());
  // 10 ms here, 4 ms there whatever the bandwidth: the bytes have 6 ms.
  EXPECT_DOUBLE_EQ(fc8.break_even_time().value(), kBytes * 8e-6 / 0.006);
  // 0.1 J at 0.8 W: 125 ms.
  EXPECT_DOUBLE_EQ(fc8.break_even_energy().value(), kBytes * 8e-6 / 0.125);
  EXPECT_THAT(found.left_out, ElementsAre("pool5: in the cloud not in profile p.db"));
}

TEST(CloudOffload, CountsALinkOnceInPlaceOfWhatWasMeasured) {
  // 20 Mbit/s: 8.1536 ms for the bytes; 5 ms of latency each way.
  const auto found = offload_choices(
      profile(), board("backend: nats, active_w: 0.8, link: radio",
                       "links: {radio: {mbit_s: 20, latency_ms: 5, active_w: 2}}\n"));
  const OffloadChoice& fc8 = found.choices.at(0);
  EXPECT_NEAR(to_ms(fc8.cloud.time), 4 + 8.1536 + 10, 1e-4);
  EXPECT_NEAR(to_ms(fc8.fixed), 4 + 10, 1e-9);
  EXPECT_NEAR(fc8.cloud.energy_j.value(), 2 * 0.0081536, 1e-9);
  EXPECT_EQ(fc8.break_even_time(), std::nullopt) << "14 ms are more than 10 by themselves";
}

TEST(CloudOffload, AWorkloadThatTakesItsTimeThereIsNeverFasterThere) {
  Profile slow = profile();
  for (PhaseRow& each : slow.phases) {
    if (each.unit == "cloud" && each.phase == Phase::kExecute) each.median = from_ms(30);
  }
  const auto found = offload_choices(slow, board("backend: nats, active_w: 0.8"));
  EXPECT_FALSE(found.choices.at(0).cloud_is_faster());
  EXPECT_EQ(found.choices.at(0).break_even_time(), std::nullopt);
}

TEST(CloudOffload, TakesWhatAPlatformStatesACall) {
  Profile here = profile();
  std::erase_if(here.phases, [](const PhaseRow& each) { return each.unit == "cloud"; });
  const auto found = offload_choices(here, board("servers: 1", R"(
workloads:
  fc8: {cloud: [{delay_ms: {uniform: [2000, 5000]}}], call_j: {cloud: 0.010}, provenance: published}
)"));
  const OffloadChoice& fc8 = found.choices.at(0);
  EXPECT_EQ(fc8.cloud.time, from_ms(3500));
  EXPECT_EQ(fc8.cloud_worst, from_ms(5000));
  EXPECT_DOUBLE_EQ(fc8.cloud.energy_j.value(), 0.010);
  EXPECT_FALSE(fc8.cloud_is_faster());
  EXPECT_TRUE(fc8.cloud_is_frugal().value());
  EXPECT_EQ(fc8.break_even_time(), std::nullopt);
  EXPECT_EQ(fc8.break_even_energy(), std::nullopt);
}

TEST(CloudOffload, ShowsThePapersRowBesideIt) {
  const Platform platform = board("backend: nats, active_w: 0.8");
  const Table table = offload_table(offload_choices(profile(), platform), platform);
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_THAT(table.rows[0], ElementsAre("fc8", "cpu", "10.0", "7.00", "7.00", "cloud", "~27.2",
                                         "cpu", "~100", "~2.40", "cloud", "~1.30", "20.4"));
  EXPECT_THAT(table.rows[1],
              ElementsAre("alexnet, the paper", "GPU (TX1)", "+33.0", "+2000 to 5000", "+5000",
                          "local", "-", "GPU (TX1)", "+132", "+10.0", "cloud", "-", "-"));
  EXPECT_THAT(table.footnotes,
              AllOf(Contains(HasSubstr("active_w 0.8 W of cloud x upload and download")),
                    Contains("The watts are a test's."), Contains(HasSubstr("Left out: pool5"))));
  const Json json = offload_json(offload_choices(profile(), platform));
  EXPECT_EQ(json.at("offload").size(), 1U);
  EXPECT_EQ(json.at("offload")[0].at("by_energy"), Json("cloud"));
}

TEST(CloudOffload, NeedsACloud) {
  const Platform local = parse_platform(
      "b.yaml", "platform: board\nunits: {cpu: {backend: cpu, cores: all, active_w: 1}}\n", {}, 2);
  EXPECT_THAT(test::bad_input([&] { static_cast<void>(offload_choices(profile(), local)); }),
              AllOf(HasSubstr("role cloud"), HasSubstr("host-cloud")));
}

}  // namespace
}  // namespace pirt
