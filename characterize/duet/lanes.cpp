#include "characterize/duet/lanes.h"

#include <algorithm>
#include <numeric>
#include <set>

#include "workloads/base/system/cores.h"

namespace pirt {
namespace {

/// Cells that must not run at the same time, and every core that they, or a sibling, compute on.
struct Group {
  std::set<int> cores;
  DuetLane cells;

  [[nodiscard]] bool shares_a_core_with(const Group& other) const {
    return std::ranges::any_of(cores, [&](int core) { return other.cores.contains(core); });
  }
};

/// Adds @p group to @p groups, as one with those that share a core with it.
void add_group(std::vector<Group>& groups, Group group) {
  std::vector<Group> apart;
  for (Group& other : groups) {
    if (!other.shares_a_core_with(group)) {
      apart.push_back(std::move(other));
      continue;
    }
    group.cores.merge(other.cores);
    group.cells.insert(group.cells.end(), other.cells.begin(), other.cells.end());
  }
  apart.push_back(std::move(group));
  groups = std::move(apart);
}

}  // namespace

DuetRounds one_at_a_time(std::size_t cells) {
  DuetLane all(cells);
  std::iota(all.begin(), all.end(), std::size_t{0});
  return {{all}};
}

DuetRounds side_by_side(const Platform& platform, const std::vector<DuetCell>& cells,
                        const std::filesystem::path& root) {
  std::vector<Group> groups;
  DuetLane anywhere;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    Group group{.cores = {}, .cells = {c}};
    if (!cells[c].unit.empty()) {
      for (const int core : platform.unit(cells[c].unit).cores) {
        group.cores.merge(core_siblings(root, core));
      }
    }
    if (group.cores.empty()) {
      anywhere.push_back(c);
    } else {
      add_group(groups, std::move(group));
    }
  }
  DuetRounds rounds;
  if (!groups.empty()) rounds.emplace_back();
  for (Group& group : groups) {
    std::ranges::sort(group.cells);
    rounds.front().push_back(std::move(group.cells));
  }
  if (!anywhere.empty()) rounds.push_back({std::move(anywhere)});
  return rounds;
}

}  // namespace pirt
