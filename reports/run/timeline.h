// What ran where and when: the slices of a trace (pirt schedule --trace), or a static plan.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "reports/document/chart.h"
#include "scheduler/record/run_record.h"

namespace pirt {

/// One task on one slot of a unit, from start to completion.
struct Slice {
  std::size_t unit = 0;  ///< Position in Timeline::units.
  std::int64_t slot = 0;
  std::string pipeline, task, workload;
  std::int64_t firing = 0;
  double start_ms = 0, end_ms = 0;
  double waited_ms = 0;  ///< From the end of its predecessors to its start.
};

struct Timeline {
  std::string source;  ///< The file, or the command that makes it.
  std::string platform, mix, mode;
  std::uint64_t seed = 0;
  std::string time = "virtual";  ///< Or "live".
  bool complete = true;          ///< False: of a run that did not come to its end.
  std::vector<std::string> units = {};
  std::vector<Slice> slices = {};  ///< By start.
};

/// @throws Error{kBadInput} naming the file: not there, not JSON, not a trace of pirt's, of another
/// version, a part is missing.
[[nodiscard]] Timeline load_timeline(const std::filesystem::path& path);
/// @param source  For messages, and what the timeline says of itself.
[[nodiscard]] Timeline parse_timeline(const std::string& text, const std::string& source);

/// What a static plan of a mix that fires once laid down; nothing for other runs.
[[nodiscard]] std::optional<Timeline> planned_timeline(const RunRecord& run);

/// More slices than these are not read by anybody: the chart has the first ones, and says so.
inline constexpr std::size_t kMostSlices = 300;

/// A lane a slot. Slices that go on behind the last start that is shown are cut there.
[[nodiscard]] Chart timeline_chart(const Timeline& timeline);

}  // namespace pirt
