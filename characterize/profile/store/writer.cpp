#include "characterize/profile/store/writer.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cmath>
#include <set>

#include "characterize/machine/environment.h"
#include "characterize/profile/store/database_file.h"
#include "characterize/profile/store/database_format.h"
#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/sqlite.h"
#include "characterize/statistics/statistics.h"
#include "workloads/base/error.h"
#include "workloads/base/system/file_descriptor.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using sqlite::Connection;
using sqlite::Statement;
using sqlite::Transaction;

Connection open_or_create(const std::filesystem::path& path, const FileWait& waiting) {
  std::error_code failed;  // which opening it explains
  const auto made = follow_links(path);
  const auto status = std::filesystem::symlink_status(made, failed);
  if (status.type() == std::filesystem::file_type::not_found) create_database(made);
  return open_database(path, Connection::Mode::kReadWrite, waiting);
}

std::string join_cores(const std::vector<int>& cores) {
  return fmt::format("{}", fmt::join(cores, ","));
}

void insert_samples(const Connection& connection, std::int64_t id, const PhaseRecord& record) {
  const auto processes = processes_of(record);
  Statement insert(connection,
                   "INSERT INTO sample (measurement_id, position, ns, process, cpu_ns) "
                   "VALUES (?, ?, ?, ?, ?)");
  const bool has_cpu = record.cpu.size() == record.samples.size();
  for (std::size_t i = 0; i < record.samples.size(); ++i) {
    insert.bind(id).bind(static_cast<std::int64_t>(i)).bind(record.samples[i]);
    insert.bind(std::int64_t{processes[i]});
    insert.bind(has_cpu ? std::optional(record.cpu[i]) : std::nullopt).run();
  }
}

/// From median_ns to ci_high_ns; NULL where there are no samples.
void bind_statistics(const std::optional<Statistics>& s, Statement& insert) {
  const auto of = [&s](Nanos Statistics::*member) {
    return s ? std::optional((*s).*member) : std::nullopt;
  };
  insert.bind(of(&Statistics::median)).bind(of(&Statistics::mad));
  insert.bind(of(&Statistics::p95)).bind(of(&Statistics::p99));
  const auto interval = s ? s->interval : std::nullopt;
  insert.bind(interval ? std::optional(interval->low) : std::nullopt);
  insert.bind(interval ? std::optional(interval->high) : std::nullopt);
}

void insert_phase(const Connection& connection, std::int64_t cell_id, const PhaseRecord& record) {
  assert((!record.samples.empty() || !record.reasons.empty()) &&
         "a row without samples needs a reason");
  std::optional<Statistics> s;
  std::optional<Nanos> cpu;
  if (!record.samples.empty()) {
    s = statistics_of(record);
    if (record.cpu.size() == record.samples.size()) {
      cpu = median(record.cpu, processes_of(record));
    }
  }
  Statement insert(
      connection,
      "INSERT INTO measurement (cell_id, phase, state, provenance, valid, reasons, notes, "
      "samples, processes, median_ns, mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns, mixture, "
      "bound_ns, cpu_ns, taken, doubts) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, "
      "?, ?, ?)");
  const bool other = record.condition != Condition::kSteady;
  insert.bind(cell_id).bind(to_string(record.phase));
  insert.bind(other ? to_string(record.condition) : to_string(record.state));
  insert.bind(to_string(record.provenance)).bind(std::int64_t{is_valid(record)});
  insert.bind(join_words(record.reasons)).bind(join_words(record.notes));
  insert.bind(static_cast<std::int64_t>(record.samples.size()));
  const auto processes = processes_of(record);
  insert.bind(static_cast<std::int64_t>(std::set(processes.begin(), processes.end()).size()));
  bind_statistics(s, insert);
  insert.bind(std::int64_t{record.provenance.mixture}).bind(record.bound);
  insert.bind(cpu).bind(record.taken).bind(join_words(record.doubts)).run();
  insert_samples(connection, connection.last_row_id(), record);
}

