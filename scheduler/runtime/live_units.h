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
#include "scheduler/runtime/output_pool.h"
#include "scheduler/runtime/threads.h"
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

/// Whoever gives units their calls: the library's engine, a live mix.
class LiveDriver {
 public:
  /// What a call is expected to take; where nobody says, how long it may: absent = as it likes,
  /// unless there is a limit for all.
  struct Expectation {
    const Service* service = nullptr;
    std::optional<Nanos> otherwise = {};
  };

  // From a unit's thread. They must not throw.

  /// After each call, which has its inputs no more.
  virtual void ended(UnitId unit, Call& call, CallEnd& end) = 0;
  /// As UnitSetup.
  virtual void slice_ended(UnitId unit, Call& call) = 0;

  // From within LiveUnits' open, make_ready and look_*.

  /// What the unit may be asked for; nothing, and it is not opened.
  [[nodiscard]] virtual std::vector<Preparation> preparations(UnitId unit) = 0;
  /// Of what is not as it should be.
  virtual void add_problem(std::string problem) = 0;
  [[nodiscard]] virtual Expectation expected(UnitId unit, const Call& call) = 0;
  virtual void set_unit(UnitId unit, UnitState state) = 0;
  /// The call never ends: kFailed, and it is its unit's for good; or it will not begin, on a unit
  /// that has gone: kReturned, and what it reads is to be free for others.
  virtual void give_up(UnitId unit, Call& call, CallEnd end) = 0;

 protected:
  ~LiveDriver() = default;
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
  bool slices = false;  ///< Calls are suspended where they can be.
};

/// Threads: the driver's, one at a time.
class LiveUnits {
 public:
  /// @param platform  Must outlive it, as must the driver.
  LiveUnits(const Platform& platform, LiveUnitsOptions options, LiveDriver& driver);
  ~LiveUnits();
  LiveUnits(const LiveUnits&) = delete;
  LiveUnits& operator=(const LiveUnits&) = delete;

  /// Opens the units side by side and prepares what each may be asked for, until all are ready.
  /// @throws What opening and preparing throw, with the unit's name; Error{kEnvironment} for a unit
  /// that is not ready after a long time, or once somebody wants to stop.
  void open();
  /// Waits for the calls that run, but for those that hang; nothing runs from then on.
  void close();

  /// For threads that serve the run: all that this program may use, wherever who made this is
  /// bound.
  [[nodiscard]] const std::vector<int>& cores() const { return cores_; }
  [[nodiscard]] bool has(UnitId unit) const { return units_[unit] != nullptr; }
  [[nodiscard]] const KernelUnit& at(UnitId unit) const { return *units_[unit]; }
  /// A state that calls are filled with, the next one.
  void add_state(const Workload& workload) {
    states_.push_back(std::make_shared<StateValue>(workload));
  }
  [[nodiscard]] StateValue& state(std::size_t state) { return *states_[state]; }
  /// All that a call of the workload there has, but for its inputs, and who it is to its driver.
  /// @param recall  By the clock of whoever says when that @p began.
  void fill(UnitId unit, Call& call, const Workload& workload, std::optional<std::size_t> state,
            const std::optional<Recall>& recall, Nanos began);
  void run(UnitId unit, Call& call, bool let_in = false) {
    let_in ? units_[unit]->let_in(call) : units_[unit]->run(call);
  }
  void go_on(UnitId unit) { units_[unit]->go_on(); }
  void request_stop(UnitId unit, Call& call) { units_[unit]->request_stop(call); }

  /// Another one in place of a unit that is out of service; any thread may make it, and hands it to
  /// whoever drives the units.
  /// @throws As open.
  [[nodiscard]] KernelUnit::Owner make_ready(UnitId unit);
  /// @param fresh  Runs the unit's calls from now on.
  /// @return  What did so far, and has none.
  [[nodiscard]] KernelUnit::Owner replace(UnitId unit, KernelUnit::Owner fresh);

  /// Calls that do not end: their units are abandoned, and nothing is heard of their calls any
  /// more; a state that one has is as it was before it. One that does not end elsewhere is
  /// withdrawn, and its unit stays in service.
  /// @param due  When it was to look, by LiveClock: where that is long ago the process was stopped,
  ///             and no call ran.
  void look_for_hung(Nanos due);
  /// When the first of the calls that ran then will have run too long; by LiveClock.
  [[nodiscard]] Nanos next_overdue() const { return next_overdue_; }
  /// So often calls that run are to be looked at: no call may take less, and a process that stood
  /// still is to be told; what is elsewhere may get out of reach at any time.
  [[nodiscard]] Nanos look_every() const { return look_every_; }

  /// Units whose device is out of reach or lost, or there again, since this was asked last. One
  /// that is lost is opened again once nobody holds what it made, and after kLongestLost is so for
  /// good.
  void look_for_reach();
  static constexpr Nanos kLongestLost = std::chrono::seconds(10);
  /// By then.
  [[nodiscard]] bool any_out_of_reach() const {
    return std::ranges::any_of(out_of_reach_, [](const auto& since) { return since.has_value(); });
  }
  /// Units that were out of reach when that was looked for last, and have not been for so long that
  /// a call that waits there would have ended.
  [[nodiscard]] bool any_may_come_back() const;

 private:
  [[nodiscard]] KernelUnit::Owner make(UnitId unit, std::vector<Preparation> preparations);
  void wait_until_ready(KernelUnit& unit, Nanos until) const;
  [[nodiscard]] std::optional<Nanos> limit_of(UnitId unit, const Call& call) const;
  void look_for_lost(UnitId unit);
  void give_up(UnitId unit, Call& call, Nanos ran, const std::vector<Call*>& behind);
  void give_up_for_good(UnitId unit, Call& call, CallEnd end);
  void say(const std::string& line) const {
    if (options_.progress) options_.progress(line);
  }

  const Platform& platform_;
  LiveUnitsOptions options_;
  LiveDriver& driver_;
  const std::vector<int> cores_ = usable_cores();
  runtime::LiveClock clock_;
  OutputPool outputs_;
  std::vector<std::shared_ptr<StateValue>> states_;
  Nanos spin_{0};  ///< Of units that compute here.
  Nanos look_every_{0};
  Nanos counts_from_{0};  ///< The time of calls that began before.
  Nanos next_overdue_ = Nanos::max();
  std::vector<std::optional<Nanos>> out_of_reach_;  ///< By unit, as the driver was told: since.
  struct Lost {
    std::optional<std::weak_ptr<TensorMemory>> memory;  ///< Once it was taken: in use by then.
    bool for_good = false;
  };
  std::map<UnitId, Lost> lost_;
  std::vector<KernelUnit::Owner> units_;  ///< Last: their threads use all of it.
};

}  // namespace pirt
