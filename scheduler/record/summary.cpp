#include "scheduler/record/summary.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <set>
#include <string>
#include <string_view>
#include <system_error>

namespace pirt {
namespace {

std::optional<double> in_ms(const std::optional<Nanos>& time) {
  return time ? std::optional(to_ms(*time)) : std::nullopt;
}

/// Absent where the folder that it is in is gone, or it has no path.
std::optional<std::string> absolute(const std::string& path) {
  std::error_code none;
  const auto file = std::filesystem::absolute(path, none);
  return none ? std::nullopt : std::optional(file.lexically_normal().string());
}

/// Absent for what is shipped.
std::optional<std::string> file_of(const std::string& argument) {
  if (!names_a_file(argument)) return std::nullopt;
  return absolute(argument);
}

/// A record is handed on: "cloud.server=nats://USER:PASSWORD@host".
std::string without_password(std::string setting) {
  const std::string_view key = ".server=";  // Its value may lack the scheme.
  const auto scheme = setting.find("://"), server = setting.find(key), end = setting.rfind('@');
  const auto begin = scheme < end ? scheme + 3 : server < end ? server + key.size() : end;
  if (begin < end && end != std::string::npos) {
    setting.replace(begin, end - begin, "USER:PASSWORD");
  }
  return setting;
}

/// Whether somebody knows what the unit's calls drew, or would draw if it made none.
bool energy_known(const Scenario& run, UnitId unit, const Tally& tally) {
  bool any = false;
  bool some_known = false;
  for (WorkloadId workload = 0; workload < run.services.workloads.size(); ++workload) {
    const Service* service = run.services.find(workload, unit);
    if (service == nullptr) continue;
    any = true;
    some_known = some_known || service->energy_known;
    if (!service->energy_known && tally.calls[workload][unit].count() > 0) return false;
  }
  return some_known || !any;
}

std::optional<double> unit_energy_j(const Scenario& run, UnitId unit, const Tally& tally) {
  if (!energy_known(run, unit, tally)) return std::nullopt;
  const UnitModel& model = run.platform.units[unit];
  const UnitTally& own = tally.units[unit];
  double energy_j =
      model.active_w * to_s(own.powered) + model.standing_w() * to_s(tally.end) + own.own_j;
  if (!model.link.empty())
    energy_j += run.platform.links.at(model.link).active_w * to_s(own.transferring);
  return energy_j;
}

void add_device(const Profile* profile, UnitResult& result) {
  const UnitRecord* device = profile == nullptr ? nullptr : profile->find_unit(result.unit);
  if (device == nullptr) return;
  result.device = device->device;
  result.device_is_cpu = device->device_is_cpu;
}

void add_provenance(const ServiceTable& services, UnitId unit, UnitResult& result) {
  std::set<Provenance> times;
  std::set<Provenance> energies;
  for (WorkloadId workload = 0; workload < services.workloads.size(); ++workload) {
    const Service* service = services.find(workload, unit);
    if (service == nullptr) continue;
    times.insert(service->time_provenance.provenance);
    energies.insert(service->energy_provenance.provenance);
    if (service->time_provenance.mixture) result.mixture = true;
    if (service->energy_provenance.mixture) result.energy_mixture = true;
  }
  for (const Provenance each : times) result.provenance.emplace_back(to_string(each));
  for (const Provenance each : energies) result.energy_provenance.emplace_back(to_string(each));
}

UnitResult summarize_unit(const Scenario& run, const Profile* profile, UnitId unit,
                          const Tally& all) {
  const UnitTally& tally = all.units[unit];
  const Nanos makespan = all.end;
  const UnitModel& model = run.platform.units[unit];
  UnitResult result;
  result.unit = model.name;
  result.role = to_string(model.role);
  if (model.measured()) result.backend = model.backend;
  add_device(profile, result);
  add_provenance(run.services, unit, result);
  result.completed = tally.completed;
  result.mean_latency_ms = in_ms(tally.latency.mean());
  result.p99_latency_ms = in_ms(tally.latency.percentile(0.99));
  result.busy_s = to_s(tally.busy);
  if (model.contexts) {
    result.prepares = tally.prepares;
    result.prepare_s = to_s(tally.preparing);
  }
  if (makespan > Nanos::zero())
    result.utilization = result.busy_s / (model.servers * to_s(makespan));
  result.energy_j = unit_energy_j(run, unit, all);
  return result;
}

PipelineResult summarize_pipeline(const Pipeline& pipeline, const PipelineTally& tally,
                                  bool reads_earlier, Nanos makespan) {
  PipelineResult result;
  result.pipeline = pipeline.name;
  result.fired = tally.fired;
  result.completed = tally.completed;
  result.dropped = tally.dropped;
  result.unfinished = tally.unfinished;
  if (tally.fired > 0 && !tally.ran) result.never_ran = true;
  if (reads_earlier) result.no_predecessor = tally.no_predecessor;
  if (pipeline.rate_hz) result.queued = tally.queued;
  result.real_time = pipeline.real_time;
  if (makespan > Nanos::zero()) {
    result.rate_hz = static_cast<double>(tally.completed) / to_s(makespan);
  }
  result.p50_ms = in_ms(tally.latency.percentile(0.50));
  result.p95_ms = in_ms(tally.latency.percentile(0.95));
  result.p99_ms = in_ms(tally.latency.percentile(0.99));
  if (pipeline.deadline) {
    result.deadline_ms = to_ms(*pipeline.deadline);
    result.deadline_misses = tally.deadline_misses;
  }
  return result;
}

void add_counts(const Scenario& run, const Tally& tally, RunRecord& record) {
  const TaskCounts& counts = tally.tasks;
  record.submitted = counts.submitted + tally.refused_tasks;
  record.completed = counts.completed;
  record.dropped = counts.dropped + tally.refused_tasks;
  record.expired = counts.expired;
  record.failed = counts.failed;
  record.queued = counts.queued();
  if (run.mix.reads_earlier()) record.no_predecessor = counts.no_predecessor;
  record.stalled = tally.stalled;
  for (UnitId unit = 0; unit < tally.units.size(); ++unit) {
    if (run.platform.units[unit].role == Role::kCloud)
      record.offloaded += tally.units[unit].completed;
  }
}

void add_calls(const Scenario& run, const Tally& tally, RunRecord& record) {
  for (std::size_t w = 0; w < tally.calls.size(); ++w) {
    for (UnitId unit = 0; unit < tally.units.size(); ++unit) {
      const Histogram& calls = tally.calls[w][unit];
      if (calls.count() == 0) continue;
      CallResult& result =
          record.calls.emplace_back(CallResult{.workload = run.services.workloads[w],
                                               .unit = run.platform.units[unit].name,
                                               .completed = calls.count(),
                                               .p50_ms = to_ms(*calls.percentile(0.50)),
                                               .p95_ms = to_ms(*calls.percentile(0.95))});
      const auto phases = tally.phases.find({static_cast<WorkloadId>(w), unit});
      if (phases == tally.phases.end()) continue;
      result.upload_ms = in_ms(phases->second.upload.percentile(0.50));
      result.launch_ms = in_ms(phases->second.launch.percentile(0.50));
      result.execute_ms = in_ms(phases->second.execute.percentile(0.50));
      result.download_ms = in_ms(phases->second.download.percentile(0.50));
    }
  }
}

/// What is uncertain of what the run rests on.
void add_doubts(const Scenario& run, RunRecord& record) {
  std::int64_t figures = 0;
  for (WorkloadId workload = 0; workload < run.services.workloads.size(); ++workload) {
    for (UnitId unit = 0; unit < run.platform.units.size(); ++unit) {
      const Service* service = run.services.find(workload, unit);
      if (service == nullptr || !service->of_rows) continue;
      ++figures;
      if (service->doubts.empty()) continue;
      DoubtedFigure figure{.workload = run.services.workloads[workload],
                           .unit = run.platform.units[unit].name,
                           .doubts = service->doubts,
                           .low = service->spread.low,
                           .high = service->spread.high,
                           .taken = {},
                           .wild = {}};
      if (service->taken > 0) figure.taken = service->taken;
      if (service->wild) figure.wild = true;
      record.doubted.push_back(std::move(figure));
    }
  }
  if (figures > 0) record.figures = figures;
}

void add_weights(const Scenario& run, const WeightTable& weights, RunRecord& record) {
  for (WorkloadId workload = 0; workload < weights.size(); ++workload) {
    auto& row = record.weights[run.services.workloads[workload]];
    for (UnitId unit = 0; unit < run.platform.units.size(); ++unit) {
      const auto& model = run.platform.units[unit];
      if (model.role != Role::kCloud && run.services.find(workload, unit) != nullptr)
        row[model.name] = weights[workload][unit];
    }
  }
}

}  // namespace

RunRecord summarize(const Scenario& run, const Profile* profile, const WeightTable& weights,
                    const Tally& tally) {
  const Nanos makespan = tally.end;
  RunRecord record;
  record.platform = run.platform.name;
  record.platform_file = file_of(run.platform.argument);
  if (!run.platform.assumptions.empty()) record.assumptions = run.platform.assumptions;
  std::ranges::transform(run.platform.settings, std::back_inserter(record.settings),
                         without_password);
  if (profile != nullptr) {
    record.profile = profile->path;
    record.profile_file = absolute(profile->path);
  }
  record.mix = run.mix.name;
  record.mix_file = file_of(run.mix.argument);
  record.seed = run.seed;
  if (run.mix.open_loop()) {
    record.duration_s = to_s(tally.end);  // earlier than asked for where the run was stopped
    record.drain_s = to_s(std::max(Nanos::zero(), tally.last_completion - tally.end));
  }
  const int in_flight = std::ranges::max(run.in_flight);
  if (in_flight > 0) record.in_flight = in_flight;
  record.makespan_s = to_s(makespan);
  add_counts(run, tally, record);
  Histogram latency;
  double energy_j = 0;
  bool known = true;
  for (UnitId unit = 0; unit < tally.units.size(); ++unit) {
    record.units.push_back(summarize_unit(run, profile, unit, tally));
    const UnitResult& made = record.units.back();
    energy_j += made.energy_j.value_or(0);
    known = known && (made.energy_j || tally.units[unit].busy == Nanos::zero());
    latency.add(tally.units[unit].latency);
  }
  if (known) record.energy_j = energy_j;
  record.mean_latency_ms = in_ms(latency.mean());
  record.p99_latency_ms = in_ms(latency.percentile(0.99));
  if (makespan > Nanos::zero()) {
    record.throughput_per_ms = static_cast<double>(record.completed) / to_ms(makespan);
    if (known) record.average_power_w = energy_j / record.makespan_s;
  }
  for (std::size_t p = 0; p < run.mix.pipelines.size(); ++p) {
    record.pipelines.push_back(summarize_pipeline(run.mix.pipelines[p], tally.pipelines[p],
                                                  run.mix.reads_earlier(), makespan));
  }
  add_calls(run, tally, record);
  add_doubts(run, record);
  add_weights(run, weights, record);
  return record;
}

}  // namespace pirt