void insert_energy(const Connection& connection, std::int64_t cell_id, const EnergyRecord& energy) {
  assert((energy.energy_j || !energy.reasons.empty()) && "no energy needs a reason");
  assert(!energy.energy_j || std::isfinite(*energy.energy_j));
  Statement insert(connection,
                   "INSERT INTO energy (cell_id, energy_j, provenance, source, valid, reasons, "
                   "domain, idle_subtracted, mixture, ci_low_j, ci_high_j, doubts) "
                   "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(cell_id).bind(energy.energy_j).bind(to_string(energy.provenance)).bind(energy.source);
  insert.bind(std::int64_t{is_valid(energy)}).bind(join_words(energy.reasons));
  insert.bind(energy.domain).bind(std::int64_t{energy.idle_subtracted});
  insert.bind(std::int64_t{energy.provenance.mixture});
  insert.bind(energy.ci_low_j).bind(energy.ci_high_j).bind(join_words(energy.doubts)).run();
}

/// Two programs that go on with the same run meet here.
[[noreturn]] void throw_twice(const Connection& connection, std::int64_t run_id,
                              const CellName& cell) {
  throw_bad_input(fmt::format(
      "profile database '{}' has {} on {} in run {} already: another program goes on with the same "
      "run; let that one end",
      connection.path().string(), cell.workload, cell.unit, run_id));
}

/// The first three parameters are the cell's name.
Statement& bind_cell(Statement& statement, std::int64_t run_id, const CellName& cell) {
  return statement.bind(run_id).bind(cell.workload).bind(cell.unit);
}

std::optional<std::int64_t> find_cell(const Connection& connection, std::int64_t run_id,
                                      const CellName& cell) {
  Statement query(connection,
                  "SELECT cell_id FROM cell WHERE run_id = ? AND workload = ? AND unit = ?");
  if (!bind_cell(query, run_id, cell).step()) return std::nullopt;
  return query.integer(0);
}

bool has_visits(const Connection& connection, std::int64_t run_id, const CellName& cell) {
  Statement query(connection,
                  "SELECT 1 FROM visit WHERE run_id = ? AND workload = ? AND unit = ? LIMIT 1");
  return bind_cell(query, run_id, cell).step();
}

/// What an interruption wrote of a cell makes way; a complete cell does not.
void make_way(const Connection& connection, std::int64_t run_id, const CellName& cell) {
  const auto written = find_cell(connection, run_id, cell);
  if (!written) return;
  if (!has_visits(connection, run_id, cell)) throw_twice(connection, run_id, cell);
  for (const auto* sql :
       {"DELETE FROM sample WHERE measurement_id IN "
        "(SELECT measurement_id FROM measurement WHERE cell_id = ?)",
        "DELETE FROM measurement WHERE cell_id = ?", "DELETE FROM energy WHERE cell_id = ?",
        "DELETE FROM cell WHERE cell_id = ?"}) {
    Statement(connection, sql).bind(*written).run();
  }
}

void insert_cell(const Connection& connection, std::int64_t run_id, const CellRecord& cell) {
  Statement insert(connection,
                   "INSERT INTO cell (run_id, workload, unit, ops, bytes, verification, "
                   "host_memory_bytes, device_memory_bytes, checksum) "
                   "VALUES (?, ?, ?, ?, ?, ?, ?, ?, 0)");
  insert.bind(run_id).bind(cell.workload).bind(cell.unit).bind(cell.ops).bind(cell.bytes);
  insert.bind(cell.verification).bind(cell.host_memory_bytes).bind(cell.device_memory_bytes).run();
  const std::int64_t cell_id = connection.last_row_id();
  for (const PhaseRecord& record : cell.phases) insert_phase(connection, cell_id, record);
  for (const PhaseRecord& record : cell.conditions) insert_phase(connection, cell_id, record);
  if (cell.energy) insert_energy(connection, cell_id, *cell.energy);
  Statement update(connection, "UPDATE cell SET checksum = ? WHERE cell_id = ?");
  update.bind(cell_checksum(connection, cell_id)).bind(cell_id).run();
}

void insert_facts(const Connection& connection, std::int64_t run_id,
                  const std::map<std::string, std::string>& facts) {
  Statement insert(connection,
                   "INSERT OR REPLACE INTO environment (run_id, key, value, kind) "
                   "VALUES (?, ?, ?, ?)");
  for (const auto& [key, value] : facts) {
    insert.bind(run_id).bind(key).bind(value).bind(to_string(fact_kind(key))).run();
  }
}

void update_run_checksum(const Connection& connection, std::int64_t run_id) {
  Statement update(connection, "UPDATE run SET checksum = ? WHERE run_id = ?");
  update.bind(run_checksum(connection, run_id)).bind(run_id).run();
}

[[noreturn]] void throw_measured(const Connection& connection, std::int64_t run_id) {
  throw_environment(fmt::format(
      "run {} of profile database '{}' is being measured by another program; let that one end, or "
      "start another run without --resume",
      run_id, connection.path().string()));
}

}  // namespace

