// How long characterizing platform `host` takes and how much memory it needs: the coordinator and
// the one worker process that runs at a time.
//
// Usage: characterize PIRT [full]   PIRT: the program whose workers are started, e.g. build/pirt;
// default: --quick
#include <fmt/format.h>
#include <sys/resource.h>

#include <cstdio>
#include <string_view>

#include "characterize/campaign/campaign.h"
#include "workloads/base/error.h"

namespace {

double peak_mib(int who) {
  rusage usage{};
  getrusage(who, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

int run(int argc, char** argv) {
  if (argc < 2) {
    std::fputs("usage: characterize PIRT [full]\n", stderr);
    return pirt::kExitBadInput;
  }
  const auto database = std::filesystem::temp_directory_path() / "pirt-bench-characterize.db";
  std::filesystem::remove(database);
  pirt::CampaignOptions options;
  options.database = database;
  options.platform = pirt::load_platform("host");
  options.program = std::filesystem::absolute(argv[1]);
  options.quick = argc < 3 || std::string_view(argv[2]) != "full";
  const auto plan = pirt::plan_campaign(options);
  const auto summary = pirt::run_campaign(options, plan);
  std::filesystem::remove(database);
  fmt::print("{}: {} cells, {} valid rows, {} invalid, {:.1f} s\n",
             options.quick ? "quick" : "full", summary.cells, summary.rows_valid,
             summary.rows_invalid, pirt::to_s(summary.elapsed));
  fmt::print("peak memory: coordinator {:.0f} MiB, largest worker {:.0f} MiB (one at a time)\n",
             peak_mib(RUSAGE_SELF), peak_mib(RUSAGE_CHILDREN));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const pirt::Error& error) {
    std::fprintf(stderr, "characterize: %s\n", error.what());
    return pirt::exit_code(error.code());
  }
}
