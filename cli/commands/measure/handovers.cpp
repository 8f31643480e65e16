#include "cli/commands/measure/handovers.h"

#include <vector>

#include "characterize/profile/store/writer.h"
#include "scheduler/runtime/handover.h"
#include "workloads/base/error.h"

namespace pirt::cli {

void measure_handovers(const std::filesystem::path& database, const Profile& profile) {
  const RunInfo& run = profile.runs.front();
  std::vector<HandoverRecord> records;
  for (const UnitRecord& unit : run.units) {
    if (!unit.device_is_cpu) continue;
    for (const HandoverPlan& plan : handover_plans()) {
      HandoverRecord record{.unit = unit.unit, .sleep = plan.sleep, .reasons = {}, .samples = {}};
      try {
        record.samples = measure_handover(unit.cores, plan);
      } catch (const Error& error) {
        record.reasons.push_back(std::string("error: ") + error.what());
      }
      records.push_back(std::move(record));
    }
  }
  if (records.empty()) return;
  ProfileWriter(database).write_handovers(run.run_id, records);
}

}  // namespace pirt::cli
