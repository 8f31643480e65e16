#include "characterize/profile/store/reader.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <tuple>

#include "characterize/machine/environment.h"
#include "characterize/profile/own_rows.h"
#include "characterize/profile/store/database_file.h"
#include "characterize/profile/store/database_format.h"
#include "characterize/profile/store/sqlite.h"
#include "workloads/base/error.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/shell.h"
#include "workloads/base/text/text.h"
#include "workloads/catalog/catalog.h"

namespace pirt {
namespace {

using sqlite::Connection;
using sqlite::Statement;

/// Column `state` holds a condition where it holds no state.
/// The words are known ones: integrity_check has verified the CHECK constraints.
void take_state(const std::string& text, State& state, Condition& condition) {
  condition = condition_from_string(text).value_or(Condition::kSteady);
  state = state_from_string(text).value_or(State::kSteady);
}

PhaseRow read_phase_row(const Statement& q) {
  PhaseRow row;
  row.run_id = q.integer(0);
  row.platform = q.text(1);
  row.workload = q.text(2);
  row.unit = q.text(3);
  row.backend = q.text(4);
  row.phase = phase_from_string(q.text(5)).value();
  take_state(q.text(6), row.state, row.condition);
  row.provenance = provenance_from_string(q.text(7)).value();
  row.reasons = split_words(q.text(8));
  row.notes = split_words(q.text(9));
  row.samples = q.integer(10);
  row.median = q.optional_nanos(11);
  row.mad = q.optional_nanos(12);
  row.p95 = q.optional_nanos(13);
  row.p99 = q.optional_nanos(14);
  row.ci_low = q.optional_nanos(15);
  row.ci_high = q.optional_nanos(16);
  row.ops = q.optional_integer(17);
  row.bytes = q.integer(18);
  row.processes = q.integer(19);
  row.provenance.mixture = q.integer(20) != 0;
  row.bound = q.optional_nanos(21);
  row.cpu = q.optional_nanos(22);
  if (!q.is_null(23)) row.taken = q.real(23);
  row.host_memory_bytes = q.optional_integer(24);
  row.device_memory_bytes = q.optional_integer(25);
  row.doubts = split_words(q.text(26));
  return row;
}

/// Whether @p cell of the enclosing query is one that an interrupted run wrote as far as it was.
std::string is_unfinished(const std::string& cell) {
  return fmt::format(
      "EXISTS (SELECT 1 FROM visit WHERE visit.run_id = {0}.run_id AND visit.workload = "
      "{0}.workload AND visit.unit = {0}.unit)",
      cell);
}

/// Complete cells first, the newest of them before the others. Of each (workload, unit) the rows of
/// calls are those of the first cell met that has any, and so are those of set-ups, which live rows
/// have not, and those of other conditions.
/// @param view  "profile_summary" or "condition_summary".
std::vector<PhaseRow> read_phases(const Connection& connection, const std::string& view,
                                  const std::string& platform, RunRange runs) {
  std::vector<PhaseRow> rows;
  std::map<std::tuple<std::string, std::string, bool>, std::int64_t> chosen;
  Statement query(
      connection,
      "SELECT run_id, platform, workload, unit, backend, phase, state, provenance, "
      "reasons, notes, samples, median_ns, mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns, "
      "ops, bytes, processes, mixture, bound_ns, cpu_ns, taken, host_memory_bytes, "
      "device_memory_bytes, doubts FROM " +
          view + " WHERE platform = ? AND run_id BETWEEN ? AND ? ORDER BY " + is_unfinished(view) +
          ", run_id DESC");
  query.bind(platform).bind(runs.first).bind(runs.last);
  while (query.step()) {
    PhaseRow row = read_phase_row(query);
    const auto [run, is_new] =
        chosen.try_emplace({row.workload, row.unit, is_setup(row.phase)}, row.run_id);
    if (run->second == row.run_id) rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<EnergyRow> read_energies(const Connection& connection, const std::string& platform,
                                     RunRange runs) {
  std::vector<EnergyRow> rows;
  std::set<std::pair<std::string, std::string>> seen;
  Statement query(
      connection,
      "SELECT run_id, workload, unit, energy_j, energy_summary.provenance, source, reasons, "
      "domain, "
      "idle_subtracted, mixture, ci_low_j, ci_high_j, doubts FROM energy_summary JOIN run USING "
      "(run_id) WHERE platform = ? AND run_id BETWEEN ? AND ? ORDER BY " +
          is_unfinished("energy_summary") + ", run_id DESC");
  query.bind(platform).bind(runs.first).bind(runs.last);
  while (query.step()) {
    EnergyRow row;
    row.run_id = query.integer(0);
    row.workload = query.text(1);
    row.unit = query.text(2);
    if (!query.is_null(3)) row.energy_j = query.real(3);
    row.provenance = provenance_from_string(query.text(4)).value();
    row.source = query.text(5);
    row.reasons = split_words(query.text(6));
    row.domain = query.text(7);
    row.idle_subtracted = query.integer(8) != 0;
    row.provenance.mixture = query.integer(9) != 0;
    if (!query.is_null(10)) row.ci_low_j = query.real(10);
    if (!query.is_null(11)) row.ci_high_j = query.real(11);
    row.doubts = split_words(query.text(12));
    if (seen.emplace(row.workload, row.unit).second) rows.push_back(std::move(row));
  }
  return rows;
}

/// Of each unit and phase the newest run's. Times of reading again belong to that after a sweep of
/// the same run, which was measured last: those of a run that did not come to it are taken only if
/// no run did.
std::vector<UnitTimeRow> read_unit_times(const Connection& connection, const std::string& platform,
                                         RunRange runs) {
  std::vector<UnitTimeRow> rows;
  std::map<std::pair<std::string, UnitPhase>, std::int64_t> chosen;
  Statement query(
      connection,
      "SELECT run_id, unit, sleep_ns, doubts, reasons, samples, median_ns, mad_ns, p95_ns, "
      "p99_ns, ci_low_ns, ci_high_ns, phase, backend FROM unit_time_summary WHERE platform = ? "
      "AND run_id BETWEEN ? AND ? ORDER BY phase = 'reread' AND NOT EXISTS (SELECT 1 FROM "
      "unit_time AS cold WHERE cold.run_id = unit_time_summary.run_id AND cold.unit = "
      "unit_time_summary.unit AND cold.phase = 'reread_cold'), run_id DESC");
  query.bind(platform).bind(runs.first).bind(runs.last);
  while (query.step()) {
    UnitTimeRow row;
    row.run_id = query.integer(0);
    row.unit = query.text(1);
    row.sleep = Nanos(query.integer(2));
    row.doubts = split_words(query.text(3));
    row.reasons = split_words(query.text(4));
    row.samples = query.integer(5);
    row.median = query.optional_nanos(6);
    row.mad = query.optional_nanos(7);
    row.p95 = query.optional_nanos(8);
    row.p99 = query.optional_nanos(9);
    row.ci_low = query.optional_nanos(10);
    row.ci_high = query.optional_nanos(11);
    row.phase = unit_phase_from_string(query.text(12)).value();
    row.backend = query.text(13);
    const auto phase = row.phase == UnitPhase::kRereadCold ? UnitPhase::kReread : row.phase;
    const auto [run, is_new] = chosen.try_emplace({row.unit, phase}, row.run_id);
    if (run->second == row.run_id) rows.push_back(std::move(row));
  }
  return rows;
}

/// Those of all runs, newest first.
std::vector<PeakRow> read_peaks(const Connection& connection, const std::string& platform,
                                RunRange runs) {
  std::vector<PeakRow> rows;
  Statement query(connection,
                  "SELECT run_id, unit, kind, per_second, variant, provenance, doubts, reasons "
                  "FROM peak JOIN run USING (run_id) WHERE platform = ? "
                  "AND run_id BETWEEN ? AND ? ORDER BY run_id DESC, unit, kind");
  query.bind(platform).bind(runs.first).bind(runs.last);
  while (query.step()) {
    PeakRow row;
    row.run_id = query.integer(0);
    row.unit = query.text(1);
    row.kind = peak_kind_from_string(query.text(2)).value();
    if (!query.is_null(3)) row.per_second = query.real(3);
    row.variant = query.text(4);
    row.provenance = provenance_from_string(query.text(5)).value();
    row.doubts = split_words(query.text(6));
    row.reasons = split_words(query.text(7));
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<int> parse_cores(const std::string& text) {
  std::vector<int> cores;
  if (text.empty()) return cores;
  for (const auto& part : split(text, ',')) {
    int core = 0;
    std::from_chars(part.data(), part.data() + part.size(), core);
    cores.push_back(core);
  }
  return cores;
}

/// Empty if @p plan is none that this pirt knows.
std::vector<CellName> planned_cells(const std::string& plan) {
  std::vector<CellName> cells;
  const auto json = try_parse_json(plan);
  if (!json || !json->is_object() || !json->contains("cells")) return cells;
  try {
    for (const Json& entry : json->at("cells")) {
      cells.push_back({entry.at(0).get<std::string>(), entry.at(1).get<std::string>()});
    }
  } catch (const JsonError&) {
    cells.clear();
  }
  return cells;
}

RunInfo read_run(const Connection& connection, std::int64_t run_id) {
  RunInfo run;
  run.run_id = run_id;
  Statement head(connection,
                 "SELECT started, finished, platform, seed, plan FROM run WHERE run_id = ?");
  if (!head.bind(run_id).step()) connection.fail_damaged(fmt::format("run {} is missing", run_id));
  run.started = head.text(0);
  run.finished = head.text(1);
  run.platform = head.text(2);
  const std::string seed = head.text(3);
  std::from_chars(seed.data(), seed.data() + seed.size(), run.seed);
  run.planned = planned_cells(head.is_null(4) ? "" : head.text(4));
  Statement facts(connection, "SELECT key, value, kind FROM environment WHERE run_id = ?");
  facts.bind(run_id);
  while (facts.step()) {
    run.environment[facts.text(0)] = facts.text(1);
    if (facts.text(2) == to_string(FactKind::kIdentity)) run.identity.insert(facts.text(0));
  }
  Statement units(connection,
                  "SELECT unit, backend, device, device_is_cpu, cores FROM unit WHERE run_id = ? "
                  "ORDER BY ordinal");
  units.bind(run_id);
  while (units.step()) {
    run.units.push_back({units.text(0), units.text(1), units.text(2), units.integer(3) != 0,
                         parse_cores(units.text(4))});
  }
  return run;
}

/// The platform that is meant: the given one, or that of the newest run which has complete cells,
/// or else cells.
std::string choose_platform(const Connection& connection, std::string_view wished, RunRange runs) {
  std::vector<std::string> known;  // newest first
  Statement query(connection,
                  "SELECT platform FROM run JOIN cell USING (run_id) WHERE run_id BETWEEN ? AND ? "
                  "GROUP BY run_id ORDER BY min(" +
                      is_unfinished("cell") + "), run_id DESC");
  query.bind(runs.first).bind(runs.last);
  while (query.step()) {
    if (std::ranges::find(known, query.text(0)) == known.end()) known.push_back(query.text(0));
  }
  const std::string path = connection.path().string();
  if (known.empty()) {
    Statement kept(connection, "SELECT count(*) FROM visit WHERE run_id BETWEEN ? AND ?");
    kept.bind(runs.first).bind(runs.last).step();
    if (kept.integer(0) > 0) {
      throw_bad_input(fmt::format(
          "profile database '{}' holds no measurements of a whole cell yet; processes kept of a "
          "run that did not end: {}; let it end, or go on with: pirt characterize --resume --db {}",
          path, kept.integer(0), path_in_shell(path)));
    }
    throw_bad_input(fmt::format(
        "profile database '{}' holds no measurements; add some with: pirt characterize --db {}",
        path, path_in_shell(path)));
  }
  if (wished.empty()) return known.front();
  if (std::ranges::find(known, wished) == known.end()) {
    throw_bad_input(fmt::format(
        "profile database '{}' has no run of platform '{}'{}; measure it with: pirt characterize "
        "--db {} --platform {}",
        path, wished, suggestion(wished, known), path_in_shell(path), in_shell(wished)));
  }
  return std::string(wished);
}

/// Table order: workloads as in the catalog (others behind, by name), units as in the runs, phases
/// as they happen.
void sort_rows(Profile& profile) {
  const auto names = workload_names();
  const auto workload_rank = [&names](const std::string& name) {
    const std::string plain = name.substr(0, name.find('@'));  // variants behind their workload
    return std::ranges::find(names, plain) - names.begin();
  };
  std::vector<std::string> units;
  for (const RunInfo& run : profile.runs) {
    for (const UnitRecord& unit : run.units) units.push_back(unit.unit);
  }
  const auto unit_rank = [&units](const std::string& name) {
    return std::ranges::find(units, name) - units.begin();
  };
  for (auto* rows : {&profile.phases, &profile.conditions}) {
    std::ranges::sort(*rows, {}, [&](const PhaseRow& row) {
      return std::tuple(workload_rank(row.workload), row.workload, unit_rank(row.unit), row.phase,
                        row.state, row.condition);
    });
  }
  std::ranges::sort(profile.unit_times, {}, [&](const UnitTimeRow& row) {
    return std::tuple(unit_rank(row.unit), row.unit, row.phase, row.sleep);
  });
  std::ranges::sort(profile.energies, {}, [&](const EnergyRow& row) {
    return std::tuple(workload_rank(row.workload), row.workload, unit_rank(row.unit));
  });
}

}  // namespace

namespace {

struct RowKey {
  std::string workload, unit;
  Phase phase = Phase::kCall;
  State state = State::kSteady;
  Condition condition = Condition::kSteady;
};

/// Null where another run's row stands in the profile.
PhaseRow* row_of(Profile& profile, std::int64_t run_id, const RowKey& key) {
  auto& rows = key.condition == Condition::kSteady ? profile.phases : profile.conditions;
  const auto row = std::ranges::find_if(rows, [&](const PhaseRow& candidate) {
    return candidate.run_id == run_id && candidate.workload == key.workload &&
           candidate.unit == key.unit && candidate.phase == key.phase &&
           candidate.state == key.state && candidate.condition == key.condition;
  });
  return row == rows.end() ? nullptr : &*row;
}

/// Of the processes' means, as mean() of statistics.h has it.
void read_means(const Connection& connection, std::int64_t run_id, Profile& profile) {
  Statement query(connection,
                  "SELECT workload, unit, phase, state, AVG(of_process) FROM "
                  "(SELECT measurement_id, AVG(ns) AS of_process FROM cell "
                  "JOIN measurement USING (cell_id) JOIN sample USING (measurement_id) "
                  "WHERE run_id = ? GROUP BY measurement_id, process) "
                  "JOIN measurement USING (measurement_id) JOIN cell USING (cell_id) "
                  "GROUP BY measurement_id");
  query.bind(run_id);
  while (query.step()) {
    RowKey key{query.text(0), query.text(1), phase_from_string(query.text(2)).value()};
    take_state(query.text(3), key.state, key.condition);
    PhaseRow* row = row_of(profile, run_id, key);
    if (row != nullptr) row->mean = Nanos(std::llround(query.real(4)));
  }
}

std::vector<RowSamples> read_run_samples(const Connection& connection, std::int64_t run_id) {
  Statement exists(connection, "SELECT 1 FROM run WHERE run_id = ?");
  if (!exists.bind(run_id).step()) return {};
  Statement query(connection,
                  "SELECT measurement_id, workload, unit, phase, state, ns, process FROM cell "
                  "JOIN measurement USING (cell_id) JOIN sample USING (measurement_id) "
                  "WHERE run_id = ? ORDER BY measurement_id, position");
  query.bind(run_id);
  std::vector<RowSamples> rows;
  std::optional<std::int64_t> current;
  while (query.step()) {
    if (current != query.integer(0)) {
      current = query.integer(0);
      RowSamples row;
      row.workload = query.text(1);
      row.unit = query.text(2);
      row.phase = phase_from_string(query.text(3)).value();
      take_state(query.text(4), row.state, row.condition);
      rows.push_back(std::move(row));
    }
    rows.back().samples.push_back(Nanos(query.integer(5)));
    rows.back().processes.push_back(static_cast<std::int32_t>(query.integer(6)));
  }
  return rows;
}

/// While it lives, all reading sees one state of the file, though somebody may be appending a run.
class Snapshot {
 public:
  explicit Snapshot(Connection& connection) : connection_(connection) { connection_.run("BEGIN"); }
  ~Snapshot() { sqlite3_exec(connection_.handle(), "ROLLBACK", nullptr, nullptr, nullptr); }
  Snapshot(const Snapshot&) = delete;
  Snapshot& operator=(const Snapshot&) = delete;

 private:
  Connection& connection_;
};

}  // namespace

ProfileReader::ProfileReader(const std::filesystem::path& path)
    : connection_(std::make_unique<Connection>(open_database(path, Connection::Mode::kReadOnly))) {}

ProfileReader::~ProfileReader() = default;

Profile ProfileReader::read(std::string_view platform, RunRange runs) const {
  const Snapshot snapshot(*connection_);
  const std::string chosen = choose_platform(*connection_, platform, runs);
  Profile profile;
  profile.path = connection_->path().string();
  profile.phases = read_phases(*connection_, "profile_summary", chosen, runs);
  profile.conditions = read_phases(*connection_, "condition_summary", chosen, runs);
  profile.unit_times = read_unit_times(*connection_, chosen, runs);
  profile.energies = read_energies(*connection_, chosen, runs);
  for (PeakRow& row : read_peaks(*connection_, chosen, runs)) {
    const bool is_newest = profile.find_peak(row.unit, row.kind) == nullptr;
    (is_newest ? profile.peaks : profile.earlier_peaks).push_back(std::move(row));
  }
  std::set<std::int64_t, std::greater<>> run_ids;
  for (const PhaseRow& row : profile.phases) run_ids.insert(row.run_id);
  for (const PhaseRow& row : profile.conditions) run_ids.insert(row.run_id);
  for (const UnitTimeRow& row : profile.unit_times) run_ids.insert(row.run_id);
  for (const EnergyRow& row : profile.energies) run_ids.insert(row.run_id);
  for (const PeakRow& row : profile.peaks) run_ids.insert(row.run_id);
  for (const std::int64_t run_id : run_ids) {
    profile.runs.push_back(read_run(*connection_, run_id));
  }
  for (const RunInfo& run : profile.runs) read_means(*connection_, run.run_id, profile);
  sort_rows(profile);
  learn_workloads(profile);
  doubt_older(profile);
  return profile;
}

std::string ProfileReader::newest_platform() const {
  Statement query(*connection_,
                  "SELECT platform FROM run ORDER BY finished IS NULL, run_id DESC LIMIT 1");
  return query.step() ? query.text(0) : "";
}

std::vector<std::int64_t> ProfileReader::finished_runs(std::string_view platform) const {
  Statement query(*connection_,
                  "SELECT run_id FROM run WHERE platform = ? AND finished IS NOT NULL "
                  "ORDER BY run_id DESC");
  query.bind(platform);
  std::vector<std::int64_t> ids;
  while (query.step()) ids.push_back(query.integer(0));
  return ids;
}

std::vector<RunInfo> ProfileReader::unfinished_runs(std::string_view platform) const {
  Statement query(*connection_,
                  "SELECT run_id FROM run WHERE platform = ? AND finished IS NULL AND plan IS NOT "
                  "NULL ORDER BY run_id DESC");
  query.bind(platform);
  std::vector<RunInfo> runs;
  while (query.step()) runs.push_back(read_run(*connection_, query.integer(0)));
  return runs;
}

void ProfileReader::read_samples(Profile& profile) const {
  const Snapshot snapshot(*connection_);
  for (const RunInfo& run : profile.runs) {
    for (RowSamples& each : read_run_samples(*connection_, run.run_id)) {
      PhaseRow* row = row_of(profile, run.run_id,
                             {each.workload, each.unit, each.phase, each.state, each.condition});
      if (row == nullptr) continue;
      if (row->samples != std::ssize(each.samples)) {
        throw_environment(fmt::format(
            "profile database '{}' was written while it was read: {} on {} has other samples now; "
            "run again",
            profile.path, each.workload, each.unit));
      }
      row->values = std::move(each.samples);
      row->value_processes = std::move(each.processes);
    }
  }
  for (UnitTimeRow& row : profile.unit_times) {
    Statement query(*connection_,
                    "SELECT ns FROM unit_time JOIN unit_time_sample USING (unit_time_id) WHERE "
                    "run_id = ? AND unit = ? AND phase = ? AND sleep_ns = ? ORDER BY position");
    query.bind(row.run_id).bind(row.unit).bind(to_string(row.phase)).bind(row.sleep);
    while (query.step()) row.values.emplace_back(query.integer(0));
  }
}

Profile load_profile(const std::filesystem::path& path, std::string_view platform, RunRange runs) {
  return ProfileReader(path).read(platform, runs);
}

namespace {

std::vector<std::pair<CellName, VisitRecord>> read_visits(const Connection& connection,
                                                          std::int64_t run_id) {
  std::vector<std::pair<CellName, VisitRecord>> visits;
  Statement query(connection,
                  "SELECT workload, unit, position, setup, record, checksum FROM visit "
                  "WHERE run_id = ? ORDER BY workload, unit, position");
  query.bind(run_id);
  while (query.step()) {
    const CellName cell{query.text(0), query.text(1)};
    const State setup = query.text(3) == to_string(State::kCold) ? State::kCold : State::kWarm;
    const VisitRecord visit{query.integer(2), setup, query.text(4)};
    if (query.integer(5) != visit_checksum(run_id, cell, visit)) {
      connection.fail_damaged(fmt::format("checksum of process {} of {} on {} in run {}",
                                          visit.position, cell.workload, cell.unit, run_id));
    }
    visits.emplace_back(cell, visit);
  }
  return visits;
}

}  // namespace

std::optional<UnfinishedRun> find_unfinished_run(const std::filesystem::path& path) {
  const auto connection = open_database(path, Connection::Mode::kReadOnly);
  Statement newest(
      connection,
      "SELECT run_id, plan, checksum FROM run WHERE finished IS NULL AND plan IS NOT NULL "
      "ORDER BY run_id DESC LIMIT 1");
  if (!newest.step()) return std::nullopt;
  UnfinishedRun found;
  found.run = read_run(connection, newest.integer(0));
  found.plan = newest.text(1);
  found.checksum = newest.integer(2);
  const auto spent = found.run.environment.find(std::string(kSpent));
  if (spent != found.run.environment.end()) {
    found.spent = Nanos(std::llround(1e9 * std::strtod(spent->second.c_str(), nullptr)));
  }
  const RunRange own{found.run.run_id, found.run.run_id};
  found.peaks = read_peaks(connection, found.run.platform, own);
  found.unit_times = read_unit_times(connection, found.run.platform, own);
  found.visits = read_visits(connection, found.run.run_id);
  Statement cells(connection,
                  "SELECT workload, unit FROM cell WHERE run_id = ? AND NOT EXISTS (SELECT 1 FROM "
                  "visit WHERE visit.run_id = cell.run_id AND visit.workload = cell.workload AND "
                  "visit.unit = cell.unit) ORDER BY cell_id");
  cells.bind(found.run.run_id);
  while (cells.step()) found.done.push_back({cells.text(0), cells.text(1)});
  return found;
}

std::vector<RowSamples> load_samples(const std::filesystem::path& path, std::int64_t run_id) {
  return read_run_samples(open_database(path, Connection::Mode::kReadOnly), run_id);
}

}  // namespace pirt
