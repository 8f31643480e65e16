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
    HistoryPoint point{.run = run, .value = static_cast<double>(row.median->count())};
    if (row.ci_low && row.ci_high) {
      point.low = static_cast<double>(row.ci_low->count());
      point.high = static_cast<double>(row.ci_high->count());
    }
    point.doubted = is_doubted(row);
    const std::string state =
        row.state == State::kSteady ? "" : " " + std::string(to_string(row.state));
    series.add(row.workload, row.unit, std::string(to_string(row.phase)) + state, point);
  }
  for (const EnergyRow& row : profile.energies) {
    const bool metered = row.provenance == Origin(Provenance::kMeasured);
    if (!metered || !is_used(row) || !row.energy_j || *row.energy_j <= 0 ||
        !filter.picks(row.workload)) {
      continue;
    }
    series.add(row.workload, row.unit, "energy",
               {run, *row.energy_j, row.ci_low_j, row.ci_high_j, is_doubted(row)});
  }
}

/// Why figures of the unit of two runs may not be put in a row; empty if they may.
std::string break_between(const RunInfo& a, const RunInfo& b, const std::string& unit) {
  std::vector<std::string> parts;
  for (const auto& each : compare_identity(a, b)) {
    if (each.unit.empty() || each.unit == unit) parts.push_back(describe(each));
  }
  return join(parts, "; ");
}

/// What besides the program may be why a row changed.
std::string platform_changed(const RunInfo& a, const RunInfo& b) {
  for (const auto& each : compare_program(a, b)) {
    if (each.field == "platform_hash") return each.why;
  }
  return "";
}

/// Changes of the points from @p begin to @p end, which may be compared.
void add_changes(const History& history, std::size_t begin, std::size_t end,
                 HistorySeries& series) {
  const auto why = [&](std::size_t before, std::size_t after) {
    return platform_changed(history.runs[series.points[before].run].info,
                            history.runs[series.points[after].run].info);
  };
  std::vector<double> values;
  for (std::size_t i = begin; i < end; ++i) values.push_back(std::log(series.points[i].value));
  const auto found = change_points(values, kLeastHistoryNoise);
  for (const ChangePoint& each : found) {
    const std::size_t at = begin + each.at;
    series.changes.push_back(
        {at - 1, at, std::exp(each.after - each.before),
         each.sure ? HistoryChange::Kind::kStep : HistoryChange::Kind::kSuspected,
         why(at - 1, at)});
  }
  const double creep = creep_of(values, found, kLeastHistoryNoise);
  if (creep != 0) {
    series.changes.push_back(
        {begin, end - 1, std::exp(creep), HistoryChange::Kind::kCreep, why(begin, end - 1)});
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
  for (const auto& file : files) {
    const ProfileReader reader(file);
    if (history.platform.empty()) history.platform = reader.read().platform();
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
  if (found.empty()) {
    throw_bad_input("no file has a finished run of platform '" + history.platform +
                    "'; name another with --platform");
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
    std::size_t begin = 0;
    for (std::size_t i = 1; i <= series.points.size(); ++i) {
      std::string why;
      if (i < series.points.size()) {
        why = break_between(history.runs[series.points[i - 1].run].info,
                            history.runs[series.points[i].run].info, series.unit);
        if (why.empty()) continue;
      }
      add_changes(history, begin, i, series);
      begin = i;
      if (i == series.points.size()) break;
      series.changes.push_back({i - 1, i, series.points[i].value / series.points[i - 1].value,
                                HistoryChange::Kind::kBreak, why});
    }
  }
}

}  // namespace pirt
