// `pirt report offload` of a profile whose every figure is known: each workload here and in the
// cloud.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "characterize/profile/store/writer.h"
#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

PhaseRecord row(Phase phase, double ms, const std::vector<std::string>& reasons = {}) {
  PhaseRecord record{.phase = phase,
                     .state = State::kSteady,
                     .provenance = Provenance::kMeasured,
                     .reasons = reasons,
                     .notes = {},
                     .samples = std::vector<Nanos>(20, from_ms(ms))};
  for (std::int32_t i = 0; i < 20; ++i) record.processes.push_back(i / 5);
  return record;
}

/// Of a unit that has no transfers.
CellRecord here(const std::string& workload, const std::string& unit, double ms) {
  CellRecord cell{.workload = workload,
                  .unit = unit,
                  .ops = 1000,
                  .bytes = 1000,
                  .verification = "equal",
                  .phases = {},
                  .energy = {}};
  for (const Phase phase : {Phase::kExecute, Phase::kCall}) cell.phases.push_back(row(phase, ms));
  return cell;
}

struct There {
  double upload = 0, launch = 0, execute = 0, download = 0;
};
CellRecord in_the_cloud(const std::string& workload, const There& ms,
                        const std::vector<std::string>& why_not = {}) {
  CellRecord cell{.workload = workload,
                  .unit = "cloud",
                  .ops = 1000,
                  .bytes = 1000,
                  .verification = "equal",
                  .phases = {},
                  .energy = {}};
  cell.phases = {row(Phase::kUpload, ms.upload, why_not), row(Phase::kLaunch, ms.launch),
                 row(Phase::kExecute, ms.execute), row(Phase::kDownload, ms.download),
                 row(Phase::kCall, ms.upload + ms.launch + ms.execute + ms.download)};
  return cell;
}

/// Of platform host-cloud: 10 W for cpu and opencl, 0.8 W for the radio. fc8 moves 4 x (4096 +
/// 1000) bytes, alexnet 4 x (3 x 227 x 227 + 1000), sobel 1920 x 1080 x (1 + 4).
class Offload : public testing::Test {
 protected:
  Offload() {
    ProfileWriter writer(profile_);
    RunHeader header{.started = "2026-01-02T03:04:05Z",
                     .platform = "host-cloud",
                     .seed = 1,
                     .environment = {{"cpu_model", "test cpu"}},
                     .units = {}};
    for (const char* unit : {"cpu", "opencl", "cloud"}) {
      header.units.push_back({unit, unit, "test", true, {}});
    }
    const auto run = writer.begin_run(header);
    writer.write_cell(run, here("fc8", "cpu", 10));
    writer.write_cell(run, in_the_cloud("fc8", {2, 1, 3, 1}));
    writer.write_cell(run, here("alexnet", "cpu", 100));
    writer.write_cell(run, here("alexnet", "opencl", 80));
    writer.write_cell(run, in_the_cloud("alexnet", {20, 2, 30, 1}));
    writer.write_cell(run, here("sobel", "cpu", 1));
    writer.write_cell(run, in_the_cloud("sobel", {4, 1, 1, 4}));
    writer.write_cell(run, here("conv5", "cpu", 10));
    writer.write_cell(run, in_the_cloud("conv5", {1, 1, 1, 1}, {"contended"}));
    writer.write_cell(run, here("pool5", "cpu", 1));
    writer.finish_run(run, "2026-01-02T03:05:00Z");
  }

  Scratch scratch_;
  std::string profile_ = scratch_.file("p.db");
};

