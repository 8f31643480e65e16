// Energy meters through the whole program: simulated units, and a simulated sysfs whose counter
// advances with the processor time of the workers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "tests/cli/program.h"

namespace pirt::test {
namespace {

using testing::HasSubstr;

namespace fs = std::filesystem;

/// Three packages in a folder: package-0 draws 2 W and 10 W more per busy worker, package-1 stands
/// still, package-2 cannot be read any more once the database is there.
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

  /// Seconds of processor time of all processes that were started with this machine's sysfs.
  [[nodiscard]] double worker_seconds() const {
    double seconds = 0;
    for (const auto& process : fs::directory_iterator("/proc")) {
      const auto environ = slurp((process.path() / "environ").string());
      if (environ.find(root().string()) == std::string::npos) continue;
      const auto stat = slurp((process.path() / "stat").string());
      std::istringstream fields(stat.substr(std::min(stat.size(), stat.rfind(')') + 2)));
      std::string skipped;
      for (int i = 0; i < 11; ++i) fields >> skipped;  // proc(5): utime and stime are 14 and 15
      double user = 0, system = 0;
      fields >> user >> system;
      seconds += (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
    }
    return seconds;
  }

  void run() {
    const auto start = std::chrono::steady_clock::now();
    double used_s = 0, last_s = 0;
    while (!stop_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      const double now_s = worker_seconds();
      used_s += std::max(0.0, now_s - last_s);  // a process that ended takes its time away
      last_s = now_s;
      const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
      const double energy_j = 2 * elapsed.count() + 10 * used_s;
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
      EXPECT_EQ(row["valid"], true);
      EXPECT_EQ(row["provenance"], "measured");
      EXPECT_THAT(row["source"], testing::StartsWith("rapl: package-0"));
      // A call takes less than 0.1 s of one core, at 10 W.
      EXPECT_GT(row["energy_j"], 0);
      EXPECT_LT(row["energy_j"], 1);
    } else if (row["unit"] == "modelled") {
      EXPECT_EQ(row["provenance"], "modelled");
    } else {
      EXPECT_EQ(row["valid"], false);
      EXPECT_EQ(row["provenance"], "measured");
      EXPECT_FALSE(row.contains("energy_j"));
      EXPECT_THAT(reasons, HasSubstr(row["unit"] == "frozen" ? "meter_frozen" : "meter_error"));
    }
  }
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
