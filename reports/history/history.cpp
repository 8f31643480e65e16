#include "reports/history/history.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "characterize/profile/identity.h"
#include "characterize/profile/store/reader.h"
#include "workloads/base/error.h"
#include "workloads/base/text/name_filter.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using Key = std::tuple<std::string, std::string, std::string>;  // workload, unit, phase

/// In order of first appearance.
class SeriesByKey {
 public:
  void add(const std::string& workload, const std::string& unit, const std::string& phase,
           const HistoryPoint& point) {
    const auto [at, is_new] = index_.try_emplace(Key{workload, unit, phase}, series_.size());
    if (is_new) series_.push_back({workload, unit, phase, {}});
    series_[at->second].points.push_back(point);
  }
  [[nodiscard]] std::vector<HistorySeries> take() { return std::move(series_); }

 private:
  std::map<Key, std::size_t> index_;
  std::vector<HistorySeries> series_;
};

void add_rows(const Profile& profile, std::size_t run, const NameFilter& filter,
              SeriesByKey& series) {
  for (const PhaseRow& row : profile.phases) {
    if (!is_used(row) || !row.median || row.median->count() <= 0 || !filter.picks(row.workload)) {
      continue;
    }
    HistoryPoint point{.run = run,
                       .value = static_cast<double>(row.median->count()),
                       .doubted = is_doubted(row),
                       .ops = row.ops,
                       .bytes = row.bytes,
                       .provenance = row.provenance};
    if (row.ci_low && row.ci_high) {
      point.low = static_cast<double>(row.ci_low->count());
      point.high = static_cast<double>(row.ci_high->count());
    }
    series.add(row.workload, row.unit, row.phase_name(), point);
  }
  for (const EnergyRow& row : profile.energies) {
    const bool metered = row.provenance == Origin(Provenance::kMeasured);
    if (!metered || !is_used(row) || !row.energy_j || *row.energy_j <= 0 ||
        !filter.picks(row.workload)) {
      continue;
    }
    HistoryPoint point{run, *row.energy_j, row.ci_low_j, row.ci_high_j, is_doubted(row)};
    point.covers = row.domain + (row.idle_subtracted ? "" : " with idle");
    if (const PhaseRow* call = profile.find(row.workload, row.unit, Phase::kCall)) {
      point.ops = call->ops;
      point.bytes = call->bytes;
    }
    series.add(row.workload, row.unit, "energy", point);
  }
}

/// Why two points of a series may not be compared; empty if they may.
std::string break_between(const History& history, const HistorySeries& series, std::size_t before,
                          std::size_t after) {
  const HistoryPoint& a = series.points[before];
  const HistoryPoint& b = series.points[after];
  const std::string why =
      describe(compare_identity(history.runs[a.run].info, history.runs[b.run].info, series.unit));
  if (!why.empty()) return why;
  if (a.covers != b.covers) return fmt::format("the meters cover {} and {}", a.covers, b.covers);
  const std::string work = compare_work(a, b);
  return work.empty() ? "" : series.workload + ": " + work;
}

/// What besides the program may be why a row changed.
std::string platform_changed(const RunInfo& a, const RunInfo& b) {
  for (const auto& each : compare_program(a, b)) {
    if (each.field == "platform_hash") return each.why;
  }
  return "";
}

/// Changes of points that may be compared.
void add_changes(const History& history, const std::vector<std::size_t>& points,
                 HistorySeries& series) {
  const auto why = [&](std::size_t before, std::size_t after) {
    return platform_changed(history.runs[series.points[before].run].info,
                            history.runs[series.points[after].run].info);
  };
  std::vector<double> values;
  for (const std::size_t i : points) values.push_back(std::log(series.points[i].value));
  const auto found = change_points(values, kLeastHistoryNoise);
  for (const ChangePoint& each : found) {
    const std::size_t before = points[each.at - 1];
    const std::size_t after = points[each.at];
    series.changes.push_back(
        {before, after, std::exp(each.after - each.before),
         each.sure ? HistoryChange::Kind::kStep : HistoryChange::Kind::kSuspected,
         why(before, after)});
  }
  const double creep = creep_of(values, found, kLeastHistoryNoise);
  if (creep != 0) {
    series.changes.push_back({points.front(), points.back(), std::exp(creep),
                              HistoryChange::Kind::kCreep, why(points.front(), points.back())});
  }
}

/// What finds the same run in a copy of its file; runs of one second tell their place among these.
auto same_run(const HistoryRun& run, std::ptrdiff_t place) {
  return std::tuple(run.info.started, run.info.seed, run.info.environment, place);
}

}  // namespace

