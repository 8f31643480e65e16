#include "cli/commands/measure/unit_times.h"

#include <functional>
#include <vector>

#include "characterize/platform/platform.h"
#include "characterize/profile/store/writer.h"
#include "characterize/worker/reread.h"
#include "scheduler/runtime/handover.h"
#include "scheduler/runtime/leave.h"
#include "workloads/base/error.h"

namespace pirt::cli {
namespace {

constexpr int kLeaves = 200;

using Measure = std::function<std::vector<Nanos>()>;

/// What fails is a row without samples that says why.
UnitTimeRecord measured(const std::string& unit, UnitPhase phase, Nanos sleep,
                        const Measure& measure) {
  UnitTimeRecord record{.unit = unit, .phase = phase, .sleep = sleep, .reasons = {}, .samples = {}};
  try {
    record.samples = measure();
  } catch (const Error& error) {
    record.reasons.push_back(std::string("error: ") + error.what());
  }
  return record;
}

void add_rereads(const UnitRecord& unit, std::vector<UnitTimeRecord>& records) {
  const auto cores = unit.cores.empty() ? usable_cores() : unit.cores;
  if (!Reread::possible(cores)) return;
  Reread reread(cores);
  for (const SleepPlan& plan : Reread::plans()) {
    records.push_back(
        measured(unit.unit, UnitPhase::kReread, plan.sleep, [&] { return reread.after(plan); }));
  }
  records.push_back(
      measured(unit.unit, UnitPhase::kRereadCold, Nanos(0), [&] { return reread.cold(); }));
}

}  // namespace

void measure_unit_times(const std::filesystem::path& database, const Profile& profile) {
  const RunInfo& run = profile.runs.front();
  std::vector<UnitTimeRecord> records;
  for (const UnitRecord& unit : run.units) {
    if (!unit.device_is_cpu) continue;
    for (const SleepPlan& plan : handover_plans()) {
      records.push_back(measured(unit.unit, UnitPhase::kHandover, plan.sleep,
                                 [&] { return measure_handover(unit.cores, plan); }));
    }
    if (unit.backend == "cpu") {
      records.push_back(measured(unit.unit, UnitPhase::kLeave, Nanos(0),
                                 [&] { return measure_leave(unit.cores, kLeaves); }));
    }
    add_rereads(unit, records);
  }
  if (records.empty()) return;
  ProfileWriter(database).write_unit_times(run.run_id, records);
}

}  // namespace pirt::cli
