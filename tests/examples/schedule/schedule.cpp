// Which mode suits a robot's mix on a board that is not there: the modes side by side in virtual
// time, by a program that links nothing that computes.
//
// Usage: schedule [platform [mix]]
#include "scheduler/schedule.h"

#include <cstdio>
#include <exception>

int main(int argc, char** argv) try {
  const pirt::Platform platform = pirt::load_platform(argc > 1 ? argv[1] : "snapdragon820");
  const pirt::Mix mix = pirt::load_mix(argc > 2 ? argv[2] : "convolution-1000");
  const auto [runs, skipped] =
      pirt::run_modes(platform, nullptr, mix, pirt::policy_names(), pirt::ScheduleOptions{});
  for (const pirt::RunRecord& run : runs) {
    std::printf("%-10s %6.3f tasks/ms %6.2f J\n", run.mode.c_str(),
                run.throughput_per_ms.value_or(0), run.energy_j.value_or(0));
  }
  for (const std::string& line : pirt::reason_lines(skipped)) std::printf("%s\n", line.c_str());
  return runs.empty() ? 1 : 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
