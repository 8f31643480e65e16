#include "characterize/campaign/live_rows.h"

#include <algorithm>

#include "characterize/campaign/run_facts.h"
#include "characterize/campaign/validity.h"
#include "characterize/energy/model.h"
#include "characterize/profile/own_rows.h"
#include "characterize/statistics/statistics.h"
#include "workloads/catalog/catalog.h"
#include "workloads/inputs/pictures/images.h"

namespace pirt {
namespace {

constexpr double kPrecision = 0.02;  // As characterize asks for.

/// What is too short for the clock shows in the call, which phases add up to.
constexpr ClockQuality kNotJudged{.cost_ns = 0, .resolution = Nanos(0)};

/// @param known  What is alike for all phases of the cell.
PhaseRecord phase_record(Phase phase, const std::vector<Nanos>& samples,
                         const CellConditions& known, const ClockQuality& clock) {
  CellSamples taken;
  taken.phase = phase;
  taken.samples = samples;
  taken.processes.assign(samples.size(), 0);
  CellConditions conditions = known;
  conditions.clock = phase == Phase::kCall ? clock : kNotJudged;
  PhaseRecord record;
  record.phase = phase;
  hold_against(record, judge(taken, conditions));
  record.notes = annotate(taken, conditions, kPrecision);
  record.samples = samples;
  return record;
}

}  // namespace

std::int64_t write_live_rows(ProfileWriter& writer, const Platform& platform,
                             const std::map<std::string, DeviceInfo>& devices, std::uint64_t seed,
                             std::span<const LiveRow> rows) {
  const auto images = generated_images(seed);
  RunHeader header;
  header.started = utc_now();
  header.platform = platform.name;
  header.seed = seed;
  header.environment = run_facts(platform, *images);
  header.environment["mode"] = "live";
  header.environment["precision"] = "live";  // Is identity: keeps it apart from what is repeated.
  for (const auto& [name, device] : devices) {
    const UnitModel& unit = platform.unit(name);
    header.units.push_back(unit_record(unit, device));
    header.environment.merge(unit_facts(unit, device));
  }
  for (const LiveRow& row : rows) {
    header.environment.merge(own_facts(find_workload(row.replaced.workload)));
  }
  const std::int64_t run_id = writer.begin_run(header);
  const ClockQuality clock = measure_clock(MachineClock());
  for (const LiveRow& row : rows) {
    const PhaseRow& replaced = row.replaced;
    CellRecord cell;
    cell.workload = replaced.workload;
    cell.unit = replaced.unit;
    cell.ops = replaced.ops;
    cell.bytes = replaced.bytes;
    cell.host_memory_bytes = replaced.host_memory_bytes;
    cell.device_memory_bytes = replaced.device_memory_bytes;
    cell.verification = "not verified: calls of a live run";
    const std::vector<Nanos>& calls = row.samples.at(Phase::kCall);
    CellConditions known;
    known.unstable = is_unstable(calls);
    known.live = true;
    if (!calls.empty()) known.call = median(calls);
    for (const auto& [phase, samples] : row.samples) {
      cell.phases.push_back(phase_record(phase, samples, known, clock));
    }
    if (!row.metered) {
      const auto call = std::ranges::find(cell.phases, Phase::kCall, &PhaseRecord::phase);
      const UnitModel unit = on_device(platform.unit(cell.unit), devices.at(cell.unit).is_cpu);
      cell.energy = model_energy(platform, unit, find_workload(cell.workload), *call,
                                 CallWork{cell.ops, cell.bytes}, cell.phases);
    }
    writer.write_cell(run_id, cell);
  }
  writer.finish_run(run_id, utc_now());
  return run_id;
}

}  // namespace pirt
