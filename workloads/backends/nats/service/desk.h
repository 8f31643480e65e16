// The worker's side: which robot is asked for a task next. A pure state machine, as Caller.
//
// Tasks wait at their robots; what is known of them here is small and bounded. A free slot goes to
// the robot that has the fewest slots now, and of those to the one that has used the least time: a
// robot that has many tasks waiting, or lets a claim run out, takes its share and no more. One
// caller at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "workloads/base/time.h"

namespace pirt::cloud {

struct DeskLimits {
  int slots = 1;
  Nanos claim = std::chrono::seconds(2);   ///< For a robot to give what it was asked for.
  Nanos offer = std::chrono::seconds(5);   ///< An offer is forgotten that was not repeated.
  Nanos active = std::chrono::seconds(5);  ///< Robots that were heard within share the slots.
  std::size_t most_robots = 4096, most_runs = 4;
  /// Calls of a robot that ended a slot's process, by their time or a crash, within failure_window:
  /// so many, and it is refused until some are older.
  std::size_t most_failures = 10;
  int failure_costs = 10;  ///< Times the time that such a call took.
  Nanos failure_window = std::chrono::minutes(1);
};

class Desk {
 public:
  explicit Desk(const DeskLimits& limits) : limits_(limits) {}

  /// A run of the robot's program has so many tasks waiting.
  void offered(const std::string& robot, std::uint64_t run, std::uint32_t waiting, Nanos now);
  struct Claim {
    std::string robot;
    std::uint64_t run = 0;
  };
  /// Whom to ask now; none where no slot is free, or nothing waits.
  [[nodiscard]] std::optional<Claim> claim(Nanos now);
  /// Whether a task of the robot would be taken: one was asked for. For one that is late there has
  /// to be a slot.
  [[nodiscard]] bool expects(const std::string& robot) const;
  /// It came. @return  Whether it has a slot now.
  [[nodiscard]] bool take(const std::string& robot, std::uint64_t run, std::uint32_t waiting,
                          Nanos now);
  /// @param failed  Its slot's process is gone.
  void finished(const std::string& robot, Nanos used, bool failed, Nanos now);
  /// Why nothing of the robot is computed now; empty = it is.
  [[nodiscard]] std::string why_refused(const std::string& robot, Nanos now);
  /// When to call claim next, though nothing happened; Nanos::max() = never.
  [[nodiscard]] Nanos next_wake() const;

 private:
  struct Run {
    std::uint32_t waiting = 0;
    Nanos heard{0}, asked{-1};
    bool late = false;  ///< A claim ran out, and its task may be on its way over a slow link.
  };
  struct Robot {
    std::map<std::uint64_t, Run> runs = {};
    int slots = 0;  ///< Computing, and claimed.
    Nanos used{0}, heard{0};
    std::deque<Nanos> failures = {};
  };
  struct Asked {
    Claim claim;
    Nanos since{0};
  };

  Robot& robot_of(const std::string& name, Nanos now);
  /// A run says how many tasks wait there.
  void hear(const std::string& name, std::uint64_t run, std::uint32_t waiting, Nanos now);
  /// Or ran out.
  void answered(std::vector<Asked>::iterator asked, Nanos now);
  void forget(Nanos now);
  [[nodiscard]] std::vector<Asked>::iterator find_claim(const std::string& robot,
                                                        std::uint64_t run);

  DeskLimits limits_;
  std::map<std::string, Robot> robots_;
  std::vector<Asked> asked_;  ///< The oldest first.
  int computing_ = 0;
};

}  // namespace pirt::cloud
