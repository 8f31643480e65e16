#include "scheduler/schedule_live.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "scheduler/runtime/trace_thread.h"
#include "scheduler/schedule.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

/// What was not as it should be in a live run.
void add_live(const Platform& platform, const LiveResult& result, RunRecord& record) {
  record.set_up_s = to_s(result.set_up);
  if (result.first_call) record.first_call_ms = to_ms(*result.first_call);
  if (result.stopped) {
    record.warnings.push_back("stopped by a signal before its time: all figures are of what ran");
  }
  for (const std::string& problem : result.problems)
    record.warnings.push_back("failed: " + problem);
  const auto told = static_cast<std::int64_t>(result.problems.size());
  if (result.failed_calls > told) {
    record.warnings.push_back("and " + std::to_string(result.failed_calls - told) +
                              " calls more have failed");
  }
  const auto warn_of = [&record](const char* what, const std::vector<std::string>& units) {
    if (!units.empty()) record.warnings.push_back(what + join(units, ", "));
  };
  std::vector<std::string> paced;
  for (const auto& unit : platform.units) {
    if (!unit.measured()) paced.push_back(unit.name);
  }
  warn_of("units without a backend are paced by their stages and compute nothing: ", paced);
  for (UnitResult& unit : record.units) {
    if (std::ranges::count(result.own_clocks, unit.unit) > 0) unit.own_clock = true;
    const auto link = result.links.find(unit.unit);
    if (link == result.links.end()) continue;
    const auto& [round_trip, bytes_per_s, late_replies] = link->second;
    if (round_trip) unit.round_trip_ms = to_ms(*round_trip);
    if (bytes_per_s) unit.link_mbit_s = *bytes_per_s * 8e-6;
    unit.late_replies = late_replies;
  }
  if (record.stalled > 0) {
    warn_of("out of reach at the end, and longer than a call would wait there (patience_s): ",
            result.out_of_reach);
  }
  warn_of(
      "units that tell time by a clock of their own take here what the machine takes for them: ",
      result.own_clocks);
}

}  // namespace

RunRecord run_live(const Platform& platform, const Profile* profile, const Mix& mix,
                   const ScheduleOptions& options, const LiveOptions& live) {
  LiveResult result;
  std::string trace_problem;
  const auto driver = [&](const Scenario& scenario, Dispatcher& dispatcher, TraceWriter* trace) {
    std::optional<TraceThread> aside;
    if (trace != nullptr) dispatcher.observe(&aside.emplace(*trace));
    result = run_live(scenario, dispatcher, live, aside ? &*aside : nullptr);
    try {
      if (aside) aside->finish();
    } catch (const Error& error) {
      trace_problem = error.what();
    }
    return result.tally;
  };
  ScheduleOptions its = options;
  if (!live.prepare_first) {
    if (options.slices == true) {
      throw_bad_input("--slices on: without set-up beforehand (--no-preinit) calls are not left");
    }
    its.slices = false;
  }
  RunRecord record = run_mix(platform, profile, mix, its, driver, "live");
  if (!trace_problem.empty()) record.trace_problem = trace_problem;
  add_live(platform, result, record);
  return record;
}

}  // namespace pirt