struct ProfileWriter::Impl {
  /// What says that a run is being measured: a lock on a byte far behind the file's end, one a run.
  /// It goes with the process, however that ends. It is one of the open file and not of the process
  /// (F_OFD_SETLK), so that SQLite's locks, which are of the process, do not meet it.
  class RunLock {
   public:
    explicit RunLock(const std::filesystem::path& path)
        : file_(::open(path.c_str(), O_RDWR | O_CLOEXEC)) {}

    /// @return False if another program has it. True as well where there are no such locks.
    [[nodiscard]] bool take(std::int64_t run_id) const {
      constexpr std::int64_t kBehindEveryFile = std::int64_t{1} << 62;
      struct flock byte {};
      byte.l_type = F_WRLCK;
      byte.l_whence = SEEK_SET;
      byte.l_start = kBehindEveryFile + run_id;
      byte.l_len = 1;
      return ::fcntl(file_.get(), F_OFD_SETLK, &byte) == 0 || (errno != EAGAIN && errno != EACCES);
    }

   private:
    FileDescriptor file_;
  };

  Connection connection;
  RunLock lock{connection.path()};
};

ProfileWriter::ProfileWriter(const std::filesystem::path& path, const FileWait& waiting)
    : impl_(new Impl{open_or_create(path, waiting)}) {}
ProfileWriter::~ProfileWriter() = default;
ProfileWriter::ProfileWriter(ProfileWriter&&) noexcept = default;

std::int64_t ProfileWriter::begin_run(const RunHeader& header) {
  Connection& connection = impl_->connection;
  Transaction transaction(connection);
  Statement run(connection,
                "INSERT INTO run (started, platform, seed, plan, checksum) VALUES (?, ?, ?, ?, 0)");
  run.bind(header.started).bind(header.platform).bind(std::to_string(header.seed));
  run.bind(header.plan.empty() ? std::nullopt : std::optional<std::string_view>(header.plan)).run();
  const std::int64_t run_id = connection.last_row_id();
  insert_facts(connection, run_id, header.environment);
  Statement insert(connection,
                   "INSERT INTO unit (run_id, unit, ordinal, backend, device, device_is_cpu, "
                   "cores) VALUES (?, ?, ?, ?, ?, ?, ?)");
  std::int64_t ordinal = 0;
  for (const UnitRecord& unit : header.units) {
    insert.bind(run_id).bind(unit.unit).bind(ordinal++).bind(unit.backend).bind(unit.device);
    insert.bind(std::int64_t{unit.device_is_cpu}).bind(join_cores(unit.cores)).run();
  }
  update_run_checksum(connection, run_id);
  if (!impl_->lock.take(run_id)) throw_measured(connection, run_id);
  transaction.commit();
  return run_id;
}

void ProfileWriter::resume_run(const UnfinishedRun& run) {
  const Connection& connection = impl_->connection;
  const std::int64_t run_id = run.run.run_id;
  if (!impl_->lock.take(run_id)) throw_measured(connection, run_id);
  Statement query(connection, "SELECT checksum FROM run WHERE run_id = ?");
  if (!query.bind(run_id).step() || query.integer(0) != run.checksum) {
    throw_environment(fmt::format(
        "another program went on with run {} of profile database '{}' just now; try again", run_id,
        connection.path().string()));
  }
}

void ProfileWriter::write_visit(std::int64_t run_id, const CellName& cell,
                                const VisitRecord& visit) {
  Connection& connection = impl_->connection;
  Transaction transaction(connection);
  Statement taken(connection,
                  "SELECT 1 FROM visit WHERE run_id = ? AND workload = ? AND unit = ? "
                  "AND position = ?");
  const bool twice = bind_cell(taken, run_id, cell).bind(visit.position).step() ||
                     (find_cell(connection, run_id, cell) && !has_visits(connection, run_id, cell));
  if (twice) throw_twice(connection, run_id, cell);
  Statement insert(connection,
                   "INSERT INTO visit (run_id, workload, unit, position, setup, record, checksum) "
                   "VALUES (?, ?, ?, ?, ?, ?, ?)");
  bind_cell(insert, run_id, cell).bind(visit.position).bind(to_string(visit.setup));
  insert.bind(visit.record).bind(visit_checksum(run_id, cell, visit)).run();
  insert_facts(connection, run_id,
               {{std::string(kSpent), fmt::format("{:.6f}", to_s(visit.spent))}});
  update_run_checksum(connection, run_id);
  transaction.commit();
}

