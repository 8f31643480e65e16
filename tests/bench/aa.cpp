// A/A: runs the same characterization several times and compares the runs with each other: do the
// intervals of consecutive runs overlap, how many cells reach the precision, how far do medians
// spread. Beside it, in turns, the same kernels through Google Benchmark with its defaults, if it
// is installed.
//
// Usage: aa PIRT FOLDER [--runs N] [--filter REGEX] [--quick]
//   FOLDER holds aa.db and google-RUN-UNIT.json; what is there already is not measured again, an
//   interrupted run is gone on with. Defaults: 10 full runs of every workload on platform host.
#include <fmt/format.h>
#include <stdlib.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>

#include "characterize/campaign/campaign.h"
#include "characterize/profile/store/reader.h"
#include "characterize/published/google_benchmark.h"
#include "characterize/statistics/statistics.h"
#include "characterize/worker/process.h"
#include "workloads/backends/registry.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace {

using namespace pirt;  // NOLINT: a program

struct Options {
  std::filesystem::path program, folder;
  int runs = 10;
  std::string filter;
  bool quick = false;
  [[nodiscard]] std::filesystem::path database() const { return folder / "aa.db"; }
};

constexpr const char* kPlatform = "host";

/// One figure of a cell in one run.
struct Figure {
  double median = 0, low = 0, high = 0;
  bool precise = false;
};
using CellKey = std::tuple<std::string, std::string, Phase>;
using Figures = std::map<CellKey, std::vector<Figure>>;

/// Runs that ended, oldest first; an unfinished one is ended first.
std::vector<std::int64_t> runs_so_far(const Options& options) {
  if (!std::filesystem::exists(options.database())) return {};
  if (find_unfinished_run(options.database())) {
    auto rest = resume_options(options.database());
    rest.program = options.program;
    run_campaign(rest, plan_campaign(rest));
  }
  std::vector<std::int64_t> ids = ProfileReader(options.database()).finished_runs(kPlatform);
  std::ranges::reverse(ids);
  return ids;
}

void characterize(const Options& options) {
  CampaignOptions campaign;
  campaign.database = options.database();
  campaign.platform_argument = kPlatform;
  campaign.platform = load_platform(kPlatform);
  campaign.filter = options.filter;
  campaign.quick = options.quick;
  campaign.program = options.program;
  const auto plan = plan_campaign(campaign);
  const auto summary = run_campaign(campaign, plan);
  fmt::print("run {}: {:.0f} s, {} of {} cells within {} %\n", summary.run_id,
             to_s(summary.elapsed), summary.within_precision, summary.cells,
             100 * campaign.precision);
}

std::filesystem::path google_file(const Options& options, std::int64_t run,
                                  const std::string& unit) {
  return options.folder / fmt::format("google-{}-{}.json", run, unit);
}

/// Google Benchmark's figures of one run. @return False if its program was not built.
bool google(const Options& options, const std::filesystem::path& program, std::int64_t run) {
  if (!std::filesystem::exists(program)) return false;
  const auto platform = load_platform(kPlatform);
  for (const UnitModel& unit : platform.units) {
    if (!unit.measured()) continue;
    const auto file = google_file(options, run, unit.name);
    if (std::filesystem::exists(file)) continue;
    const auto cache = options.folder / ("kernels-" + unit.name);
    std::filesystem::create_directories(cache);
    const auto partial = file.string() + ".partial";
    ProcessRequest request;
    request.program = program;
    request.arguments = {unit.name, "--benchmark_out=" + partial, "--benchmark_out_format=json",
                         "--benchmark_filter=" + (options.filter.empty() ? "." : options.filter)};
    request.environment = find_backend(unit.backend).kernel_cache_environment(cache.string());
    request.limit = std::chrono::minutes(20);
    const auto result = run_process(request);
    if (result.end != ProcessResult::End::kExited || result.code != 0) {
      throw_environment("Google Benchmark failed: " + result.diagnostics);
    }
    std::filesystem::rename(partial, file);
  }
  return true;
}

/// Rows of one run: load_profile shows the newest run that has a row, so it is read run by run.
void add_run(const Options& options, std::int64_t run, Figures& figures) {
  for (const RowSamples& row : load_samples(options.database(), run)) {
    if (row.phase != Phase::kCall && row.phase != Phase::kExecute) continue;
    const auto summary = summarize(row.samples, row.processes);
    if (!summary.interval) continue;
    const auto half = relative_half_width(summary.interval, summary.median);
    figures[{row.workload, row.unit, row.phase}].push_back(
        {static_cast<double>(summary.median.count()),
         static_cast<double>(summary.interval->low.count()),
         static_cast<double>(summary.interval->high.count()), half && *half <= 0.02});
  }
}

double spread(const std::vector<double>& values) {
  const auto [low, high] = std::ranges::minmax(values);
  return high / low;
}

