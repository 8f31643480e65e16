// pirt tune as its user runs it: what it stores, who uses it, what is refused. On OpenCL devices,
// where there are any.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// All of a file of one tuned device with these parameters.
std::string tuned(const nlohmann::json& unit, const nlohmann::json& parameters) {
  const bool is_cpu = unit.at("parameters").at(0).at("candidates").at(0) == 8;
  return nlohmann::json{{"schema_version", 1},
                        {"devices",
                         {{{"device", unit.at("device")},
                           {"platform", unit.at("platform")},
                           {"version", unit.at("version")},
                           {"is_cpu", is_cpu},
                           {"pirt_version", "test"},
                           {"date", "2026-01-02T03:04:05Z"},
                           {"parameters", parameters}}}}}
      .dump();
}

class Tune : public testing::Test {
 protected:
  /// The plan for blur's parameter; skips the test where there is no OpenCL device.
  nlohmann::json plan_or_skip() {
    const auto planned = dry_run();
    if (planned.exit_code == 4) return {};
    EXPECT_EQ(planned.exit_code, 0) << planned.err;
    return planned.json()["units"][0];
  }
  Outcome dry_run() const {
    return pirt({"tune", "--platform", "host-opencl", "--filter", "blur", "--dry-run", "--output",
                 file_, "--json", "-"});
  }
  Outcome characterize(const std::string& environment) const {
    return pirt({"characterize", "--quick", "--platform", "host-opencl", "--filter", "^pool5$",
                 "--max-time", "1s", "--db", scratch_.file("p.db"), "--json", "-"},
                environment);
  }
  [[nodiscard]] std::string use() const { return "PIRT_TUNING=" + quoted(file_); }

  Scratch scratch_;
  std::string file_ = scratch_.file("tuning.json");
};

TEST_F(Tune, DryRunShowsWhatWouldBeSearchedAndWritesNothing) {
  const auto unit = plan_or_skip();
  if (unit.is_null()) GTEST_SKIP() << "skipped: no OpenCL device";
  ASSERT_EQ(unit["parameters"].size(), 1U);
  const auto& parameter = unit["parameters"][0];
  EXPECT_EQ(parameter["name"], "blur_strip_rows");
  EXPECT_EQ(parameter["workloads"], nlohmann::json({"gaussian_blur"}));
  EXPECT_EQ(unit["processes"], 3 * parameter["candidates"].size());
  EXPECT_THAT(unit["remarks"].dump(), HasSubstr("local_x")) << "other kernels have it too";
  EXPECT_FALSE(std::filesystem::exists(file_));
}

TEST_F(Tune, StoresWhatItFoundForThisDeviceBesideWhatItKnewOfIt) {
  const auto unit = plan_or_skip();
  if (unit.is_null()) GTEST_SKIP() << "skipped: no OpenCL device";
  scratch_.write("tuning.json", tuned(unit, {{"fc_rows", 2}}));
  const auto outcome = pirt(
      {"tune", "--platform", "host-opencl", "--filter", "blur", "--output", file_, "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto found = outcome.json()["units"][0]["parameters"][0];
  EXPECT_EQ(found["name"], "blur_strip_rows");
  EXPECT_THAT(found["verdict"], testing::AnyOf("replaced", "default_best", "not_confirmed"));
  EXPECT_TRUE(found["rejected"].empty()) << found["rejected"];
  EXPECT_GE(found["rounds"], 3);

  const auto stored = nlohmann::json::parse(slurp(file_));
  ASSERT_EQ(stored["devices"].size(), 1U);
  const auto& entry = stored["devices"][0];
  EXPECT_EQ(entry["device"], unit["device"]);
  EXPECT_EQ(entry["version"], unit["version"]);
  EXPECT_NE(entry["pirt_version"], "test");
  EXPECT_EQ(entry["parameters"]["fc_rows"], 2) << "it was not searched";
  if (found["best"] == found["default"]) {
    EXPECT_FALSE(entry["parameters"].contains("blur_strip_rows"));
  } else {
    EXPECT_EQ(entry["parameters"]["blur_strip_rows"], found["best"]);
  }
}

TEST_F(Tune, ADamagedFileIsRefusedBeforeAnythingIsMeasured) {
  const auto unit = plan_or_skip();
  if (unit.is_null()) GTEST_SKIP() << "skipped: no OpenCL device";
  for (const std::string& text : {std::string("{\"schema_version\": 1, "), std::string(),
                                  tuned(unit, {{"fc_rows", 3}}), tuned(unit, {{"fc_row", 2}})}) {
    scratch_.write("tuning.json", text);
    expect_refused(characterize(use()), {file_, "pirt tune"});
    expect_refused(dry_run(), {file_, "pirt tune"});
    EXPECT_FALSE(std::filesystem::exists(scratch_.file("p.db")));
    EXPECT_EQ(slurp(file_), text) << "it is the user's to mend";
  }
  expect_refused(characterize("PIRT_TUNING=" + quoted(scratch_.file("none"))),
                 {scratch_.file("none"), "pirt tune --output"});
}

TEST_F(Tune, RefusesWhatCannotBeTuned) {
  expect_refused(pirt({"tune", "--platform", "fake", "--output", file_}), {"'fake'", "opencl"});
  expect_refused(pirt({"tune", "--units", "cpu", "--output", file_}), {"'cpu'", "opencl"});
  expect_refused(pirt({"tune", "--filter", "sobell", "--output", file_}), {"sobell", "sobel"});
  expect_refused(pirt({"tune", "--max-time", "0", "--output", file_}), {"0"});
  expect_refused(pirt({"tune"}, "PIRT_TUNING=none"), {"--output"});
  EXPECT_FALSE(std::filesystem::exists(file_));
}

TEST_F(Tune, SaysSoIfItCouldNotWriteBeforeItMeasures) {
  const auto unit = plan_or_skip();
  if (unit.is_null()) GTEST_SKIP() << "skipped: no OpenCL device";
  const auto in_a_file = scratch_.write("plain", "") + "/tuning.json";
  const auto outcome =
      pirt({"tune", "--platform", "host-opencl", "--filter", "blur", "--output", in_a_file});
  expect_refused(outcome, {in_a_file, "--output"});
  std::filesystem::create_symlink("/proc/x", file_);
  expect_refused(pirt({"tune", "--platform", "host-opencl", "--filter", "blur", "--output", file_}),
                 {"/proc/x", "--output"});
}

}  // namespace
}  // namespace pirt::test
