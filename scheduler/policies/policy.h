// A policy chooses a unit for a task; `--mode` names one (policies.inc).
//
// Policies own no queue and no load: the dispatcher has both and shows them. A policy may keep
// counters of its own, as Algorithm 1 does.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "characterize/platform/platform.h"
#include "scheduler/mix/task.h"
#include "scheduler/planner/budget_plan.h"
#include "scheduler/planner/mix_plan.h"
#include "scheduler/planner/planner.h"
#include "scheduler/services/call_plan.h"
#include "scheduler/services/eligibility.h"
#include "scheduler/services/services.h"

namespace pirt {

/// Weight of each unit for each workload: [workload][unit], >= 0.
using WeightTable = std::vector<std::vector<int>>;

struct Placement {
  enum class Kind : std::uint8_t { kUnit, kHold, kHoldFor, kHoldBehind, kHighPriority };
  Kind kind = Kind::kHold;
  UnitId unit = 0;           ///< Of kUnit only.
  std::uint64_t awaits = 0;  ///< Of kHoldFor a UnitMask, of kHoldBehind an entry.

  [[nodiscard]] static Placement on(UnitId unit) { return {Kind::kUnit, unit}; }
  /// The same until a load falls, a unit changes, or a task that waits is gone.
  [[nodiscard]] static Placement hold() { return {}; }
  /// The same, whatever the time, until the load of one of these falls or a unit changes.
  [[nodiscard]] static Placement hold_for(UnitMask units) {
    return {.kind = Kind::kHoldFor, .awaits = units};
  }
  /// The same whatever loads and units do, until a task of that entry is placed, or gone.
  [[nodiscard]] static Placement hold_behind(std::uint32_t entry) {
    return {.kind = Kind::kHoldBehind, .awaits = entry};
  }
  [[nodiscard]] static Placement high_priority() { return {.kind = Kind::kHighPriority}; }
  [[nodiscard]] bool holds() const { return kind != Kind::kUnit && kind != Kind::kHighPriority; }
};

/// What the dispatcher shows when it asks.
struct UnitsView {
  std::span<const int> load;  ///< Q of the paper: tasks queued and running, by unit.
  UnitMask up = 0;
  Nanos now{0};
};

/// A task of which a policy hears.
struct MovedTask {
  const TaskClass& kind;
  Nanos deadline = Nanos::max();  ///< Of its firing; Nanos::max() = none.
};

/// Where a task is: with a unit, queued or running; or it waits; or, when it has ended, nowhere.
struct Whereabouts {
  enum class Kind : std::uint8_t { kNowhere, kWaiting, kUnit };
  Kind kind = Kind::kNowhere;
  UnitId unit = 0;  ///< Of kUnit only.

