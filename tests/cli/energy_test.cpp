// Energy meters through the whole program: simulated units, and a simulated sysfs whose counter
// advances with what the workers do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "tests/cli/program.h"
#include "tests/support/paths.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

namespace fs = std::filesystem;

/// Three packages in a folder: package-0 draws 2 W, and 12 W while a worker computes, package-1
/// stands still, package-2 cannot be read any more once the database is there.
class SimulatedMachine {
 public:
  SimulatedMachine() {
    for (const auto* zone : {"0", "1", "2"}) {
      const auto folder = zone_folder(zone);
      fs::create_directories(folder);
      std::ofstream(folder / "name") << "package-" << zone << "\n";
      std::ofstream(folder / "max_energy_range_uj") << "262143328850\n";
      std::ofstream(folder / "energy_uj") << "1000000\n";
    }
    thread_ = std::thread([this] { run(); });
  }
  ~SimulatedMachine() {
    stop_ = true;
    thread_.join();
  }
  SimulatedMachine(const SimulatedMachine&) = delete;
  SimulatedMachine& operator=(const SimulatedMachine&) = delete;

  [[nodiscard]] std::string environment() const { return "PIRT_SYSFS=" + quoted(root().string()); }
  [[nodiscard]] std::string database() const { return scratch_.file("p.db"); }
  [[nodiscard]] std::string file(const std::string& name) const { return scratch_.file(name); }
  [[nodiscard]] std::string platform() const {
    return scratch_.write("metered.yaml",
                          "platform: metered\n"
                          "units:\n"
                          "  live: {backend: fake, meter: package-0, active_w: 1}\n"
                          "  frozen: {backend: fake, meter: package-1, active_w: 1}\n"
                          "  failing: {backend: fake, meter: package-2, active_w: 1}\n"
                          "  modelled: {backend: fake, active_w: 1}\n");
  }

 private:
  [[nodiscard]] fs::path root() const { return scratch_.file("sys"); }
  [[nodiscard]] fs::path zone_folder(const std::string& zone) const {
    return root() / "class/powercap" / ("intel-rapl:" + zone);
  }

  /// Whether a process that was started with this machine's sysfs runs, or waits for a core: how
  /// much processor time it gets depends on what else the real machine does.
  [[nodiscard]] bool is_busy() const {
    for (const auto& process : fs::directory_iterator("/proc")) {
      const auto environ = slurp((process.path() / "environ").string());
      if (environ.find(root().string()) == std::string::npos) continue;
      const auto stat = slurp((process.path() / "stat").string());  // proc(5): "PID (NAME) STATE"
      const auto name_end = stat.rfind(") ");
      if (name_end != std::string::npos && stat.substr(name_end + 2, 1) == "R") return true;
    }
    return false;
  }

  void run() {
    double energy_j = 1;
    auto last = std::chrono::steady_clock::now();
    while (!stop_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      const double power_w = is_busy() ? 12 : 2;
      const auto now = std::chrono::steady_clock::now();
      energy_j += power_w * std::chrono::duration<double>(now - last).count();
      last = now;
      // Readers see the old figure or the new one, never a part.
      const auto file = zone_folder("0") / "energy_uj";
      std::ofstream(file.string() + ".new") << static_cast<std::int64_t>(energy_j * 1e6) << "\n";
      fs::rename(file.string() + ".new", file);
      if (fs::exists(database())) fail(zone_folder("2") / "energy_uj");
    }
  }

  /// Reading address 0 of a process' memory is answered with EIO.
  static void fail(const fs::path& file) {
    if (fs::is_symlink(file)) return;
    fs::create_symlink("/proc/self/mem", file.string() + ".new");
    fs::rename(file.string() + ".new", file);
  }

  Scratch scratch_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

TEST(Energy, MetersAreReadAndJudgedFromSysfsToReport) {
  const SimulatedMachine machine;
  const auto made = pirt({"characterize", "--quick", "--platform", machine.platform(), "--filter",
                          "^pool5$", "--db", machine.database(), "--json", "-"},
                         machine.environment());
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto json = made.json();
  ASSERT_EQ(json["energy_summary"].size(), 4U);
  for (const auto& row : json["energy_summary"]) {
    SCOPED_TRACE(row.dump());
    const std::string reasons = row["reasons"].dump();
    if (row["unit"] == "live") {
      // A real machine that is busy with something else may have disturbed the simulated one.
      EXPECT_EQ(reasons, "[]");
      EXPECT_EQ(row["provenance"], "measured");
      EXPECT_THAT(row["source"], testing::StartsWith("rapl: package-0"));
      EXPECT_EQ(row["domain"], "package");
      EXPECT_EQ(row["idle_subtracted"], true);
      // A call takes less than 0.1 s of one core, at 10 W.
      EXPECT_GT(row["energy_j"], 0);
      EXPECT_LT(row["energy_j"], 1);
    } else if (row["unit"] == "modelled") {
      EXPECT_EQ(row["provenance"], "modelled");
      EXPECT_EQ(row["domain"], "unit");
    } else {
      EXPECT_EQ(row["valid"], false);
      EXPECT_EQ(row["provenance"], "measured");
      EXPECT_FALSE(row.contains("energy_j"));
      EXPECT_THAT(reasons, HasSubstr(row["unit"] == "frozen" ? "meter_frozen" : "meter_error"));
    }
  }
}

TEST(Energy, AFittedModelIsPrintedAndServesAsPlatform) {
  const SimulatedMachine machine;
  const std::string fitted = machine.file("fitted.yaml");
  const auto made =
      pirt({"characterize", "--quick", "--platform", machine.platform(), "--units", "live",
            "--filter", "^(pool1|pool2|pool5|fc8)$", "--fit-energy", fitted, "--fit-parameters",
            "call_j", "--db", machine.database(), "--json", machine.file("out.json")},
           machine.environment());
  if (made.out.find("usable cells are too few") != std::string::npos) {
    GTEST_SKIP() << "the machine was too busy for valid rows:\n" << made.out;
  }
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("Energy model of unit live, fitted to"));
  EXPECT_THAT(made.out, HasSubstr("--platform " + fitted));
  const auto json = nlohmann::json::parse(slurp(machine.file("out.json")));
  const double call_j = json["energy_fit"][0]["parameters"][0]["value"];
  EXPECT_GT(call_j, 0);

