#include "scheduler/trace/replay.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "scheduler/trace/trace_reader.h"
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

std::string_view verb(TaskEnd how) {
  switch (how) {
    case TaskEnd::kExpired:
      return "expires";
    case TaskEnd::kNoPredecessor:
      return "drops, for want of an earlier firing's data,";
    case TaskEnd::kFailed:
      return "fails";
    default:
      return "drops";
  }
}

class Replay {
 public:
  Replay(const DispatcherSetup& setup, const std::string& source)
      : setup_(setup), source_(source), dispatcher_(setup.slots, setup.mode->make(setup.policy)) {}

  /// @param next  std::optional<LogEntry>(): absent after the last.
  template <typename Next>
  ReplayResult run(const Next& next) {
    ReplayResult result;
    for (position_ = 0; const auto given = next(); ++position_) {
      const LogEntry& entry = *given;
      check(entry);
      Effects out;
      const bool taken = give(entry, out);
      ++result.inputs;
      if (taken != entry.taken || !same(entry.effects, out)) {
        result.difference = {.entry = position_,
                             .at = entry.input.now,
                             .input = describe(entry),
                             .recorded = describe(entry.taken, entry.effects),
                             .replayed = describe(taken, out)};
        return result;
      }
      result.decisions += static_cast<std::int64_t>(out.started.size() + out.ended.size());
    }
    return result;
  }

 private:
  void require(bool condition, const std::string& what) const {
    if (condition) return;
    throw_bad_input(fmt::format("{}: input {} of the log: {}", source_, position_ + 1, what));
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
      parts.push_back(fmt::format("{} task {}", verb(each.how), each.task));
    }
    return parts.empty() ? "nothing" : join(parts, ", ");
  }

  const DispatcherSetup& setup_;
  const std::string& source_;
  Dispatcher dispatcher_;
  std::size_t position_ = 0;
  Nanos now_ = Nanos::min();
};

}  // namespace

FileReplay replay_file(const std::filesystem::path& path) {
  TraceReader reader(path);
  auto result = Replay(reader.setup(), path.string()).run([&] { return reader.next(); });
  return {reader.setup().mode, reader.size(), std::move(result), !reader.ends_in_the_middle()};
}

}  // namespace pirt
