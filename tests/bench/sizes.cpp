// How often a time that was measured at a size is within the interval that --estimate gives it from
// the other sizes: each workload's inner sizes, left out in turn.
//
// Usage: sizes PROFILE   of workloads at five sizes or more, such as
//   pirt characterize --db PROFILE --units cpu --filter '^(sobel|optical_flow)$'
//     --sizes 320x240,480x360,640x480,800x600,1024x768,1280x720
#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "characterize/profile/size_estimate.h"
#include "characterize/profile/store/reader.h"
#include "workloads/base/error.h"
#include "workloads/own/definition.h"

namespace {

using namespace pirt;  // NOLINT: a program

/// Whether the interval of the size that is left out has its time; prints both.
bool is_inside(Profile profile, const PhaseRow& truth) {
  std::erase_if(profile.phases, [&](const PhaseRow& row) {
    return row.workload == truth.workload && row.unit == truth.unit;
  });
  std::string why = "it has no size";
  for (const SizeGap& gap : size_gaps(profile, {truth.workload})) {
    if (gap.unit == truth.unit) why = gap.why_not;
    if (gap.unit != truth.unit || !gap.why_not.empty()) continue;
    const PhaseRow shown = add_estimate(profile, gap);
    const bool inside = *shown.ci_low <= *truth.median && *truth.median <= *shown.ci_high;
    fmt::print("{:32} {:8} {:10.4f} ms, estimate {:10.4f} ({:.4f} to {:.4f}){}\n", truth.workload,
               truth.unit, to_ms(*truth.median), to_ms(*shown.median), to_ms(*shown.ci_low),
               to_ms(*shown.ci_high), inside ? "" : "  OUTSIDE");
    return inside;
  }
  throw_bad_input(truth.workload + " on " + truth.unit + ": no estimate, since " + why);
}

int run(const std::string& path) {
  const Profile profile = load_profile(path);
  std::map<std::pair<std::string, std::string>, std::vector<const PhaseRow*>> rows;
  for (const PhaseRow& row : profile.phases) {
    if (row.phase != Phase::kCall || !row.median || !is_used(row)) continue;
    if (!own::size_in(row.workload)) continue;
    rows[{own::plain_name(row.workload), row.unit}].push_back(&row);
  }
  int inside = 0, all = 0;
  for (auto& [cell, sizes] : rows) {
    if (sizes.size() <= kLeastSizes) continue;
    const auto pixels = [](const PhaseRow* row) {
      const auto size = own::size_in(row->workload);
      return size->width * size->height;
    };
    std::ranges::sort(sizes, {}, pixels);
    for (std::size_t i = 1; i + 1 < sizes.size(); ++i) {
      inside += is_inside(profile, *sizes[i]) ? 1 : 0;
      ++all;
    }
  }
  fmt::print("{} of {} within the interval (goal 9 of 10)\n", inside, all);
  return all > 0 ? 0 : 1;
}

}  // namespace

int main(int count, char** arguments) try {
  if (count != 2) {
    fmt::print(stderr, "usage: sizes PROFILE\n");
    return 2;
  }
  return run(arguments[1]);
} catch (const std::exception& error) {
  fmt::print(stderr, "sizes: {}\n", error.what());
  return 2;
}