TEST_F(Offload, ComparesEachWorkloadHereAndInTheCloud) {
  const auto report = pirt({"report", "offload", profile_, "--json", "-"});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  const auto made = report.json();
  std::map<std::string, nlohmann::json> rows;
  for (const auto& each : made["offload"]) rows[each["workload"]] = each;
  ASSERT_EQ(rows.size(), 3U);

  // 10 ms here, 7 there, of which 3 move the bytes: those may take 6. 100 mJ are 0.125 s of radio.
  const auto& fc8 = rows["fc8"];
  EXPECT_EQ(fc8["fastest"]["unit"], "cpu");
  EXPECT_DOUBLE_EQ(fc8["fastest"]["ms"], 10);
  EXPECT_DOUBLE_EQ(fc8["cloud"]["ms"], 7);
  EXPECT_DOUBLE_EQ(fc8["cloud"]["worst_ms"], 7);
  EXPECT_EQ(fc8["cloud"]["time_provenance"], "measured");
  EXPECT_EQ(fc8["bytes"], 20'384);
  EXPECT_EQ(fc8["by_time"], "cloud");
  EXPECT_DOUBLE_EQ(fc8["break_even_time_mbit_s"], 20'384 * 8e-6 / 0.006);
  EXPECT_EQ(fc8["frugal"]["unit"], "cpu");
  EXPECT_DOUBLE_EQ(fc8["frugal"]["energy_j"], 0.1);
  EXPECT_DOUBLE_EQ(fc8["cloud"]["energy_j"], 0.8 * 0.003);
  EXPECT_EQ(fc8["cloud"]["energy_provenance"], "modelled");
  EXPECT_EQ(fc8["by_energy"], "cloud");
  EXPECT_DOUBLE_EQ(fc8["break_even_energy_mbit_s"], 20'384 * 8e-6 / 0.125);

  // 80 ms on opencl, which takes the least joules, too; 32 there besides 21 for the bytes.
  const auto& alexnet = rows["alexnet"];
  EXPECT_EQ(alexnet["fastest"]["unit"], "opencl");
  EXPECT_EQ(alexnet["frugal"]["unit"], "opencl");
  EXPECT_DOUBLE_EQ(alexnet["cloud"]["ms"], 53);
  EXPECT_EQ(alexnet["bytes"], 622'348);
  EXPECT_NEAR(alexnet["break_even_time_mbit_s"], 622'348 * 8e-6 / 0.048, 1e-9);
  EXPECT_NEAR(alexnet["cloud"]["energy_j"], 0.8 * 0.021, 1e-12);
  EXPECT_DOUBLE_EQ(alexnet["break_even_energy_mbit_s"], 622'348 * 8e-6);

  // 1 ms here, 2 there whatever the bandwidth; 10 mJ here are 12.5 ms of radio, and 8 it takes.
  const auto& sobel = rows["sobel"];
  EXPECT_EQ(sobel["bytes"], 10'368'000);
  EXPECT_DOUBLE_EQ(sobel["break_even_energy_mbit_s"], 10'368'000 * 8e-6 / 0.0125);
  EXPECT_EQ(sobel["by_time"], "local");
  EXPECT_FALSE(sobel.contains("break_even_time_mbit_s"));
  EXPECT_EQ(sobel["by_energy"], "cloud");
  EXPECT_NEAR(sobel["cloud"]["energy_j"], 0.8 * 0.008, 1e-12);

  EXPECT_THAT(made["left_out"],
              ElementsAre("conv5: in the cloud its upload row is invalid (contended)",
                          "pool5: in the cloud not in profile " + profile_));
}

/// Lines of a table with one blank between its columns.
std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines(1);
  for (const char c : text) {
    if (c == '\n') {
      lines.emplace_back();
    } else if (c != ' ' || !lines.back().ends_with(' ')) {
      lines.back() += c;
    }
  }
  return lines;
}

// The paper's behind alexnet's.
TEST_F(Offload, ShowsThePapersRowBesideThem) {
  const auto report = pirt({"report", "offload", profile_});
  ASSERT_EQ(report.exit_code, 0) << report.err;
  const auto lines = lines_of(report.out);
  const auto first = std::ranges::find_if(
      lines, [](const std::string& line) { return line.starts_with("sobel"); });
  ASSERT_NE(first, lines.end()) << report.out;
  const std::vector<std::string> rows(first, first + 4);
  EXPECT_THAT(
      rows,
      ElementsAre("sobel cpu 1.00 10.0 10.0 local none cpu ~10.0 ~6.40 cloud ~6636 10368",
                  "fc8 cpu 10.0 7.00 7.00 cloud ~27.2 cpu ~100 ~2.40 cloud ~1.30 20.4",
                  "alexnet opencl 80.0 53.0 53.0 cloud ~104 opencl ~800 ~16.8 cloud ~4.98 622",
                  "alexnet, the paper GPU (TX1) +33.0 +2000 to 5000 +5000 local - GPU (TX1) +132 "
                  "+10.0 cloud - -"))
      << report.out;
  EXPECT_THAT(
      report.out,
      AllOf(HasSubstr("active_w 0.8 W of cloud x upload and download"),
            HasSubstr("Left out: conv5: in the cloud its upload row is invalid (contended); "
                      "pool5: in the cloud not in profile")));
}

}  // namespace
}  // namespace pirt::test
