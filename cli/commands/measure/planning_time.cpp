#include "cli/commands/measure/planning_time.h"

#include <algorithm>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/statistics/statistics.h"
#include "scheduler/mix/mix.h"
#include "scheduler/schedule.h"

namespace pirt::cli {
namespace {

/// Of virtual time: some thousand tasks, a millisecond of work or more.
constexpr Nanos kSpan = std::chrono::seconds(10);

struct Planning {
  ScheduleOptions options;
  std::vector<Nanos> times;
  Nanos shortest = Nanos::max();
  std::int64_t tasks = 0;
};

}  // namespace

std::map<std::string, double> time_planning(const Clock& clock, Nanos work,
                                            const std::function<void(Nanos)>& after_each) {
  const Platform platform = load_platform("fake");
  const Mix mix = load_mix("table1-robot");
  const auto names = paper_modes();
  std::vector<Planning> modes(names.size());
  for (std::size_t m = 0; m < names.size(); ++m) {
    modes[m].options.mode = names[m];
    modes[m].options.duration = kSpan;
  }
  const auto once = [&](Planning& mode, bool counts) {
    const Nanos begin = clock.now();
    mode.tasks = run_virtual(platform, nullptr, mix, mode.options).completed;
    const Nanos taken = clock.now() - begin;
    if (!counts) {
      mode.shortest = std::min(mode.shortest, taken);
      return;
    }
    if (after_each) after_each(mode.shortest);
    mode.times.push_back(clock.now() - begin);
  };
  for (int warm_up = 0; warm_up < 3; ++warm_up) {
    for (Planning& mode : modes) once(mode, false);
  }
  const Nanos end = clock.now() + work;
  do {
    for (Planning& mode : modes) once(mode, true);
  } while (clock.now() < end || modes[0].times.size() < 3);
  std::map<std::string, double> seconds;
  for (std::size_t m = 0; m < names.size(); ++m) {
    seconds["schedule " + names[m]] =
        to_s(median(modes[m].times)) /
        static_cast<double>(std::max<std::int64_t>(modes[m].tasks, 1));
  }
  return seconds;
}

}  // namespace pirt::cli
