// One call of a workload, on its way to a unit and back: what it computes on, and how it ended.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scheduler/mix/task.h"
#include "scheduler/runtime/threads.h"
#include "workloads/base/time.h"
#include "workloads/model/phase.h"
#include "workloads/model/tensor.h"
#include "workloads/model/workload.h"

namespace pirt {

/// The value of a state, in two sets: a call reads the committed one and writes the other. Who made
/// the call commits what it wrote, if it is to count; a call that is given up writes on where
/// nobody reads.
class StateValue {
 public:
  explicit StateValue(const Workload& workload);
  /// What @p other has committed, in memory of its own.
  explicit StateValue(const StateValue& other);
  StateValue& operator=(const StateValue&) = delete;
  [[nodiscard]] std::span<const Tensor> committed() const { return sets_[current_]; }
  [[nodiscard]] std::span<Tensor> next() { return sets_[1 - current_]; }
  /// What the call wrote is the state from now on.
  /// @param version  CallEnd::version of the call.
  void commit(std::uint64_t version);
  /// It has its initial value again. No call that runs may have it.
  void restart();
  /// Another one for each value that any state ever had; 0 = the initial one.
  [[nodiscard]] std::uint64_t version() const { return version_; }

 private:
  std::shared_ptr<const std::vector<Tensor>> initial_;
  std::vector<Tensor> sets_[2];
  std::size_t current_ = 0;
  std::uint64_t version_ = 0;
};

struct CallEnd;

/// One call of a workload. Whoever makes it keeps it, and its tensors and its state to it, until it
/// is done; one that is given up is its unit's for good.
struct Call {
  const Workload* workload = nullptr;
  std::vector<Tensor> inputs;
  std::shared_ptr<std::vector<Tensor>> outputs;  ///< Null if the workload has none.
  std::shared_ptr<StateValue> state = {};        ///< Null if the workload has none.
  Outcome intended = Outcome::kCompleted;        ///< Otherwise it runs, and commits nothing.
  std::uint64_t token = 0;                       ///< The caller's.
  std::optional<Nanos> wanted_until = {};        ///< By LiveClock; later, nobody takes its result.

  /// Of one that completed: what it wrote is the state from now on, if it has one.
  void commit(const CallEnd& end);
  /// Nothing of others is held by it any more.
  void let_go() {
    inputs.clear();
    state = nullptr;
    outputs = nullptr;
  }

  // The unit's, while it has the call.
  runtime::Atomic<bool> unwanted = false;  ///< It was withdrawn.
  Call* neighbour = nullptr;               ///< In the list that it waits in.
};

/// What the phases of a call took, as a profile has them. Making a kernel and moving a state
/// between units are none of it.
struct CallTimes {
  Nanos upload{0}, execute{0}, download{0};
  std::optional<Nanos> launch = {};  ///< Where the device stamps it; no part of `execute`.

  /// @param phase  Of a call, or the call as a whole.
  [[nodiscard]] Nanos of(Phase phase) const;
};

/// How a call ended.
struct CallEnd {
  Outcome outcome = Outcome::kCompleted;
  Nanos busy{0};
  Nanos at{0};                          ///< By LiveClock.
  std::optional<Nanos> preparing = {};  ///< Part of `busy`; absent = the kernel was there.
  std::uint64_t version = 0;            ///< Of the state that it wrote, if it completed.
  /// It was given back since its unit was out of reach, or since nobody wanted it there any more:
  /// nothing is wrong with unit and workload.
  bool excused = false;
  std::string problem = {};  ///< Of one that failed, with the names of workload and unit.
  CallTimes times = {};      ///< Of one that completed.
  Nanos awake{0};            ///< What the unit's thread has spent awake, waiting for the call.

  /// What drew the unit's active_w: all, but of a call elsewhere what moved data.
  [[nodiscard]] Nanos powered(bool elsewhere) const {
    return elsewhere ? times.upload + times.download : busy + awake;
  }
};

}  // namespace pirt