double geometric_mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += std::log(value);
  return std::exp(sum / static_cast<double>(values.size()));
}

struct Google {
  std::map<std::pair<std::string, std::string>, std::vector<double>> times;  ///< ns a call.
};

Google read_google(const Options& options, const std::vector<std::int64_t>& runs) {
  Google result;
  const auto platform = load_platform(kPlatform);
  for (const std::int64_t run : runs) {
    for (const UnitModel& unit : platform.units) {
      const auto file = google_file(options, run, unit.name);
      if (!std::filesystem::exists(file)) continue;
      for (const BenchmarkEntry& entry :
           benchmark_entries(find_benchmarks(read_file(file)).value())) {
        if (entry.kind != BenchmarkEntry::Kind::kTime) continue;
        const std::string workload = entry.name.substr(0, entry.name.find('/'));
        result.times[{workload, unit.name}].push_back(entry.real_ns);
      }
    }
  }
  return result;
}

/// @return Whether all goals are met.
bool report(const Options& options, const std::vector<std::int64_t>& runs) {
  Figures figures;
  for (const std::int64_t run : runs) add_run(options, run, figures);
  const Google peer = read_google(options, runs);
  int pairs = 0, overlapping = 0, cells = 0, precise = 0;
  std::vector<double> own, google_spreads;
  for (const auto& [key, of_runs] : figures) {
    std::vector<double> medians;
    int overlaps = 0;
    int reached = 0;
    for (std::size_t i = 0; i < of_runs.size(); ++i) {
      medians.push_back(of_runs[i].median);
      reached += of_runs[i].precise ? 1 : 0;
      if (i == 0) continue;
      overlaps += of_runs[i].low <= of_runs[i - 1].high && of_runs[i - 1].low <= of_runs[i].high;
    }
    const auto compared = static_cast<int>(of_runs.size()) - 1;
    pairs += compared;
    overlapping += overlaps;
    cells += static_cast<int>(of_runs.size());
    precise += reached;
    const auto& [workload, unit, phase] = key;
    std::string beside;
    const auto found = peer.times.find({workload, unit});
    if (phase == Phase::kCall && found != peer.times.end() && found->second.size() > 1) {
      own.push_back(spread(medians));
      google_spreads.push_back(spread(found->second));
      beside = fmt::format(", Google Benchmark {:.3f}", google_spreads.back());
    }
    fmt::print("{:<15} {:<7} {:<8} overlap {}/{}, within 2 % {}/{}, max/min of medians {:.3f}{}\n",
               workload, unit, to_string(phase), overlaps, compared, reached, of_runs.size(),
               spread(medians), beside);
  }
  if (pairs == 0) throw_bad_input("nothing to compare: at least two runs are needed");
  const double overlap_share = static_cast<double>(overlapping) / pairs;
  const double precise_share = static_cast<double>(precise) / cells;
  fmt::print("intervals of consecutive runs overlap: {:.1f} % of {} pairs (goal: 90 %)\n",
             100 * overlap_share, pairs);
  fmt::print("cells within 2 %: {:.1f} % of {} (goal: 80 %)\n", 100 * precise_share, cells);
  bool closer = true;
  if (own.empty()) {
    fmt::print("Google Benchmark was not run (install libbenchmark-dev and build again)\n");
  } else {
    const double ratio = geometric_mean(own) / geometric_mean(google_spreads);
    closer = ratio < 1;
    fmt::print(
        "max/min of medians, geometric mean of {} cells: {:.3f}, Google Benchmark {:.3f}, "
        "ratio {:.3f} (goal: below 1)\n",
        own.size(), geometric_mean(own), geometric_mean(google_spreads), ratio);
  }
  return overlap_share >= 0.9 && precise_share >= 0.8 && closer;
}

int run(int argc, char** argv) {
  Options options;
  CLI::App app{"A/A: how much runs of the same characterization differ"};
  app.add_option("PIRT", options.program)->required();
  app.add_option("FOLDER", options.folder)->required();
  app.add_option("--runs", options.runs)->check(CLI::Range(2, 1000));
  app.add_option("--filter", options.filter);
  app.add_flag("--quick", options.quick);
  CLI11_PARSE(app, argc, argv);
  options.program = std::filesystem::absolute(options.program);
  std::filesystem::create_directories(options.folder);
  const auto peer = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "aa_google";
  for (;;) {
    const auto runs = runs_so_far(options);
    for (const std::int64_t id : runs) static_cast<void>(google(options, peer, id));
    if (static_cast<int>(runs.size()) >= options.runs) return report(options, runs) ? 0 : 1;
    characterize(options);
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const Error& error) {
    std::fprintf(stderr, "aa: %s\n", error.what());
    return exit_code(error.code());
  }
}
