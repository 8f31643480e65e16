// What it costs to leave a call between two slices: to ask while nothing waits, and to let an empty
// task in and go on, submission, dispatcher and callbacks included; beside twice what handing over
// a call behind another takes, which virtual time counts for it.
//
// Usage: slices [times]; default 2000. Medians and 95 %.
#include "workloads/model/slices.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <vector>

#include "scheduler/runtime/runtime.h"
#include "scheduler/unit_times/handover.h"

namespace {

using Clock = std::chrono::steady_clock;

void print(const char* what, std::vector<double> us) {
  std::ranges::sort(us);
  fmt::print("{:<38} median {:>6.2f} us, p95 {:>6.2f} us\n", what, us[us.size() / 2],
             us[us.size() * 95 / 100]);
}

double in_us(Clock::duration time) {
  return std::chrono::duration<double, std::micro>(time).count();
}

}  // namespace

int main(int argc, char** argv) {
  using namespace std::chrono_literals;
  const int times = std::max(1, argc > 1 ? std::atoi(argv[1]) : 2000);
  std::vector<double> asked, left;
  pirt::Runtime* running = nullptr;
  pirt::RuntimeOptions options;
  options.platform = pirt::parse_platform("bench", R"(
platform: bench
units: {cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}}
)",
                                          {}, 2);
  options.mode = "edf";
  options.slices = true;
  const auto nothing = [](std::span<const pirt::Tensor>, std::span<pirt::Tensor>) {};
  const auto sliced = [&](std::span<const pirt::Tensor>, std::span<pirt::Tensor>) {
    for (int i = 0; i < times; ++i) {
      const auto begin = Clock::now();
      pirt::between_slices();
      asked.push_back(in_us(Clock::now() - begin));
      static_cast<void>(running->submit("empty", {}, {.deadline = 1s}));
      const auto before = Clock::now();
      pirt::between_slices();
      left.push_back(in_us(Clock::now() - before));
    }
  };
  options.workloads.emplace_back(pirt::OwnWorkload{
      .name = "empty", .inputs = {}, .outputs = {}, .kernels = {{"cpu", nothing}}});
  options.workloads.emplace_back(pirt::OwnWorkload{
      .name = "sliced", .inputs = {}, .outputs = {}, .kernels = {{"cpu", sliced}}});
  {
    pirt::Runtime runtime(std::move(options));
    running = &runtime;
    static_cast<void>(runtime.submit("sliced", {}, {}));
    runtime.wait_all();
    if (runtime.statistics().left != times) return 1;
  }
  print("asked, nothing is let in", asked);
  print("left for an empty task, and on again", left);
  std::vector<double> twice;
  for (const pirt::Nanos each : pirt::measure_handover({}, {pirt::Nanos(0), times})) {
    twice.push_back(2e-3 * static_cast<double>(each.count()));
  }
  print("two hand-overs behind another call", twice);
  return 0;
}
