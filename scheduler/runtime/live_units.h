// The units of a live run, or of the runtime, that compute: opened side by side, prepared, given
// their calls, and watched. What is known of their health is here, for both.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/runtime/kernel_unit.h"
#include "scheduler/runtime/time_limit.h"

namespace pirt {

/// What went wrong, for whoever reads it afterwards: the first few.
class Problems {
 public:
  void add(std::string problem) {
    ++count_;
    if (first_.size() < kMost) first_.push_back(std::move(problem));
  }
  [[nodiscard]] const std::vector<std::string>& first() const { return first_; }
  [[nodiscard]] std::int64_t count() const { return count_; }

 private:
  static constexpr std::size_t kMost = 20;
  std::vector<std::string> first_;
  std::int64_t count_ = 0;
};

struct LiveUnitsOptions {
  bool prepare_first = true;
  std::optional<Nanos> time_limit = {};  ///< Of each call; absent = by what is expected of it.
  int priority = 0;                      ///< As UnitSetup.
  /// The same, of units whose platform says no less; where units that compute here have no core
  /// each: none.
  Nanos spin = kMostSpin;
  std::shared_ptr<const void> keeps = {};
  std::function<int()> stop = {};  ///< Whether somebody wants no start any more; empty = never.
  std::function<void(const std::string&)> progress = {};
  /// As UnitSetup. Empty = calls are not suspended.
  std::function<void(UnitId unit, Call& call)> slice_ended = {};
};

/// Threads: whoever drives them, one at a time, but for `done`.
class LiveUnits {
 public:
  using Done = std::function<void(UnitId unit, Call& call, CallEnd& end)>;

  /// @param platform  Must outlive it.
  /// @param done      Called from the unit's thread after each call; must not throw.
  LiveUnits(const Platform& platform, LiveUnitsOptions options, Done done);
  ~LiveUnits();
  LiveUnits(const LiveUnits&) = delete;
  LiveUnits& operator=(const LiveUnits&) = delete;

  /// Begins to open the units and to prepare what each may be asked for. Once.
  void open(std::map<UnitId, std::vector<Preparation>> preparations);
  /// Until all are ready.
  /// @return  What is not as it was asked for.
  /// @throws What opening and preparing throw, with the unit's name; Error{kEnvironment} for a unit
  /// that is not ready after a long time, or once somebody wants to stop.
  std::vector<std::string> wait_until_ready();
  /// Waits for the calls that run, but for those that hang; nothing runs from then on.
  void close();

  [[nodiscard]] bool has(UnitId unit) const { return units_[unit] != nullptr; }
  [[nodiscard]] const KernelUnit& at(UnitId unit) const { return *units_[unit]; }
  void run(UnitId unit, Call& call, bool let_in = false) {
    if (let_in) {
      units_[unit]->let_in(call);
    } else {
      units_[unit]->run(call);
    }
  }
  void go_on(UnitId unit) { units_[unit]->go_on(); }
  bool request_stop(UnitId unit, Call& call) { return units_[unit]->request_stop(call); }

  /// Another one in place of a unit that is out of service; any thread may make it, and hands it to
  /// whoever drives the units.
  /// @throws As wait_until_ready.
  [[nodiscard]] std::unique_ptr<KernelUnit> make_ready(UnitId unit,
                                                       std::vector<Preparation> preparations);
  /// @param fresh  Runs the unit's calls from now on.
  /// @return  What did so far, and has none.
  [[nodiscard]] std::unique_ptr<KernelUnit> replace(UnitId unit, std::unique_ptr<KernelUnit> fresh);
  /// The end of it.
  static void close(std::unique_ptr<KernelUnit> unit);

