#include "reports/run/live_terms.h"

#include <fmt/core.h>

#include <algorithm>
#include <optional>

#include "reports/document/figures.h"

namespace pirt {
namespace {

/// What the condition adds to `execute`, in ms; absent where it was not measured.
std::optional<double> added_ms(const Profile& profile, const CallResult& call,
                               Condition condition) {
  const PhaseRow* steady = profile.find(call.workload, call.unit, Phase::kExecute);
  const PhaseRow* row = profile.find_condition(call.workload, call.unit, condition);
  const bool known = steady != nullptr && row != nullptr && is_used(*steady) && is_used(*row) &&
                     steady->median && row->median;
  if (!known) return std::nullopt;
  return std::max(0.0, to_ms(*row->median) - to_ms(*steady->median));
}

/// Whether the row was played from a sequence of frames, and calls as long were among its samples.
bool depends_on_data(const Profile& profile, const CallResult& call) {
  const PhaseRow* row = profile.find(call.workload, call.unit, Phase::kCall);
  return row != nullptr && row->p95 && call.p50_ms <= to_ms(*row->p95) * (1 + kSameMedian) &&
         std::ranges::any_of(row->notes,
                             [](const auto& note) { return note.starts_with("sequence"); });
}

struct PhaseChange {
  std::string_view name;
  double row_ms = 0, live_ms = 0;
};

/// The transfer or launch that alone is most of the difference between call and row; absent where
/// that is the execution, or not known.
std::optional<PhaseChange> changed_beside_execute(const RowCheck& check, const Profile& profile) {
  const CallResult& live = check.live;
  const double change_ms = live.p50_ms - *check.median_ms;
  std::optional<PhaseChange> most;
  const auto look = [&](Phase phase, const std::optional<double>& live_ms) {
    const PhaseRow* row = profile.find(live.workload, live.unit, phase);
    if (!live_ms || row == nullptr || !is_used(*row) || !row->median) return;
    const PhaseChange found{to_string(phase), to_ms(*row->median), *live_ms};
    if ((found.live_ms - found.row_ms) / change_ms > 0.5) most = found;
  };
  look(Phase::kUpload, live.upload_ms);
  look(Phase::kLaunch, live.launch_ms);
  look(Phase::kDownload, live.download_ms);
  return most;
}

}  // namespace

std::string explanation_of(const RowCheck& check, const Profile& profile) {
  if (check.finding != RowFinding::kContradicted || !check.median_ms) return "";
  const double more_ms = check.live.p50_ms - *check.median_ms;
  if (const auto phase = changed_beside_execute(check, profile)) {
    return fmt::format("its {}: {} ms, {} in its row", phase->name, figure(phase->live_ms),
                       figure(phase->row_ms));
  }
  if (more_ms < 0) return "nothing: faster than its row";
  // Absent is less than any.
  const auto cold = std::max(added_ms(profile, check.live, Condition::kColdCache),
                             added_ms(profile, check.live, Condition::kColdMemory));
  const auto memory = added_ms(profile, check.live, Condition::kBesideMemory);
  const auto compute = added_ms(profile, check.live, Condition::kBesideCompute);
  const double slack_ms = kSameMedian * *check.median_ms;
  const double beside_ms = std::max(memory.value_or(0), compute.value_or(0));
  if (cold && more_ms <= *cold + slack_ms) return "cold caches";
  if (beside_ms > 0 && more_ms <= beside_ms + slack_ms) return "a busy neighbour";
  if (cold && beside_ms > 0 && more_ms <= *cold + beside_ms + slack_ms) {
    return "cold caches and a busy neighbour";
  }
  if (depends_on_data(profile, check.live)) return "its data: within 95 % of its row's samples";
  if (!cold && !memory) return "not known: no row of cold_cache or beside_memory";
  return "more than its rows of other conditions: the operating system, or the clock";
}

std::string left_out_of_prediction(const Profile* profile) {
  if (profile != nullptr && !profile->conditions.empty()) {
    return "Virtual time counts cold caches, busy neighbours and the hand-over between threads as "
           "far "
           "as the profile has rows of them (scheduler/README.md). It leaves out, and a live run "
           "has: "
           "the dispatcher's own time; the operating system with other processes and clock "
           "frequency.";
  }
  return "What virtual time leaves out, and a live run has: cold caches (in a profile calls of one "
         "workload follow each other, here others come between them); memory bandwidth and caches "
         "that units share; the dispatcher's own time and the hand-over between threads; the "
         "operating system with other processes, wake-ups and clock frequency. A profile that is "
         "measured anew, with --interference, has rows of the first of these.";
}

}  // namespace pirt
