// The rows of many runs over time: at which run each became slower or faster, and by how much.
//
// A series is one row (platform, workload, unit, phase) over the runs. Those that may be compared,
// as the gate has it (reports/gate), are looked at together, whatever runs stand between them;
// where another machine, driver, size or meter begins is a break, which is nobody's change. Where
// the platform's text was edited, a change says so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "characterize/profile/profile.h"
#include "characterize/statistics/change_points.h"
#include "reports/document/document.h"
#include "workloads/base/text/json.h"

namespace pirt {

/// A run that a point is of.
struct HistoryRun {
  std::string file;
  RunInfo info;
};

struct HistoryPoint {
  std::size_t run = 0;  ///< Index of History::runs.
  double value = 0;     ///< Median, in ns or joules a call; above 0.
  std::optional<double> low = std::nullopt, high = std::nullopt;  ///< Its 95 % interval.
  bool doubted = false;
  /// Of its row, or of the call of an energy row's cell: other ones are not compared.
  std::optional<std::int64_t> ops = std::nullopt;
  std::int64_t bytes = 0;
  Origin provenance = {};
  std::string covers = {};  ///< Of energy what the meter covers: "package", "board with idle".
};

struct HistoryChange {
  std::size_t before = 0, after = 0;  ///< Points between which it lies.
  double ratio = 1;                   ///< Of the levels.
  enum class Kind : std::uint8_t {
    kStep,       ///< For sure.
    kSuspected,  ///< Since the newest few points, not for sure.
    kCreep,      ///< From the first quarter to the last, without a step that explains it.
    kBreak,      ///< Another machine, driver, size or meter begins; no change of the program.
  } kind = Kind::kStep;
  std::string why = {};  ///< Of a break; of others what may be behind it besides the program.
};
[[nodiscard]] std::string_view to_string(HistoryChange::Kind kind);

struct HistorySeries {
  std::string workload, unit, phase;  ///< phase: "execute", "prepare cold", "energy".
  std::vector<HistoryPoint> points;   ///< In order of time.
  std::vector<HistoryChange> changes = {};
  [[nodiscard]] bool is_energy() const { return phase == "energy"; }
  [[nodiscard]] const char* measure() const { return is_energy() ? "J" : "ns"; }
};

struct History {
  std::string platform;
  std::vector<HistoryRun> runs;  ///< In order of time.
  std::vector<HistorySeries> series;
  std::vector<HistoryRun> left_out = {};  ///< Those that did not end, newest first.
};

/// Steps below this count as none, however exactly figures repeat: a standard deviation, relative.
inline constexpr double kLeastHistoryNoise = 0.002;

/// The databases that @p paths name, of a folder those in it (*.db), by name.
/// @throws Error{kBadInput} for a folder without one.
[[nodiscard]] std::vector<std::filesystem::path> history_files(
    const std::vector<std::string>& paths);

/// The finished runs of all files, of which one that stands in several counts once, with what
/// changed. Invalid rows have no point, metered energy has one.
/// @param platform  Empty = that of the newest run of the first file.
/// @param filter    A NameFilter of workload names; empty = all.
/// @throws Error{kBadInput} as ProfileReader; if no file has a finished run of the platform, with
/// those that are left out.
[[nodiscard]] History read_history(const std::vector<std::filesystem::path>& files,
                                   const std::string& platform, const std::string& filter);

/// Fills in the changes of each series.
void find_changes(History& history);

/// "run 3 of a.db did not end and is left out; ..." of each, with how to go on with it.
[[nodiscard]] std::vector<std::string> left_out_lines(const History& history);

/// @param all  Also a chart of each workload on each unit.
[[nodiscard]] Document history_document(const History& history, bool all);
[[nodiscard]] Json history_json(const History& history);

}  // namespace pirt