  /// A call that does not end. Its unit is abandoned: nothing is heard of its calls any more. One
  /// that does not end elsewhere is withdrawn, and its unit stays in service.
  struct Hung {
    UnitId unit = 0;
    std::uint64_t token = 0;
    std::vector<std::uint64_t> behind;     ///< Of the calls that waited behind it,
    std::vector<std::uint64_t> suspended;  ///< and of those that it was let into: they never end.
    Nanos ran{0};
  };
  /// What a call is expected to take; where nobody says, how long it may: absent = as it likes,
  /// unless there is a limit for all.
  struct Expectation {
    const Service* service = nullptr;
    std::optional<Nanos> otherwise = {};
  };
  /// @param expected  Expectation(UnitId, std::uint64_t token).
  template <typename Expected>
  [[nodiscard]] std::vector<Hung> abandon_hung(const Expected& expected) {
    std::vector<Hung> hung;
    next_overdue_ = Nanos::max();
    for (UnitId unit = 0; unit < units_.size(); ++unit) {
      if (units_[unit] == nullptr) continue;
      for (const KernelUnit::Running& call : units_[unit]->running()) {
        const auto limit = limit_of(unit, expected(unit, call.token));
        const Nanos ran = clock_.now() - call.since;
        if (limit && ran <= *limit) {
          next_overdue_ = std::min(next_overdue_, later_by(call.since, *limit));
        }
        if (!limit || ran <= *limit) continue;
        if (units_[unit]->is_remote()) {
          if (units_[unit]->request_stop(call)) {
            say(units_[unit]->name() + " has not answered a call in time; it is withdrawn");
          }
          continue;
        }
        auto behind = units_[unit]->abandon(call);
        if (behind) {
          hung.push_back({unit, call.token, *std::move(behind), units_[unit]->suspended(), ran});
        }
      }
    }
    return hung;
  }

  /// When the first of the calls that ran then will have run too long; by MachineClock.
  [[nodiscard]] Nanos next_overdue() const { return next_overdue_; }
  /// So often calls that run are to be looked at: no call may take less; and what is elsewhere may
  /// get out of reach at any time.
  [[nodiscard]] Nanos look_every() const { return look_every_; }

  /// A unit whose device is out of reach, or within it again, since this was asked last.
  struct Reach {
    UnitId unit = 0;
    UnitState state = UnitState::kUp;
  };
  [[nodiscard]] std::vector<Reach> changed_reach();
  /// By then.
  [[nodiscard]] bool any_out_of_reach() const {
    return std::ranges::any_of(out_of_reach_, [](const auto& since) { return since.has_value(); });
  }
  /// Units that were out of reach when that was asked last, and have not been for so long that a
  /// call that waits there would have ended.
  [[nodiscard]] bool any_may_come_back() const;

  /// Hears how each call ended. How often calls of the workload have now been given back by the
  /// unit, in a row.
  int count_returns(UnitId unit, WorkloadId workload, const CallEnd& end);
  /// So often, and the unit is no longer asked for the workload.
  static constexpr int kMostReturns = 3;
  void forget_returns(UnitId unit) { returns_[unit].clear(); }

 private:
  [[nodiscard]] std::unique_ptr<KernelUnit> make(UnitId unit,
                                                 std::vector<Preparation> preparations);
  void wait_until_ready(KernelUnit& unit, Nanos until) const;
  [[nodiscard]] std::optional<Nanos> limit_of(UnitId unit, const Expectation& expected) const;
  void say(const std::string& line) const {
    if (options_.progress) options_.progress(line);
  }

  const Platform& platform_;
  LiveUnitsOptions options_;
  Done done_;
  MachineClock clock_;
  Nanos spin_{0};  ///< Of units that compute here.
  Nanos look_every_{0};
  Nanos next_overdue_ = Nanos::max();
  std::vector<std::map<WorkloadId, int>> returns_;  ///< By unit; of those that gave any back.
  std::vector<std::optional<Nanos>> out_of_reach_;  ///< By unit, as changed_reach() told it: since.
  std::vector<std::unique_ptr<KernelUnit>> units_;  ///< Last: their threads use all of it.
};

}  // namespace pirt
