// A policy chooses a unit for a task; the table of all policies is what `--mode` names.
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

#include "scheduler/mix/task.h"
#include "scheduler/planner/mix_plan.h"
#include "scheduler/planner/planner.h"

namespace pirt {

/// Weight of each unit for each workload: [workload][unit], >= 0.
using WeightTable = std::vector<std::vector<int>>;

struct Placement {
  enum class Kind : std::uint8_t { kUnit, kHold, kHighPriority };
  Kind kind = Kind::kHold;
  UnitId unit = 0;  ///< Of kUnit only.

  [[nodiscard]] static Placement on(UnitId unit) { return {Kind::kUnit, unit}; }
  [[nodiscard]] static Placement hold() { return {Kind::kHold, 0}; }
  [[nodiscard]] static Placement high_priority() { return {Kind::kHighPriority, 0}; }
};

/// What the dispatcher shows when it asks.
struct UnitsView {
  std::span<const int> load;  ///< Q of the paper: tasks queued and running, by unit.
  UnitMask up = 0;
  Nanos now{0};
};

/// Deterministic: the same calls in the same order give the same answers. Used by one dispatcher.
class Policy {
 public:
  virtual ~Policy() = default;
  /// Where a waiting task goes. A refusal (kHold) stands for every task of the class until a load
  /// falls or a unit changes.
  [[nodiscard]] virtual Placement place(const TaskClass& task, const UnitsView& units) = 0;
  /// The units of @p up that the policy might ever let serve the class; those take it from the
  /// high-priority queue.
  [[nodiscard]] virtual UnitMask takers(const TaskClass& task, UnitMask up) const = 0;
  /// The order in which idle units are asked when several could take a task.
  [[nodiscard]] virtual const std::vector<UnitId>& order() const = 0;
  /// Queues are served by rising rank, then in the order in which tasks became ready.
  [[nodiscard]] virtual Nanos rank(const Task& task) const {
    static_cast<void>(task);
    return Nanos::zero();
  }
  /// The unit took a task of the class from the high-priority queue; the load shown is without it.
  virtual void took(const TaskClass& task, UnitId unit, const UnitsView& units) {
    static_cast<void>(task);
    static_cast<void>(unit);
    static_cast<void>(units);
  }
  /// A task of the class was dropped or expired before it was placed.
  virtual void gone(const TaskClass& task) { static_cast<void>(task); }
};

/// What a call is expected to take on a unit that nobody else uses.
struct ServiceTime {
  Nanos total{0};
  Nanos occupied{
      0};  ///< Of which it occupies one of the unit's servers, so that the next one waits.
};

struct PolicySetup {
  std::vector<std::string> roles;                              ///< By unit.
  std::vector<int> servers;                                    ///< By unit, >= 1.
  std::vector<std::vector<std::optional<ServiceTime>>> times;  ///< [workload][unit]
  MixPlan plan;  ///< Of modes that have a planner; otherwise empty.
  WeightTable weights;
  bool literal_overflow =
      false;  ///< Algorithms 2 and 3: take the printed `else` instead of holding.
  std::string basic = "throughput";  ///< Fallback of advanced.
};

/// How weights are derived when none are given; see weights.h.
enum class WeightRule : std::uint8_t {
  kShare,      ///< Algorithm 1: in proportion to speed.
  kQueue,      ///< Algorithm 3: what keeps the unit busy.
  kFastQueue,  ///< Algorithm 2: the same, without the slow units.
  kOfBasic,    ///< That of the policy's basic one.
  kNone,       ///< It has none.
};

struct PolicyInfo {
  std::string_view name;
  std::string_view description;
  WeightRule rule;
  std::unique_ptr<Policy> (*make)(const PolicySetup& setup);
  std::string_view needs_role = {};  ///< Of some unit of the platform; empty = none.
  Planner planner = nullptr;         ///< What makes its plan; null = it has none.

  /// Whether it falls back to a basic policy, as advanced does; that one also sends tasks to the
  /// cloud.
  [[nodiscard]] bool has_basic() const { return rule == WeightRule::kOfBasic; }
};

[[nodiscard]] std::span<const PolicyInfo> policies();
[[nodiscard]] std::vector<std::string> policy_names();
/// @throws Error{kBadInput} with the nearest names.
[[nodiscard]] const PolicyInfo& find_policy(std::string_view name);
/// One of those that advanced can fall back to. @throws Error{kBadInput} with the names.
[[nodiscard]] const PolicyInfo& find_basic_policy(std::string_view name);

}  // namespace pirt
