#include "reports/gate/decisions.h"

#include <algorithm>
#include <map>

#include "scheduler/schedule.h"
#include "workloads/base/error.h"

namespace pirt {
namespace {

/// Nothing if fewer than two units have it: there is no choice.
template <typename Cost>
std::optional<std::string> cheapest(const std::vector<std::string>& units, const Cost& cost) {
  std::optional<std::string> best;
  std::optional<double> least;
  int candidates = 0;
  for (const auto& unit : units) {
    const std::optional<double> each = cost(unit);
    if (!each) continue;
    ++candidates;
    if (!least || *each < *least) {
      least = each;
      best = unit;
    }
  }
  return candidates < 2 ? std::nullopt : best;
}

const PhaseRow* valid_call(const Profile& profile, const std::string& workload,
                           const std::string& unit) {
  const auto* row = profile.find(workload, unit, Phase::kCall);
  return row != nullptr && is_valid(*row) && row->median ? row : nullptr;
}

bool apart(const Profile& profile, const std::string& workload, const std::string& faster,
           const std::string& slower) {
  const auto* a = valid_call(profile, workload, faster);
  const auto* b = valid_call(profile, workload, slower);
  return a != nullptr && b != nullptr && a->ci_high && b->ci_low && *a->ci_high < *b->ci_low;
}

std::optional<RunRecord> run_of(const ModeRuns& modes, const std::string& mode) {
  const auto found = std::ranges::find(modes.runs, mode, &RunRecord::mode);
  return found == modes.runs.end() ? std::nullopt : std::optional(*found);
}

std::string why_not(const ModeRuns& modes, const std::string& mode) {
  return std::ranges::find(modes.skipped, mode, &ModeRuns::Skipped::mode)->reason;
}

}  // namespace

std::vector<Flip> find_flips(const Profile& base, const Profile& candidate) {
  std::vector<Flip> flips;
  std::vector<std::string> units;
  for (const auto& unit : base.units()) {
    if (std::ranges::count(candidate.units(), unit) > 0) units.push_back(unit);
  }
  for (const auto& workload : base.workloads()) {
    const auto by_time = [&](const Profile& profile) {
      return cheapest(units, [&](const std::string& unit) -> std::optional<double> {
        const auto* row = valid_call(profile, workload, unit);
        const bool both = valid_call(base, workload, unit) && valid_call(candidate, workload, unit);
        return both ? std::optional(static_cast<double>(row->median->count())) : std::nullopt;
      });
    };
    const auto by_energy = [&](const Profile& profile) {
      return cheapest(units, [&](const std::string& unit) -> std::optional<double> {
        const auto valid = [&](const Profile& each) {
          const auto* row = each.find_energy(workload, unit);
          return row != nullptr && is_valid(*row);
        };
        return valid(base) && valid(candidate) ? profile.find_energy(workload, unit)->energy_j
                                               : std::nullopt;
      });
    };
    const auto add = [&](const char* by, const auto& choose) {
      const auto before = choose(base);
      const auto after = choose(candidate);
      if (!before || before == after) return;
      const bool clear = std::string_view(by) == "time" && apart(base, workload, *before, *after) &&
                         apart(candidate, workload, *after, *before);
      flips.push_back({workload, by, *before, *after, clear});
    };
    add("time", by_time);
    add("energy", by_energy);
  }
  return flips;
}

Decisions compare_decisions(const Profile& base, const Profile& candidate, const Platform& platform,
                            const Mix& mix) {
  Decisions decisions{.mix = mix.name, .flips = find_flips(base, candidate), .modes = {}};
  const ModeRuns before = run_modes(platform, &base, mix, paper_modes(), {});
  const ModeRuns after = run_modes(platform, &candidate, mix, paper_modes(), {});
  for (const std::string& mode : paper_modes()) {
    ModeCost cost{.mode = mode, .base = run_of(before, mode), .candidate = {}, .reason = ""};
    if (cost.base) cost.candidate = run_of(after, mode);
    if (!cost.candidate) {
      cost.reason = why_not(cost.base ? after : before, mode);
      cost.base.reset();
    }
    decisions.modes.push_back(std::move(cost));
  }
  return decisions;
}

}  // namespace pirt
