// Stressed: does a row that is wrong say so? Characterizes with nothing beside it, for the truth,
// then again and again beside busy loops on every core: no row may be valid and further from the
// truth than its interval and the truth's say.
//
// Usage: stressed PIRT FOLDER [--runs N] [--filter REGEX] [--platform NAME] [--loops N]
//   FOLDER holds truth.db and stressed.db; the truth is measured if it is not there. Defaults: 10
//   runs of a few cells, 2 loops a core.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <map>
#include <thread>

#include "characterize/campaign/campaign.h"
#include "characterize/profile/store/reader.h"
#include "characterize/statistics/statistics.h"
#include "workloads/base/error.h"

namespace {

using namespace pirt;  // NOLINT: a program

/// What two quiet runs may differ by (reports/gate/table_gate.h: the least change that counts), and
/// below what set-ups are not judged (validity.h).
constexpr double kRunsDiffer = 0.05;
constexpr Nanos kSetupGrain = std::chrono::milliseconds(1);

struct Options {
  std::filesystem::path program, folder;
  int runs = 10;
  int loops = 2 * static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::string filter = "^(sobel|gaussian_blur|conv5|fc8)$";
  std::string platform = "host";
};

/// Programs beside the measurement, from here to its end.
class Load {
 public:
  explicit Load(int loops) {
    for (int i = 0; i < loops; ++i) {
      threads_.emplace_back([](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
        }
      });
    }
  }

 private:
  std::vector<std::jthread> threads_;
};

Profile characterize(const Options& options, const char* database, bool quick) {
  CampaignOptions campaign;
  campaign.database = options.folder / database;
  campaign.platform_argument = options.platform;
  campaign.platform = load_platform(options.platform);
  campaign.filter = options.filter;
  campaign.quick = quick;
  campaign.program = options.program;
  const auto summary = run_campaign(campaign, plan_campaign(campaign));
  return load_profile(campaign.database, campaign.platform.name, {summary.run_id, summary.run_id});
}

/// Of two set-ups, which have none, what they span.
Interval interval_of(const PhaseRow& row) {
  if (row.ci_low && row.ci_high) return {*row.ci_low, *row.ci_high};
  return {row.samples == 2 ? 2 * *row.median - *row.p99 : *row.median, *row.p99};
}

bool is_off(const PhaseRow& row, const PhaseRow& truth) {
  const Interval a = interval_of(row);
  const Interval b = interval_of(truth);
  const Nanos apart = std::max(a.low - b.high, b.low - a.high);
  const auto differ = scaled(*truth.median, kRunsDiffer);
  return apart > (is_setup(row.phase) ? std::max(differ, kSetupGrain) : differ);
}

struct Count {
  int valid = 0;
  int off = 0;
  std::map<std::string, int> reasons;
};

void compare(const Profile& stressed, const Profile& truth, Count& count) {
  for (const PhaseRow& row : stressed.phases) {
    for (const std::string& reason : row.reasons) ++count.reasons[reason];
    const PhaseRow* quiet = truth.find(row.workload, row.unit, row.phase, row.state);
    if (!is_valid(row) || quiet == nullptr || !is_valid(*quiet)) continue;
    ++count.valid;
    if (!is_off(row, *quiet)) continue;
    ++count.off;
    const Interval interval = interval_of(row);
    fmt::print("run {}: {} on {}, {} {}: {:.4g} ms ({:.4g} to {:.4g}) is valid, the truth {:.4g}\n",
               row.run_id, row.workload, row.unit, to_string(row.phase), to_string(row.state),
               to_ms(*row.median), to_ms(interval.low), to_ms(interval.high),
               to_ms(*quiet->median));
  }
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app{"Whether a row that other programs spoil says so"};
  app.add_option("PIRT", options.program)->required();
  app.add_option("FOLDER", options.folder)->required();
  app.add_option("--runs", options.runs)->check(CLI::Range(1, 1000));
  app.add_option("--filter", options.filter);
  app.add_option("--platform", options.platform);
  app.add_option("--loops", options.loops)->check(CLI::Range(1, 1000));
  CLI11_PARSE(app, argc, argv);
  options.program = std::filesystem::absolute(options.program);
  std::filesystem::create_directories(options.folder);
  const bool known = std::filesystem::exists(options.folder / "truth.db");
  const Profile truth = known ? load_profile(options.folder / "truth.db", options.platform)
                              : characterize(options, "truth.db", false);
  Count count;
  for (int i = 0; i < options.runs; ++i) {
    const Load load(options.loops);
    compare(characterize(options, "stressed.db", true), truth, count);
  }
  for (const auto& [reason, rows] : count.reasons) fmt::print("{} rows: {}\n", rows, reason);
  fmt::print("{} runs beside {} loops: {} rows are valid, {} of them off (goal: 0)\n", options.runs,
             options.loops, count.valid, count.off);
  return count.off == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const Error& error) {
    std::fprintf(stderr, "stressed: %s\n", error.what());
    return exit_code(error.code());
  }
}