  const auto again =
      pirt({"characterize", "--quick", "--platform", fitted, "--units", "live", "--set",
            "live.meter=none", "--filter", "^pool5$", "--db", machine.file("q.db"), "--json", "-"},
           machine.environment());
  ASSERT_EQ(again.exit_code, 0) << again.err;
  const auto row = again.json()["energy_summary"][0];
  EXPECT_EQ(row["provenance"], "fitted");
  EXPECT_NEAR(row["energy_j"], call_j, 1e-4 * call_j);
  EXPECT_THAT(row["source"], HasSubstr("rapl: package-0"));
}

TEST(Energy, AFitThatCannotBeIsRefusedBeforeMeasuring) {
  const SimulatedMachine machine;
  const auto refused = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"characterize", "--platform", machine.platform(), "--db",
                                          machine.database()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto outcome = pirt(arguments, machine.environment());
    EXPECT_FALSE(fs::exists(machine.database()));
    return outcome;
  };
  const auto no_meter = refused({"--units", "modelled", "--fit-energy", machine.file("f.yaml")});
  EXPECT_EQ(no_meter.exit_code, 4);
  EXPECT_THAT(no_meter.err, HasSubstr("no unit has an energy meter"));
  EXPECT_EQ(refused({"--fit-energy", "fitted"}).exit_code, 2);
  EXPECT_EQ(refused({"--fit-parameters", "op_pj"}).exit_code, 2);
  const auto typo = refused({"--fit-energy", "./f.yaml", "--fit-parameters", "op_pJ"});
  EXPECT_EQ(typo.exit_code, 2);
  EXPECT_THAT(typo.err, HasSubstr("op_pj"));
}

TEST(Energy, AnUnknownMeterIsAnErrorBeforeAnythingIsMeasured) {
  const SimulatedMachine machine;
  const auto outcome = pirt({"characterize", "--platform", machine.platform(), "--set",
                             "live.meter=package-O", "--db", machine.database()},
                            machine.environment());
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("package-0"));
  EXPECT_FALSE(fs::exists(machine.database()));
}

TEST(Energy, ABoardIsMeteredAtRestAwakeAndUnderLoadAndARunIsChargedForHoldingIt) {
  const Scratch scratch;
  const std::string platform = scratch.write(
      "board.yaml",
      "platform: board\nunits:\n  gpu: {backend: fake, meter: 'nvidia/0000:01:00.0'}\n");
  const std::string board = "PIRT_NVML=" + quoted(kNvmlStandIn) +
                            " NVML_STAND_IN='boards=01 step_ms=20 call_w=400'"
                            " PIRT_SYSFS=/nonexistent";
  const auto made = pirt({"characterize", "--quick", "--platform", platform, "--filter", "^pool5$",
                          "--db", scratch.file("p.db"), "--json", "-"},
                         board);
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto row = made.json()["energy_summary"][0];
  SCOPED_TRACE(row.dump());
  EXPECT_EQ(row["provenance"], "measured");
  EXPECT_THAT(row["source"], HasSubstr("nvml: nvidia/0000:01:00.0; a step each "));
  EXPECT_EQ(row["domain"], "gpu");
  // A real machine that is busy with something else may have disturbed the calls.
  if (row["valid"] != true) GTEST_SKIP() << row["reasons"];
  EXPECT_GT(row["energy_j"], 0);
  const auto run =
      pirt({"schedule", "--platform", platform, "--profile", scratch.file("p.db"), "--mix",
            scratch.write("mix.yaml",
                          "mix: m\npipelines: {p: {rate_hz: 10, tasks: "
                          "[{name: t, workload: pool5}]}}\n"),
            "--mode", "ect", "--duration", "1s", "--json", "-"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  // Awake for a second, and ten calls.
  const double energy_j = run.json()["energy_j"];
  EXPECT_NEAR(energy_j - 10 * row["energy_j"].get<double>(), 124, 6);
}

TEST(Energy, ListShowsTheMetersAndWhatIsMissing) {
  const SimulatedMachine machine;
  const auto json = pirt({"list", "meters", "--json", "-"}, machine.environment()).json();
  ASSERT_EQ(json["meters"].size(), 3U);
  EXPECT_EQ(json["meters"][0]["name"], "package-0");
  EXPECT_EQ(json["meters"][0]["covers"], "package");
  EXPECT_EQ(json["meters"][0]["readable"], true);
  EXPECT_THAT(json["missing"].dump(), HasSubstr("battery: none"));
  const auto text = pirt({"list", "meters"}, "PIRT_SYSFS=/nonexistent");
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, HasSubstr("RAPL: no zones"));
}

}  // namespace
}  // namespace pirt::test
