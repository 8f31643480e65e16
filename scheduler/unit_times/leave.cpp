#include "scheduler/unit_times/leave.h"

#include <span>
#include <utility>

#include "characterize/platform/platform.h"
#include "scheduler/runtime/runtime.h"
#include "workloads/base/error.h"
#include "workloads/model/slices.h"

namespace pirt {
namespace {

constexpr const char* kUnit = "cpu";
constexpr Nanos kLongest = std::chrono::seconds(5);  // that a submission takes on a busy machine

Platform platform_on(const std::vector<int>& cores) {
  Platform platform = parse_platform(
      "leave", "platform: leave\nunits: {cpu: {backend: cpu, cores: all, slots: 1, active_w: 1}}\n",
      {}, static_cast<int>(usable_cores().size()));
  if (!cores.empty()) platform.units.front().cores = cores;
  return platform;
}

}  // namespace

std::vector<Nanos> measure_leave(const std::vector<int>& cores, int samples) {
  const MachineClock clock;
  std::vector<Nanos> times;  // Of the unit's thread, until all has ended.
  Runtime* running = nullptr;
  RuntimeOptions options;
  options.platform = platform_on(cores);
  options.mode = "edf";
  options.slices = true;
  int let_in = 0;  // Of the unit's thread, too.
  const auto nothing = [&let_in](std::span<const Tensor>, std::span<Tensor>) { ++let_in; };
  const auto outer = [&](std::span<const Tensor>, std::span<Tensor>) {
    for (int i = 0; i < samples; ++i) {
      static_cast<void>(running->submit("let_in", {}, {.deadline = std::chrono::seconds(1)}));
      const Nanos given_up = clock.now() + kLongest;
      Nanos before{0};
      // Another thread's turn may have the submission still: it is seen at the end of a later
      // slice.
      do {
        before = clock.now();
        between_slices();
      } while (let_in <= i && before < given_up);
      if (let_in <= i) return;
      times.push_back(clock.now() - before);
    }
  };
  options.workloads.emplace_back(
      OwnWorkload{.name = "let_in", .inputs = {}, .outputs = {}, .kernels = {{kUnit, nothing}}});
  options.workloads.emplace_back(
      OwnWorkload{.name = "outer", .inputs = {}, .outputs = {}, .kernels = {{kUnit, outer}}});
  Runtime runtime(std::move(options));
  running = &runtime;
  static_cast<void>(runtime.submit("outer", {}, {}));
  runtime.wait_all();
  if (static_cast<int>(times.size()) != samples) {
    throw_environment("no call was suspended between two slices for 5 s");
  }
  return times;
}

}  // namespace pirt
