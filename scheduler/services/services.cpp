#include "scheduler/services/services.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <set>

#include "characterize/platform/elsewhere.h"
#include "workloads/backends/backend_list.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/specs.h"

namespace pirt {
namespace {

constexpr std::array<std::string_view, 3> kDraws = {"median", "p95", "samples"};

constexpr Phase kCallPhases[] = {Phase::kUpload, Phase::kLaunch, Phase::kExecute, Phase::kDownload};

/// Everything that one cell is made of.
struct Cell {
  const Platform& platform;
  const Profile* profile;
  const WorkloadSpec& workload;
  UnitId unit_id;
  const ServiceOptions& options;

  [[nodiscard]] const UnitModel& unit() const { return platform.units[unit_id]; }
  [[nodiscard]] const WorkloadModel* model() const {
    const auto it = platform.workloads.find(workload.name);
    return it == platform.workloads.end() ? nullptr : &it->second;
  }
};

std::optional<Service> from_platform(const Cell& cell) {
  const auto* model = cell.model();
  if (model == nullptr) return std::nullopt;
  const auto stages = model->stages.find(cell.unit().name);
  if (stages == model->stages.end()) return std::nullopt;
  Service service;
  service.time_provenance = model->provenance;
  service.energy_provenance = weakest(model->provenance, cell.unit().energy_provenance);
  if (cell.platform.watts_set) service.energy_provenance = Provenance::kModelled;
  const auto& units = cell.platform.units;
  for (const auto& stage : stages->second) {
    service.stages.push_back({.name = stage.name, .on = std::nullopt, .time = stage.time});
    const auto on = std::ranges::find(units, stage.on, &UnitModel::name);
    if (on != units.end()) service.stages.back().on = static_cast<UnitId>(on - units.begin());
  }
  return service;
}

/// The rows of one call on one unit.
struct CallRows {
  std::vector<const PhaseRow*>
      stages;  ///< Its phases, or the call as a whole where they are not told apart.
  const PhaseRow* whole = nullptr;  ///< The call as a whole; null if there is no such row.
};

CallRows call_rows(const Cell& cell) {
  const auto find = [&](Phase phase) {
    return cell.profile->find(cell.workload.name, cell.unit().name, phase);
  };
  CallRows rows;
  rows.whole = find(Phase::kCall);
  if (find(Phase::kExecute) != nullptr) {
    // What is moved over a link that the platform gives is counted there, and not again.
    const bool linked = is_elsewhere(cell.unit()) && !cell.unit().link.empty();
    for (const Phase phase : kCallPhases) {
      const auto* const row = find(phase);
      if (row != nullptr && !(linked && draws_in(cell.unit(), phase))) rows.stages.push_back(row);
    }
  } else if (rows.whole != nullptr) {
    rows.stages.push_back(rows.whole);
  }
  return rows;
}

/// Why a row cannot be used, or "".
std::string complaint(const PhaseRow& row, bool strict) {
  const std::string phase(to_string(row.phase));
  if (const std::string why = row.unknown(); !why.empty())
    return "its " + phase + " is unknown: " + why;
  if (!row.median)
    return "its " + phase + " row has no samples" +
           (row.reasons.empty() ? "" : " (" + join(row.reasons, ", ") + ")");
  if (!is_used(row)) return "its " + phase + " row is invalid (" + join(row.reasons, ", ") + ")";
  if (!is_used(row, strict)) {
    return "its " + phase + " row is doubted (" + join(row.doubts, ", ") +
           "), which --strict refuses";
  }
  return "";
}

/// Relative to the median; absent where the row has no interval.
std::optional<Service::Spread> spread_of(const PhaseRow& row) {
  if (!row.ci_low || !row.ci_high || *row.median <= Nanos::zero()) return std::nullopt;
  return Service::Spread{to_s(*row.ci_low) / to_s(*row.median),
                         to_s(*row.ci_high) / to_s(*row.median)};
}

Service::Spread spread_of(const EnergyRow& row) {
  if (!row.ci_low_j || !row.ci_high_j || *row.energy_j <= 0) return {};
  return {*row.ci_low_j / *row.energy_j, *row.ci_high_j / *row.energy_j};
}

/// Of fewer than 3 processes: the widest of the unit's.
Service::Spread widest_spread(const Profile& profile, const std::string& unit) {
  Service::Spread widest;
  for (const PhaseRow& row : profile.phases) {
    if (row.unit != unit || row.phase != Phase::kCall || !is_used(row) || !row.median) continue;
    const auto spread = spread_of(row);
    if (!spread) continue;
    widest = {std::min(widest.low, spread->low), std::max(widest.high, spread->high)};
  }
  return widest;
}

void take_doubts(const PhaseRow& row, Service& service) {
  for (const std::string& doubt : row.doubts) {
    if (std::ranges::find(service.doubts, doubt) == service.doubts.end()) {
      service.doubts.push_back(doubt);
    }
  }
  service.taken = std::max(service.taken, row.taken.value_or(0));
}

double energy_scale(const PhaseRow& row, const Distribution& time) {
  const Nanos taken = time.mean();
  return row.mean && taken > Nanos::zero() ? to_s(*row.mean) / to_s(taken) : 1;
}

ServiceEntry from_rows(const Cell& cell, const CallRows& rows, std::vector<std::string>& warnings) {
  const std::string where = cell.workload.name + " on " + cell.unit().name;
  auto judged = rows.stages;
  if (rows.whole != nullptr && rows.whole != judged.front()) judged.push_back(rows.whole);
  for (const auto* row : judged) {
    const std::string problem = complaint(*row, cell.options.strict);
    if (problem.empty()) continue;
    warnings.push_back(fmt::format("{} is not used: {}", where, problem));
    return {.service = std::nullopt, .reason = problem};
  }
  Service service;
  service.of_rows = true;
  const PhaseRow& any = *rows.stages.front();
  service.memory_bytes = any.device_memory_bytes ? any.device_memory_bytes : any.host_memory_bytes;
  service.time_provenance = rows.stages.front()->provenance;
  for (const auto* row : rows.stages) {
    const Distribution time = time_of(*row, cell.options.draw);
    service.stages.push_back(
        {.name = std::string(to_string(row->phase)),
         .on = cell.unit_id,
         .time = time,
         .energy_scale = draws_in(cell.unit(), row->phase) || row->phase == Phase::kCall
                             ? energy_scale(*row, time)
                             : 0,
         .p95 = usual_worst_of(*row)});
    service.time_provenance = sum_of(service.time_provenance, row->provenance);
  }
  for (const auto* row : judged) take_doubts(*row, service);
  // Of a whole call it matters between what that lies, not each of its phases.
  service.wild =
      rows.whole != nullptr
          ? rows.whole->is_wild()
          : std::ranges::any_of(rows.stages, [](const auto* row) { return row->is_wild(); });
  const PhaseRow& call = rows.whole != nullptr ? *rows.whole : *rows.stages.front();
  service.spread = spread_of(call).value_or(widest_spread(*cell.profile, cell.unit().name));
  service.conditions = call_conditions(*cell.profile, cell.workload.name, cell.unit().name,
                                       cell.workload.bytes, cell.options.draw, cell.options.strict);
  service.energy_provenance = weakest(cell.unit().energy_provenance, service.time_provenance);
  if (cell.platform.watts_set) service.energy_provenance = Provenance::kModelled;
  const auto* energy = cell.profile->find_energy(cell.workload.name, cell.unit().name);
  // Modelled joules are modelled anew, so that watts given for this run count.
  if (energy != nullptr && energy->energy_j && energy->provenance == Provenance::kMeasured) {
    if (is_used(*energy, cell.options.strict)) {
      service.metered_j = *energy->energy_j;
      service.joules = spread_of(*energy);
      service.energy_provenance = Provenance::kMeasured;
    } else {
      warnings.push_back(where + ": its metered energy is not used (" +
                         join(held_against(*energy), ", ") + ")");
    }
  }
  return {.service = std::move(service), .reason = ""};
}

std::string why_none(const Cell& cell) {
  if (!cell.unit().measured()) return "the platform file has no stages for it";
  return cell.profile == nullptr ? "no profile given" : "not in profile " + cell.profile->path;
}

void add_energy(const Cell& cell, Service& service, std::vector<std::string>& warnings) {
  const auto& unit = cell.unit();
  if (const auto* model = cell.model(); model != nullptr && model->call_j.contains(unit.name)) {
    service.extra_j += model->call_j.at(unit.name);
  }
  service.extra_j += unit.call_j;
  service.extra_j += unit.byte_pj * 1e-12 * static_cast<double>(cell.workload.bytes);
  if (cell.workload.ops) {
    service.extra_j += unit.op_pj * 1e-12 * static_cast<double>(*cell.workload.ops);
  } else if (unit.op_pj > 0 && !service.metered_j) {
    warnings.push_back(
        cell.workload.name + " on " + unit.name +
        ": its operations depend on the data, so that op_pj adds nothing to its energy");
  }
}

void scale_stages(const Cell& cell, Service& service) {
  for (auto& stage : service.stages) {
    const auto scale = cell.options.stage_scale.find(cell.unit().name + "." + stage.name);
    if (scale != cell.options.stage_scale.end()) stage.scale = scale->second;
  }
}

/// Preparing ends with a call, which the task makes itself.
void add_context(const Cell& cell, ServiceEntry& entry) {
  if (const auto given = cell.unit().contexts->prepare) {
    entry.service->prepare = given;
    return;
  }
  const PhaseRow* prepare =
      cell.profile == nullptr
          ? nullptr
          : cell.profile->find(cell.workload.name, cell.unit().name, Phase::kPrepare, State::kWarm);
  std::string why = "no profile has its warm prepare";
  if (prepare != nullptr) why = complaint(*prepare, cell.options.strict);
  if (why.empty()) {
    take_doubts(*prepare, *entry.service);
    entry.service->prepare = std::max(Nanos(0), *prepare->median - entry.service->total());
    entry.service->time_provenance = weakest(entry.service->time_provenance, prepare->provenance);
    return;
  }
  entry = {.service = std::nullopt,
           .reason = why + "; give `contexts: {prepare_ms: N}` in the platform file"};
}

ServiceEntry resolve(const Cell& cell, std::vector<std::string>& warnings) {
  ServiceEntry entry;
  const auto rows = cell.profile == nullptr ? CallRows{} : call_rows(cell);
  if (!rows.stages.empty()) {
    entry = from_rows(cell, rows, warnings);
  } else {
    entry.service = from_platform(cell);
    if (!entry.service) entry.reason = why_none(cell);
  }
  if (entry.service && cell.unit().contexts) add_context(cell, entry);
  if (entry.service) {
    scale_stages(cell, *entry.service);
    add_energy(cell, *entry.service, warnings);
    if (cell.options.slices && can_suspend_calls(cell.unit())) {
      entry.service->slices = cell.workload.slices;
    }
  }
  return entry;
}

/// One stage on the unit itself.
ServiceEntry from_mix(const std::map<UnitId, Nanos>& times, UnitId unit) {
  const auto time = times.find(unit);
  if (time == times.end()) return {.service = std::nullopt, .reason = "not in its service_ms"};
  Service service;
  service.stages.push_back(
      {.name = "service", .on = unit, .time = Distribution::constant(time->second)});
  return {.service = std::move(service), .reason = ""};
}

}  // namespace

std::vector<std::string> draw_names() { return {kDraws.begin(), kDraws.end()}; }

std::string_view to_string(Draw draw) { return kDraws[static_cast<std::size_t>(draw)]; }

Draw find_draw(const std::string& name) {
  const auto found = std::ranges::find(kDraws, name);
  if (found == kDraws.end()) {
    throw_bad_input("unknown --draw '" + name + "'" + suggestion(name, draw_names()));
  }
  return static_cast<Draw>(found - kDraws.begin());
}

Nanos usual_worst_of(const Distribution& time) {
  if (time.kind != Distribution::Kind::kSamples) return time.high;
  std::vector<Nanos> samples = *time.samples;
  const auto place =
      samples.begin() + static_cast<std::ptrdiff_t>((samples.size() * 95 + 99) / 100 - 1);
  std::ranges::nth_element(samples, place);
  return *place;
}

Nanos ServiceStage::mean() const {
  const Nanos time_at_rate_1 = time.mean();
  return scale == 1 ? time_at_rate_1 : scaled(time_at_rate_1, scale);
}

Nanos ServiceStage::usual() const {
  return std::max(usual_worst_of(time), p95.value_or(Nanos::zero()));
}

Nanos Service::total() const {
  Nanos sum{0};
  for (const auto& stage : stages) sum += stage.mean();
  return sum;
}

UnitMask ServiceTable::units_of(WorkloadId workload) const {
  return units_where(entries[workload],
                     [](const ServiceEntry& entry) { return entry.service.has_value(); });
}

bool can_suspend_calls(const UnitModel& unit) {
  const bool one_at_a_time = unit.servers == 1 && unit.discipline == Discipline::kFifo &&
                             unit.slots.value_or(unit.measured() ? 1 : 0) == 1;
  return one_at_a_time && !unit.contexts && !is_elsewhere(unit) && unit.role != Role::kCloud &&
         (!unit.measured() || leaves_calls_of(unit.backend));
}

std::uint32_t context_of(const Contexts& contexts, WorkloadId workload, const std::string& name) {
  const auto program = contexts.program_of(name);
  return static_cast<std::uint32_t>(program ? *program : contexts.programs.size() + workload);
}

namespace {

/// Whether anybody says what calls on the unit draw, if no meter has seen them. A unit that is made
/// of rows of @p profile alone, which others have published, has no watts by its model either.
bool states_power(const Platform& platform, const UnitModel& unit, const Profile* profile) {
  const bool of_rows =
      profile != nullptr &&
      std::ranges::find(profile->phases, unit.name, &PhaseRow::unit) != profile->phases.end() &&
      std::ranges::none_of(platform.workloads, [&unit](const auto& entry) {
        return entry.second.stages.contains(unit.name);
      });
  return (!unit.measured() && !of_rows) || platform.states_power(unit);
}

void warn_of_power(const Platform& platform, const Profile* profile,
                   std::vector<std::string>& warnings) {
  for (const UnitModel& unit : platform.units) {
    const UnitRecord* device = profile == nullptr ? nullptr : profile->find_unit(unit.name);
    const bool idles_unknown = device != nullptr && !device->device_is_cpu &&
                               unit.watts_of_host_cores && !unit.idle_set && unit.idle_w == 0;
    if (states_power(platform, unit, profile)) continue;
    const bool metered =
        profile != nullptr && std::ranges::any_of(profile->energies, [&unit](const EnergyRow& row) {
          return row.unit == unit.name && is_used(row);
        });
    if (metered && idles_unknown) {
      warnings.push_back(fmt::format(
          "what {} draws idle is not known, and nothing is counted for it; give it with --set "
          "{}.idle_w=W",
          unit.name, unit.name));
    }
    if (metered) continue;
    warnings.push_back(fmt::format(
        "the energy of {} is not known, nor that of a run that uses it: the platform states no "
        "power{}; give it with --set {}.active_w=W",
        unit.name, unit.watts_of_host_cores ? kOfItsDevice : "", unit.name));
  }
}

/// What is used all the same, once for all.
void warn_of_uncertain_joules(const Platform& platform, const Profile& profile,
                              ServiceTable& table) {
  int figures = 0;
  std::set<std::string> words, units;
  for (WorkloadId workload = 0; workload < table.workloads.size(); ++workload) {
    for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
      const Service* service = table.find(workload, unit);
      if (service == nullptr || !service->metered_j) continue;
      const std::string& name = platform.units[unit].name;
      const EnergyRow* row = profile.find_energy(table.workloads[workload], name);
      if (row == nullptr || !is_doubted(*row)) continue;
      ++figures;
      units.insert(name);
      for (const std::string& doubt : row->doubts) words.insert(doubt.substr(0, doubt.find(':')));
    }
  }
  if (figures == 0) return;
  table.warnings.push_back(
      fmt::format("{} figures of metered energy are uncertain ({}), and used as they are: of {}",
                  figures, join(std::vector(words.begin(), words.end()), ", "),
                  join(std::vector(units.begin(), units.end()), ", ")));
}

/// What --strict refuses beside calls shows nowhere: without it there is just no such effect.
void warn_of_refused(const Platform& platform, const Profile& profile,
                     const std::vector<std::string>& workloads,
                     std::vector<std::string>& warnings) {
  int refused = 0;
  std::set<std::string> units;
  const auto consider = [&](const auto& row) {
    if (!is_doubted(row)) return;
    if (std::ranges::find(platform.units, row.unit, &UnitModel::name) == platform.units.end()) {
      return;
    }
    ++refused;
    units.insert(row.unit);
  };
  for (const PhaseRow& row : profile.conditions) {
    if (std::ranges::find(workloads, row.workload) != workloads.end()) consider(row);
  }
  for (const UnitTimeRow& row : profile.unit_times) consider(row);
  if (refused == 0) return;
  warnings.push_back(
      fmt::format("--strict: figures of other conditions and of units beside their calls that are "
                  "uncertain are counted as nothing: {}, of {}",
                  refused, join(std::vector(units.begin(), units.end()), ", ")));
}

}  // namespace