std::string_view to_string(HistoryChange::Kind kind) {
  switch (kind) {
    case HistoryChange::Kind::kStep:
      return "step";
    case HistoryChange::Kind::kSuspected:
      return "suspected";
    case HistoryChange::Kind::kCreep:
      return "creep";
    case HistoryChange::Kind::kBreak:
      return "break";
  }
  return "";
}

std::vector<std::filesystem::path> history_files(const std::vector<std::string>& paths) {
  std::vector<std::filesystem::path> files;
  for (const std::string& path : paths) {
    if (!std::filesystem::is_directory(path)) {
      files.emplace_back(path);
      continue;
    }
    std::vector<std::filesystem::path> inside;
    for (const auto& entry : std::filesystem::directory_iterator(path)) {
      if (entry.path().extension() == ".db") inside.push_back(entry.path());
    }
    if (inside.empty()) throw_bad_input("folder '" + path + "' has no profile database (*.db)");
    std::ranges::sort(inside);
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

History read_history(const std::vector<std::filesystem::path>& files, const std::string& platform,
                     const std::string& filter) {
  History history{.platform = platform, .runs = {}, .series = {}};
  std::vector<std::pair<HistoryRun, Profile>> found;
  std::set<decltype(same_run({}, {}))> known;
  std::string any;  // Of runs of which none ended.
  for (const auto& file : files) {
    if (!history.platform.empty()) break;
    const ProfileReader reader(file);
    const std::string newest = reader.newest_platform();
    if (any.empty()) any = newest;
    if (!newest.empty() && !reader.finished_runs(newest).empty()) history.platform = newest;
  }
  if (history.platform.empty()) history.platform = any;
  for (const auto& file : files) {
    const ProfileReader reader(file);
    for (RunInfo& run : reader.unfinished_runs(history.platform)) {
      history.left_out.push_back({file.string(), std::move(run)});
    }
    decltype(known) here;
    // The oldest first: a start is said in seconds, so the order in the file tells more.
    auto ids = reader.finished_runs(history.platform);
    std::ranges::reverse(ids);
    for (const std::int64_t id : ids) {
      Profile profile = reader.read(history.platform, {id, id});
      HistoryRun run{file.string(), profile.runs.front()};
      std::ptrdiff_t place = 0;
      while (!here.insert(same_run(run, place)).second) ++place;
      if (known.insert(same_run(run, place)).second) {
        found.emplace_back(std::move(run), std::move(profile));
      }
    }
  }
  if (history.platform.empty()) {
    throw_bad_input("no file has a run; measure one with: pirt characterize --db FILE");
  }
  if (found.empty()) {
    const auto lines = left_out_lines(history);
    throw_bad_input("no file has a finished run of platform '" + history.platform + "'; " +
                    (lines.empty() ? "name another with --platform" : join(lines, "; ")));
  }
  std::ranges::stable_sort(found, {}, [](const auto& each) { return each.first.info.started; });
  const NameFilter picked(filter);
  SeriesByKey series;
  for (auto& [run, profile] : found) {
    add_rows(profile, history.runs.size(), picked, series);
    history.runs.push_back(std::move(run));
  }
  history.series = series.take();
  if (history.series.empty()) {
    std::vector<std::string> names;
    for (const auto& [run, profile] : found) {
      for (std::string& name : profile.workloads()) names.push_back(std::move(name));
    }
    throw_bad_input("no workload is picked by --filter '" + filter + "'" +
                    suggestion(filter, names));
  }
  find_changes(history);
  return history;
}

void find_changes(History& history) {
  for (HistorySeries& series : history.series) {
    series.changes.clear();
    std::vector<std::vector<std::size_t>> groups;  // Of points that may be compared.
    for (std::size_t i = 0; i < series.points.size(); ++i) {
      const auto own = std::ranges::find_if(groups, [&](const auto& group) {
        return break_between(history, series, group.front(), i).empty();
      });
      if (own != groups.end()) {
        own->push_back(i);
        continue;
      }
      groups.push_back({i});
      if (i == 0) continue;
      series.changes.push_back({i - 1, i, series.points[i].value / series.points[i - 1].value,
                                HistoryChange::Kind::kBreak,
                                break_between(history, series, i - 1, i)});
    }
    for (const auto& group : groups) add_changes(history, group, series);
    std::ranges::stable_sort(series.changes, {}, &HistoryChange::after);
  }
}

}  // namespace pirt
