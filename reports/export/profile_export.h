// A profile in the formats of other tools: JSON, CSV, and the JSON of Google Benchmark.
//
// All figures keep their provenance and validity. reports/README.md describes the formats.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/profile/profile.h"
#include "characterize/profile/store/reader.h"
#include "workloads/base/text/json.h"
#include "workloads/base/text/name_filter.h"

namespace pirt {

/// The rows of a profile with their raw samples (PhaseRow::values).
/// @param platform  Only runs of that platform; empty = that of the newest run.
/// @param filter    A NameFilter of workload names; empty = all.
/// @throws Error{kBadInput} as load_profile; a filter that is none, or matches no workload of the
/// profile (with the nearest names).
[[nodiscard]] Profile load_with_samples(const std::filesystem::path& path,
                                        std::string_view platform, const std::string& filter);

/// @throws Error{kBadInput} as above.
[[nodiscard]] NameFilter workload_filter(const Profile& profile, const std::string& filter);

/// Leaves the rows of the workloads that contain @p filter. @throws Error{kBadInput} as above.
void keep_workloads(Profile& profile, const std::string& filter);

/// profile_json (profile_report.h) without preferences; and `samples_ns` and `processes_of_samples`
/// in each row (hand-overs have the former), `identity` (the keys of those facts) in each run, and
/// `peaks`.
[[nodiscard]] Json export_json(const Profile& profile);

/// The tables that CSV has, each with a header: `profile`, `conditions`, `units` and `energy`
/// with the columns of the views profile_summary, condition_summary, unit_time_summary and
/// energy_summary, `peaks`, and `samples` of profile_summary (one line a sample). Quoted as
/// RFC 4180 says, lines end in \n, what is unknown is an empty field.
enum class CsvTable : std::uint8_t { kProfile, kConditions, kUnitTimes, kEnergy, kPeaks, kSamples };
[[nodiscard]] std::string export_csv(const Profile& profile, CsvTable table);

/// What Google Benchmark writes with --benchmark_format=json, for its compare.py and what else
/// reads that: one entry of run_type iteration for each sample, so that compare.py's U test works,
/// and aggregates median, mad, p95 and p99; in nanoseconds a call. Rows that are not used are left
/// out: readers would take them for figures. Doubted ones have `doubts`. cpu_time repeats
/// real_time, since readers ask for it and nothing else is known.
struct BenchmarkExport {
  Json json;
  std::vector<std::string> left_out;  ///< Names of rows that are not used, with their reasons.
};
[[nodiscard]] BenchmarkExport export_google_benchmark(const Profile& profile);

/// `workload/unit/phase/real_time`, with `prepare_cold` and `prepare_warm` and the like for phases
/// that have states.
[[nodiscard]] std::string benchmark_name(const PhaseRow& row);

}  // namespace pirt
