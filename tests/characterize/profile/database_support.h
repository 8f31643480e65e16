// What the tests of the profile database share: small files, their whole content, damage.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <optional>
#include <string>

#include "characterize/profile/profile.h"
#include "characterize/profile/records.h"
#include "characterize/profile/store/database_format.h"
#include "characterize/profile/store/reader.h"
#include "characterize/profile/store/writer.h"
#include "tests/characterize/support.h"
#include "tests/support/as_nobody.h"

namespace pirt::test {

/// A file with one finished run of two cells.
inline void write_one_run(const std::filesystem::path& path) {
  ProfileWriter writer(path);
  const auto run = writer.begin_run(small_run());
  writer.write_cell(run, small_cell("sobel", "cpu"));
  writer.write_cell(run, small_cell("sobel", "gpu", 3000));
  writer.finish_run(run, "2024-01-02T03:05:00Z");
}

inline void run_sql(const std::filesystem::path& path, const std::string& sql) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &handle), SQLITE_OK);
  char* message = nullptr;
  EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, &message), SQLITE_OK)
      << sql << ": " << (message != nullptr ? message : "");
  sqlite3_free(message);
  sqlite3_close(handle);
}

/// Everything that a reader sees, to compare.
inline std::string dump(const std::filesystem::path& path) {
  const Profile profile = load_profile(path);
  std::string text;
  const auto add = [&text](const auto&... values) { ((text += fmt::format("{}|", values)), ...); };
  const auto time = [](const std::optional<Nanos>& value) {
    return value ? std::to_string(value->count()) : std::string("-");
  };
  for (const PhaseRow& row : profile.phases) {
    add(row.run_id, row.platform, row.workload, row.unit, row.backend, to_string(row.phase));
    add(to_string(row.state), to_string(row.provenance), is_valid(row), join_words(row.reasons),
        join_words(row.doubts));
    add(join_words(row.notes), row.samples, row.processes, time(row.median), time(row.mad));
    add(time(row.p95), time(row.p99), time(row.ci_low), time(row.ci_high), row.ops.value_or(-1));
    add(row.bytes, "\n");
  }
  for (const EnergyRow& row : profile.energies) {
    add(row.run_id, row.workload, row.unit, row.energy_j.value_or(-1), to_string(row.provenance));
    add(row.source, is_valid(row), join_words(row.reasons), join_words(row.doubts), row.domain,
        row.idle_subtracted, "\n");
  }
  for (const PeakRow& row : profile.peaks) {
    add(row.run_id, row.unit, to_string(row.kind), row.per_second.value_or(-1), row.variant);
    add(to_string(row.provenance), is_valid(row), join_words(row.reasons), join_words(row.doubts),
        "\n");
  }
  for (const RunInfo& run : profile.runs) {
    add(run.run_id, run.started, run.finished, run.platform, run.seed);
    for (const auto& [key, value] : run.environment) add(key, value, run.identity.contains(key));
    for (const UnitRecord& unit : run.units) {
      add(unit.unit, unit.backend, unit.device, unit.device_is_cpu,
          fmt::format("{}", fmt::join(unit.cores, ",")));
    }
  }
  for (std::int64_t run_id = 1; run_id <= profile.runs.front().run_id; ++run_id) {
    for (const RowSamples& row : load_samples(path, run_id)) {
      add(row.workload, row.unit, to_string(row.phase), to_string(row.state));
      for (std::size_t i = 0; i < row.samples.size(); ++i) {
        add(row.samples[i].count(), row.processes[i]);
      }
    }
  }
  if (const auto unfinished = find_unfinished_run(path)) {
    add(unfinished->run.run_id, unfinished->plan);
    for (const CellName& cell : unfinished->done) add(cell.workload, cell.unit);
  }
  return text;
}

/// Runs @p action in a process of its own; its wait status.
template <typename Action>
int in_child(Action action) {
  const pid_t child = ::fork();
  if (child == 0) {
    action();
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

/// A writer that dies inside a transaction with its changes on disk: a small page cache spills them
/// into the file.
inline void die_in_transaction(const std::filesystem::path& path) {
  const int status = in_child([&] {
    sqlite3* handle = nullptr;
    sqlite3_open(path.c_str(), &handle);
    sqlite3_exec(
        handle,
        "PRAGMA cache_size = 2; BEGIN IMMEDIATE; UPDATE sample SET ns = 0; "
        "WITH RECURSIVE n(i) AS (SELECT 1000 UNION ALL SELECT i + 1 FROM n WHERE i < 60000) "
        "INSERT INTO sample SELECT 1, i, 0, 0, NULL FROM n",
        nullptr, nullptr, nullptr);
    ::raise(SIGKILL);
  });
  ASSERT_TRUE(WIFSIGNALED(status));
}

}  // namespace pirt::test
