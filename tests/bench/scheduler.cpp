// How fast virtual time is, and that its memory does not follow the tasks done: table1-robot on
// platform `fake`, mode advanced.
//
// Usage: scheduler [tasks in millions ...]; default 1 10. Prints tasks/s and the peak memory of the
// process after each. Then the same beside SimGrid S4U, where that is installed (libsimgrid-dev).
// `scheduler budget [profile.db of platform host]`: what mode budget reaches instead.
#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "characterize/profile/store/reader.h"
#include "scheduler/schedule.h"
#include "tests/bench/budget_rows.h"
#include "tests/bench/peers/comparison.h"

namespace {

double peak_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

/// Tasks that the mix submits in a second of virtual time, in the long run.
double task_rate(const pirt::Mix& mix) {
  double rate = 0;
  for (const auto& pipeline : mix.pipelines) {
    rate += pipeline.rate_hz.value_or(0) * static_cast<double>(pipeline.tasks.size());
  }
  return rate;
}

int run(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "budget") {
    pirt::bench::print_closed_loops();
    pirt::bench::print_graphs();
    pirt::bench::print_robot(pirt::load_platform("fake"), nullptr);
    if (argc < 3) return 0;
    const pirt::ProfileReader reader(argv[2]);
    auto profile = reader.read();
    reader.read_samples(profile);
    pirt::bench::print_robot(pirt::load_platform("host"), &profile);
    return 0;
  }
  std::vector<double> millions;
  for (int i = 1; i < argc; ++i) millions.push_back(std::atof(argv[i]));
  if (millions.empty()) millions = {1, 10};
  const auto platform = pirt::load_platform("fake");
  const auto mix = pirt::load_mix("table1-robot");
  for (const char* mode : {"throughput", "advanced"}) {
    for (const double count : millions) {
      pirt::ScheduleOptions options;
      options.mode = mode;
      options.duration = pirt::from_s(count * 1e6 / task_rate(mix));
      const auto begin = std::chrono::steady_clock::now();
      const auto record = pirt::run_virtual(platform, nullptr, mix, options);
      const double elapsed_s =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      fmt::print("{:<11} {:>9} tasks  {:>6.2f} s  {:>5.2f} M tasks/s  peak {:.1f} MiB\n", mode,
                 record.completed, elapsed_s,
                 static_cast<double>(record.completed) / elapsed_s / 1e6, peak_mib());
    }
  }
  return pirt::bench::compare_with_simgrid() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const pirt::Error& error) {
    std::fprintf(stderr, "scheduler: %s\n", error.what());
    return pirt::exit_code(error.code());
  }
}
