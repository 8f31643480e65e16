#include "scheduler/trace/replay.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <tuple>

#include "scheduler/trace/trace_document.h"
#include "workloads/base/error.h"
#include "workloads/base/text/text.h"

namespace pirt {
namespace {

using InputKind = DispatcherInput::Kind;

bool same(const Effects& a, const Effects& b) {
  const auto logged = [](const Start& start) {
    return std::tuple(start.task, start.unit, start.dispatched_at, start.ready_at);
  };
  return a.submitted == b.submitted && a.ended == b.ended && a.suspended == b.suspended &&
         a.resumed == b.resumed && std::ranges::equal(a.started, b.started, {}, logged, logged);
}

/// By TaskEnd. What completes does so by its unit's word, and does not stand among ends.
constexpr std::array<std::string_view, kTaskEnds.size()> kVerbs = {
    "drops", "fails", "drops", "expires", "drops", "drops, for want of an earlier firing's data,"};

class Replay {
 public:
  explicit Replay(const DispatcherSetup& setup)
      : setup_(setup), dispatcher_(setup.slots, setup.mode->make(setup.policy)) {}

  /// @return  Whether all has been the same so far.
  bool take(const LogEntry& entry) {
    check(entry);
    Effects out;
    const bool taken = give(entry, out);
    const auto position = static_cast<std::size_t>(result_.inputs++);
    if (taken == entry.taken && same(entry.effects, out)) {
      result_.decisions += static_cast<std::int64_t>(out.started.size() + out.ended.size());
      return true;
    }
    result_.difference = {.entry = position,
                          .at = entry.input.now,
                          .input = describe(entry),
                          .recorded = describe(entry.taken, entry.effects),
                          .replayed = describe(taken, out)};
    return false;
  }
  [[nodiscard]] const ReplayResult& result() const { return result_; }

 private:
  void require(bool condition, const std::string& what) const {
    if (condition) return;
    throw_bad_input(fmt::format("input {} of the log: {}", result_.inputs + 1, what));
  }

  /// What the dispatcher cannot know: the tables of the policy.
  void check(const LogEntry& entry) {
    require(entry.input.now >= now_, "its time is before that of the one before");
    now_ = entry.input.now;
    for (const Task& task : entry.tasks) check_class(task.kind);
  }

  void check_class(const TaskClass& kind) const {
    const PolicySetup& policy = setup_.policy;
    const std::size_t units = setup_.units.size();
    const UnitMask known =
        units == kMaxUnits ? ~UnitMask{0} : unit_bit(static_cast<UnitId>(units)) - 1;
    require(kind.workload < policy.costs.size(), "names no workload");
    require(kind.eligible != 0 && (kind.eligible & ~known) == 0, "names no unit");
    for (UnitId unit = 0; unit < units; ++unit) {
      require(!contains(kind.eligible, unit) || policy.costs[kind.workload][unit].has_value(),
              "names a unit without a time for its workload");
    }
    require(!setup_.mode->budgets || kind.entry < policy.budget.tasks.size(),
            "has no place in the plan");
    if (policy.plan.entries.empty()) return;
    require(kind.entry < policy.plan.entries.size() &&
                contains(kind.eligible, policy.plan.entries[kind.entry].unit),
            "has no place in the plan");
  }

  bool give(const LogEntry& entry, Effects& out) {
    const DispatcherInput& input = entry.input;
    switch (input.kind) {
      case InputKind::kSubmit:
        return dispatcher_.submit(entry.tasks, now_, out).has_value();
      case InputKind::kRelease:
        return dispatcher_.release(input.firing, now_);
      case InputKind::kComplete:
        return dispatcher_.complete(input.unit, input.task, input.outcome, now_, out);
      case InputKind::kCancel:
        dispatcher_.cancel(input.task, now_, out);
        return true;
      case InputKind::kSetUnit:
        return dispatcher_.set_unit(input.unit, input.state, now_, out);
      case InputKind::kSliceEnded:
        return dispatcher_.slice_ended(input.unit, input.task, now_, out);
      case InputKind::kWake:
        break;
    }
    dispatcher_.wake(now_, out);
    return true;
  }

  std::string unit_name(UnitId unit) const {
    return unit < setup_.units.size() ? setup_.units[unit] : std::to_string(unit);
  }

  std::string describe(const LogEntry& entry) const {
    const DispatcherInput& input = entry.input;
    switch (input.kind) {
      case InputKind::kSubmit:
        return fmt::format("submit firing {}: task {}", input.firing,
                           fmt::join(entry.effects.submitted, ", "));
      case InputKind::kRelease:
        return fmt::format("release firing {}", input.firing);
      case InputKind::kComplete:
        return fmt::format("complete task {} on {}{}", input.task, unit_name(input.unit),
                           input.outcome == Outcome::kReturned ? ", which gives it back" : "");
      case InputKind::kCancel:
        return fmt::format("cancel task {}", input.task);
      case InputKind::kSetUnit:
        return fmt::format("change of unit {}", unit_name(input.unit));
      case InputKind::kSliceEnded:
        return fmt::format("slice of task {} on {}", input.task, unit_name(input.unit));
      case InputKind::kWake:
        break;
    }
    return "wake";
  }

  std::string describe(bool taken, const Effects& effects) const {
    if (!taken) return "refuses it";
    std::vector<std::string> parts;
    for (const Sliced& each : effects.suspended) {
      parts.push_back(fmt::format("leaves task {} on {}", each.task, unit_name(each.unit)));
    }
    for (const Start& each : effects.started) {
      parts.push_back(fmt::format("starts task {} on {} (ready at {} ns, dispatched at {} ns)",
                                  each.task, unit_name(each.unit), each.ready_at.count(),
                                  each.dispatched_at.count()));
    }
    for (const Sliced& each : effects.resumed) {
      parts.push_back(fmt::format("goes on with task {} on {}", each.task, unit_name(each.unit)));
    }
    for (const Ended& each : effects.ended) {
      parts.push_back(
          fmt::format("{} task {}", kVerbs[static_cast<std::size_t>(each.how)], each.task));
    }
    return parts.empty() ? "nothing" : join(parts, ", ");
  }

  const DispatcherSetup& setup_;
  Dispatcher dispatcher_;
  ReplayResult result_;
  Nanos now_ = Nanos::min();
};

}  // namespace

FileReplay replay_file(const std::filesystem::path& path) {
  std::optional<Replay> replay;
  const LogFile log = read_log(path, [&](const DispatcherSetup& setup, const LogEntry& entry) {
    if (!replay) replay.emplace(setup);
    return replay->take(entry);
  });
  return {log.setup.mode, log.size, replay ? replay->result() : ReplayResult(), log.complete};
}

}  // namespace pirt