ServiceTable resolve_services(const Platform& platform, const Profile* profile,
                              const std::vector<std::string>& workloads,
                              const ServiceOptions& options) {
  if (profile != nullptr && profile->platform() != platform.name) {
    throw_bad_input("profile " + profile->path + " was taken on platform " + profile->platform() +
                    ", not on " + platform.name + "; give --platform " + profile->platform());
  }
  for (const auto& unit : options.without) static_cast<void>(platform.unit(unit));
  ServiceTable table;
  table.workloads = workloads;
  warn_of_power(platform, profile, table.warnings);
  if (profile != nullptr && options.strict) {
    warn_of_refused(platform, *profile, workloads, table.warnings);
  }
  if (profile != nullptr && !(profile->conditions.empty() && profile->unit_times.empty())) {
    for (const UnitModel& unit : platform.units) {
      table.units.push_back(unit_conditions(*profile, unit, options.draw, options.strict));
    }
  }
  for (const auto& name : workloads) {
    auto& row = table.entries.emplace_back();
    const auto given = options.given.find(name);
    const auto workload =
        given == options.given.end() ? std::optional(find_spec(name)) : std::nullopt;
    for (UnitId unit = 0; unit < platform.units.size(); ++unit) {
      if (std::ranges::find(options.without, platform.units[unit].name) != options.without.end()) {
        row.push_back({.service = std::nullopt, .reason = "left out by --without"});
        continue;
      }
      row.push_back(!workload
                        ? from_mix(given->second, unit)
                        : resolve({platform, profile, *workload, unit, options}, table.warnings));
      if (!row.back().service) continue;
      Service& service = *row.back().service;
      service.energy_known =
          service.metered_j || states_power(platform, platform.units[unit], profile);
    }
  }
  if (profile != nullptr) warn_of_uncertain_joules(platform, *profile, table);
  return table;
}

}  // namespace pirt