  [[nodiscard]] static constexpr Whereabouts nowhere() { return {}; }
  /// From its submission: for its predecessors, held, or in the high-priority queue.
  [[nodiscard]] static constexpr Whereabouts waiting() { return {.kind = Kind::kWaiting}; }
  [[nodiscard]] static constexpr Whereabouts on(UnitId unit) { return {Kind::kUnit, unit}; }
  [[nodiscard]] bool waits() const { return kind == Kind::kWaiting; }
  [[nodiscard]] bool is_placed() const { return kind == Kind::kUnit; }
};

/// Deterministic: the same calls in the same order give the same answers. Used by one dispatcher.
class Policy {
 public:
  virtual ~Policy() = default;
  /// Where a waiting task goes; moved() says when it does. A refusal stands for every task of the
  /// class, for as long as it says.
  [[nodiscard]] virtual Placement place(const TaskClass& task, const UnitsView& units) = 0;
  /// The units of @p up that the policy might ever let serve the class; those take it from the
  /// high-priority queue.
  [[nodiscard]] virtual UnitMask takers(const TaskClass& task, UnitMask up) const = 0;
  /// The units that are asked first when several are idle and could take a task, in this order;
  /// those that it does not name follow in the platform's.
  [[nodiscard]] virtual std::vector<UnitId> order() const { return {}; }
  /// Queues are served by rising rank, then in the order in which tasks became ready. Asked once
  /// for each task, when it is submitted.
  [[nodiscard]] virtual Nanos rank(const Task& /*task*/) { return Nanos::zero(); }
  /// A task was placed on a unit, by place() or out of the high-priority queue; waits again, since
  /// its unit gave it back or is away; or has ended, on a unit or before it was placed.
  /// @param units  The loads are without the task.
  virtual void moved(const MovedTask& /*task*/, Whereabouts /*from*/, Whereabouts /*to*/,
                     const UnitsView& /*units*/) {}
  /// Other units are up than before.
  virtual void units_changed(UnitMask /*up*/) {}
  /// When what it holds is worth asking for again though nothing happens until then; what is past
  /// stands for never.
  [[nodiscard]] virtual Nanos ask_again() const { return Nanos::max(); }
  /// Tasks that it placed although a cap of power spoke against it.
  [[nodiscard]] virtual std::int64_t over_cap() const { return 0; }
};

struct PolicyInfo;

/// All that a policy may see: neither names nor distributions, nor what is to come. It hears of
/// tasks through the calls above.
struct PolicySetup {
  std::vector<Role> roles;   ///< By unit.
  std::vector<int> servers;  ///< By unit, >= 1.
  CostTable costs;
  MixPlan plan;       ///< Of modes that follow a static plan; otherwise empty.
  BudgetPlan budget;  ///< Of mode budget; otherwise empty.
  /// The same for when one unit is away, by unit; none, or one without tasks, where nothing else
  /// was planned.
  std::vector<BudgetPlan> budget_without = {};
  WeightTable weights;
  /// Algorithms 2 and 3: take the printed `else` instead of holding.
  bool literal_overflow = false;
  const PolicyInfo* basic = nullptr;    ///< Of a policy that falls back to one.
  const PolicyInfo* follows = nullptr;  ///< Of mode budget: what decides in its place.
  std::uint64_t seed = 1;               ///< Of one that draws: its only source of chance.
};

/// How weights are derived when none are given; see weights.h.
enum class WeightRule : std::uint8_t {
  kNone,       ///< It has none.
  kShare,      ///< Algorithm 1: in proportion to speed.
  kQueue,      ///< Algorithm 3: what keeps the unit busy.
  kFastQueue,  ///< Algorithm 2: the same, without the slow units.
  kOfBasic,    ///< That of the policy's basic one.
};

struct PolicyInfo {
  std::string_view name;
  std::string_view description;
  std::unique_ptr<Policy> (*make)(const PolicySetup& setup) = nullptr;
  WeightRule rule = WeightRule::kNone;
  bool overflows = false;  ///< Has a printed `else` for full queues.
  CloudUse cloud_use = CloudUse::kNone;
  std::optional<Role> needs_role = {};  ///< Of some unit of the platform.
  Planner planner = nullptr;            ///< What makes its plan; null = it has none.
  bool budgets = false;                 ///< It follows a BudgetPlan.
  /// What it does where nobody knows a unit's joules: "takes it last"; empty = it asks for none.
  std::string_view without_joules = {};

  /// Whether it falls back to a basic policy, as advanced does.
  [[nodiscard]] bool has_basic() const { return rule == WeightRule::kOfBasic; }
};

/// PolicyInfo::make of a class that is made from its setup.
template <typename Made>
std::unique_ptr<Policy> make_policy(const PolicySetup& setup) {
  return std::make_unique<Made>(setup);
}

/// What --mode and --basic name.
struct Mode {
  const PolicyInfo& policy;
  const PolicyInfo* basic = nullptr;  ///< Null if the policy falls back to none.

  /// Whose weights count.
  [[nodiscard]] const PolicyInfo& weighed() const { return basic == nullptr ? policy : *basic; }
};
/// @throws Error{kBadInput} with the nearest names, also if the policy has no use for @p basic.
[[nodiscard]] Mode find_mode(std::string_view name, std::string_view basic = "throughput");

[[nodiscard]] std::span<const PolicyInfo> policies();
[[nodiscard]] std::vector<std::string> policy_names();
/// Those that plan nothing ahead: what a runtime can follow, which does not know what comes.
[[nodiscard]] std::vector<std::string> runtime_policy_names();
/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] const PolicyInfo& find_policy(std::string_view name);
/// @param names  With commas; each counts once.
/// @throws Error{kBadInput} as find_policy.
[[nodiscard]] std::vector<std::string> find_policies(std::string_view names);
/// One of those that advanced can fall back to. @throws Error{kBadInput} with the names.
[[nodiscard]] const PolicyInfo& find_basic_policy(std::string_view name);

}  // namespace pirt
