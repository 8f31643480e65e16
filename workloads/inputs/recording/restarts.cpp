#include "workloads/inputs/recording/restarts.h"

#include <algorithm>

namespace pirt {

std::vector<std::size_t> restarts_of(const std::vector<Nanos>& stamps, Nanos least) {
  constexpr std::size_t kRun = 3, kFewOff = 1000;
  const auto rise = [&](std::size_t from) {
    return stamps[from] < stamps[from + 1] && stamps[from + 1] < stamps[from + 2];
  };
  // All of the run before are later than where the next begins, and the other way round.
  const auto are_runs = [&](std::size_t i) {
    return i >= kRun && i + kRun <= stamps.size() && rise(i - kRun) && rise(i) &&
           stamps[i - kRun] > stamps[i] && stamps[i + kRun - 1] < stamps[i - 1];
  };
  std::vector<std::size_t> restarts;
  for (std::size_t i = 2; i + 1 < stamps.size(); ++i) {
    const Nanos fall = stamps[i - 1] - stamps[i];
    Nanos step = std::min(stamps[i - 1] - stamps[i - 2], stamps[i + 1] - stamps[i]);
    // Two that changed places are twice as far from their neighbours as those from theirs.
    if (i > 2) step = std::min(step, stamps[i - 2] - stamps[i - 3]);
    if (i + 2 < stamps.size()) step = std::min(step, stamps[i + 2] - stamps[i + 1]);
    if (fall <= least || step <= Nanos::zero()) continue;
    // A smaller fall may be less than three steps.
    const bool is_small = fall <= kLeastRestart;
    if (!is_small && !are_runs(i)) continue;
    // A few that are far off lie within one run, which jumps to them and goes on behind them.
    std::size_t late = i, early = i;
    while (late > 0 && i - late < kFewOff && stamps[late - 1] > stamps[i]) --late;
    while (early < stamps.size() && early - i < kFewOff && stamps[early] < stamps[i - 1]) ++early;
    const Nanos jump = is_small ? step + fall / 2 : kLeastRestart;
    const auto jumps = [&](std::size_t to) {
      return to > 0 && to < stamps.size() && stamps[to] - stamps[to - 1] > jump;
    };
    if (!jumps(late) && !jumps(early)) restarts.push_back(i);
  }
  return restarts;
}

std::pair<std::size_t, std::size_t> longest_run(const std::vector<std::size_t>& restarts,
                                                const std::vector<Nanos>& stamps) {
  constexpr Nanos kMostStep = std::chrono::seconds(1);  // one that is far off counts for no more
  std::pair<std::size_t, std::size_t> longest{0, 0};
  Nanos most{-1};
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= restarts.size(); ++i) {
    const std::size_t end = i < restarts.size() ? restarts[i] : stamps.size();
    Nanos lasts{0};
    for (std::size_t k = begin + 1; k < end; ++k) {
      lasts += std::clamp(stamps[k] - stamps[k - 1], Nanos::zero(), kMostStep);
    }
    if (lasts > most) longest = {begin, end}, most = lasts;
    begin = end;
  }
  return longest;
}

}  // namespace pirt