void ProfileWriter::write_cell(std::int64_t run_id, const CellRecord& cell) {
  Connection& connection = impl_->connection;
  Transaction transaction(connection);
  const CellName name{cell.workload, cell.unit};
  make_way(connection, run_id, name);
  Statement visits(connection, "DELETE FROM visit WHERE run_id = ? AND workload = ? AND unit = ?");
  bind_cell(visits, run_id, name).run();
  insert_cell(connection, run_id, cell);
  update_run_checksum(connection, run_id);
  transaction.commit();
}

void ProfileWriter::write_interrupted_cell(std::int64_t run_id, const CellRecord& cell) {
  Connection& connection = impl_->connection;
  Transaction transaction(connection);
  make_way(connection, run_id, {cell.workload, cell.unit});
  insert_cell(connection, run_id, cell);
  update_run_checksum(connection, run_id);
  transaction.commit();
}

void ProfileWriter::write_peaks(std::int64_t run_id, std::span<const PeakRecord> peaks) {
  Connection& connection = impl_->connection;
  Transaction transaction(connection);
  Statement insert(connection,
                   "INSERT OR REPLACE INTO peak (run_id, unit, kind, per_second, variant, "
                   "provenance, valid, reasons, doubts) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const PeakRecord& peak : peaks) {
    assert((peak.per_second || !peak.reasons.empty()) && "no figure needs a reason");
    assert(!peak.per_second || (std::isfinite(*peak.per_second) && *peak.per_second > 0));
    insert.bind(run_id).bind(peak.unit).bind(to_string(peak.kind)).bind(peak.per_second);
    insert.bind(peak.variant).bind(to_string(peak.provenance));
    insert.bind(std::int64_t{is_valid(peak)}).bind(join_words(peak.reasons));
    insert.bind(join_words(peak.doubts)).run();
  }
  update_run_checksum(connection, run_id);
  transaction.commit();
}

void ProfileWriter::write_unit_times(std::int64_t run_id, std::span<const UnitTimeRecord> times) {
  Connection& connection = impl_->connection;
  Transaction transaction(connection);
  Statement insert(connection,
                   "INSERT INTO unit_time (run_id, unit, phase, sleep_ns, valid, reasons, samples, "
                   "median_ns, mad_ns, p95_ns, p99_ns, ci_low_ns, ci_high_ns, doubts) "
                   "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  Statement sample(connection,
                   "INSERT INTO unit_time_sample (unit_time_id, position, ns) VALUES (?, ?, ?)");
  for (const UnitTimeRecord& record : times) {
    assert((!record.samples.empty() || !record.reasons.empty()) && "no samples need a reason");
    std::optional<Statistics> s;
    if (!record.samples.empty()) s = summarize(record.samples);
    insert.bind(run_id).bind(record.unit).bind(to_string(record.phase)).bind(record.sleep);
    insert.bind(std::int64_t{is_valid(record)}).bind(join_words(record.reasons));
    insert.bind(static_cast<std::int64_t>(record.samples.size()));
    bind_statistics(s, insert);
    insert.bind(join_words(record.doubts)).run();
    const std::int64_t id = connection.last_row_id();
    std::int64_t position = 0;
    for (const Nanos each : record.samples) sample.bind(id).bind(position++).bind(each).run();
  }
  update_run_checksum(connection, run_id);
  transaction.commit();
}

void ProfileWriter::finish_run(std::int64_t run_id, const std::string& finished,
                               const std::map<std::string, std::string>& facts) {
  Connection& connection = impl_->connection;
  Transaction transaction(connection);
  Statement update(connection, "UPDATE run SET finished = ? WHERE run_id = ?");
  update.bind(finished).bind(run_id).run();
  insert_facts(connection, run_id, facts);
  update_run_checksum(connection, run_id);
  transaction.commit();
}

void ProfileWriter::write_facts(std::int64_t run_id,
                                const std::map<std::string, std::string>& facts) {
  Connection& connection = impl_->connection;
  Transaction transaction(connection);
  insert_facts(connection, run_id, facts);
  update_run_checksum(connection, run_id);
  transaction.commit();
}

}  // namespace pirt
