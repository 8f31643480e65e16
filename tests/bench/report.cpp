// The HTML report of a large profile, the workloads of Table I and AlexNet on five units with 2000
// samples a call each: how large it is, how long pirt takes to make it, and how long a browser
// takes from opening it until the last chart is drawn. Medians of five.
//
// Usage: report PIRT FOLDER   PIRT: the program, e.g. build/pirt; FOLDER: where to put the files
// Without Chromium and its driver (Debian: chromium, chromium-driver) that part is left out.
#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "characterize/profile/store/writer.h"
#include "tests/support/browser.h"
#include "workloads/base/error.h"
#include "workloads/base/math/random.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"

namespace {

constexpr std::array kUnits = {"cpu", "gpu", "dsp", "fpga", "npu"};
constexpr int kRounds = 5;

std::string board() {
  std::string text = "platform: bench-board\nunits:\n";
  for (const auto* unit : kUnits) {
    text += fmt::format("  {}: {{backend: fake, slots: 1, active_w: 2}}\n", unit);
  }
  return text;
}

/// A log-normal time around @p us, as samples of calls are.
std::vector<pirt::Nanos> samples(pirt::Random& random, double us, int count) {
  std::vector<pirt::Nanos> times;
  for (int i = 0; i < count; ++i) {
    const double normal =
        std::sqrt(-2 * std::log(1 - random.uniform())) * std::cos(6.283185307 * random.uniform());
    times.emplace_back(static_cast<std::int64_t>(us * 1e3 * std::exp(0.1 * normal)) + 1);
  }
  return times;
}

pirt::CellRecord cell(const pirt::Workload& workload, const std::string& unit,
                      pirt::Random& random) {
  pirt::CellRecord record;
  record.workload = workload.name;
  record.unit = unit;
  record.ops = workload.ops;
  record.bytes = workload.bytes();
  record.verification = "made up";
  const double us = std::exp(random.uniform(3, 9));  // 20 us to 8 ms
  using pirt::Phase;
  using pirt::State;
  for (const State state : {State::kCold, State::kWarm}) {
    const double slow = state == State::kCold ? 10 : 1;
    record.phases.push_back({.phase = Phase::kDeviceInit,
                             .state = state,
                             .reasons = {},
                             .notes = {},
                             .samples = samples(random, 500, 9)});
    record.phases.push_back({.phase = Phase::kPrepare,
                             .state = state,
                             .reasons = {},
                             .notes = {},
                             .samples = samples(random, us + 900 * slow, 9)});
  }
  for (const auto& [phase, part] :
       {std::pair(Phase::kUpload, 0.1), std::pair(Phase::kLaunch, 0.05),
        std::pair(Phase::kExecute, 0.8), std::pair(Phase::kDownload, 0.05),
        std::pair(Phase::kCall, 1.0)}) {
    record.phases.push_back({.phase = phase,
                             .state = State::kSteady,
                             .reasons = {},
                             .notes = {},
                             .samples = samples(random, us * part, 2000)});
  }
  record.energy.emplace().energy_j = us * 2e-6;
  record.energy->source = "model: made up";
  return record;
}

void write_profile(const std::filesystem::path& path) {
  std::filesystem::remove(path);
  pirt::ProfileWriter writer(path);
  pirt::RunHeader header{.started = "2026-01-01T00:00:00Z",
                         .platform = "bench-board",
                         .seed = 1,
                         .environment = {{"cpu_model", "made up"}},
                         .units = {}};
  for (const auto* unit : kUnits) header.units.push_back({unit, "fake", "made up", false, {}});
  const auto run = writer.begin_run(header);
  pirt::Random random(1);
  int cells = 0;
  for (const pirt::Workload& workload : pirt::catalog()) {
    if (!workload.has_tag("table1") && workload.name != "alexnet") continue;
    for (const auto* unit : kUnits) {
      writer.write_cell(run, cell(workload, unit, random));
      ++cells;
    }
  }
  writer.finish_run(run, "2026-01-01T00:10:00Z");
  fmt::print("profile: {} cells, {:.1f} MB\n", cells,
             static_cast<double>(std::filesystem::file_size(path)) / 1e6);
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

/// Whether @p value is below the goal, said in a line.
bool says(const char* what, double value, double goal, const char* unit) {
  fmt::print("{}: {:.2f} {}, goal: below {} {}\n", what, value, unit, goal, unit);
  return value < goal;
}

double seconds_to_run(const std::string& command) {
  const auto start = std::chrono::steady_clock::now();
  const int status = std::system(command.c_str());
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) pirt::throw_environment("failed: " + command);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// From the start of navigation, as the page noted it when its last chart was drawn.
double seconds_until_drawn(const std::string& page) {
  pirt::test::Browser browser(1100, 900);
  browser.open(page);
  return std::stod(
             browser.run("return document.documentElement.dataset.drawnMs;").get<std::string>()) /
         1e3;
}

int run(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: report PIRT FOLDER\n", stderr);
    return pirt::kExitBadInput;
  }
  const std::filesystem::path folder = argv[2];
  std::filesystem::create_directories(folder);
  const auto profile = (folder / "board.db").string(), platform = (folder / "board.yaml").string(),
             page = (folder / "report.html").string();
  write_profile(profile);
  pirt::write_file(platform, board());
  const auto command = fmt::format("'{}' report page '{}' --platform '{}' -o '{}'", argv[1],
                                   profile, platform, page);
  std::vector<double> made, drawn;
  for (int i = 0; i < kRounds; ++i) made.push_back(seconds_to_run(command));
  const double size_mb = static_cast<double>(std::filesystem::file_size(page)) / 1e6;
  bool good = says("report.html", size_mb, 3, "MB");
  good = says("made in", median(made), 2, "s") && good;
  const auto why_not = pirt::test::no_browser();
  if (!why_not.empty()) {
    fmt::print("drawn: {}\n", why_not);
    return good ? 0 : 1;
  }
  for (int i = 0; i < kRounds; ++i) drawn.push_back(seconds_until_drawn(page));
  good = says("last chart drawn after", median(drawn), 1, "s") && good;
  return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "report: %s\n", error.what());
    return pirt::kExitEnvironment;
  }
}
