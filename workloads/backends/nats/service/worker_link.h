// The worker's end. A Desk decides which robot is asked for a task next; a WorkerLink drives it
// over a connection, and hands what was admitted to whoever computes: a thread claims, says that
// tasks are computed, and that the worker lives; one a slot computes. Commands start it with
// serve(). In a build without the backend (its probe() says so) this room does nothing.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "workloads/backends/nats/link/stream.h"
#include "workloads/backends/nats/service/computer.h"

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

/// A pure state machine, as Caller; what it knows of robots is bounded. One caller at a time.
class Desk {
 public:
  explicit Desk(const DeskLimits& limits) : limits_(limits) {}

  /// A run of the robot's program has so many tasks waiting.
  void offered(const std::string& robot, std::uint64_t run, std::uint32_t waiting, Nanos now);
  struct Claim {
    std::string robot;
    std::uint64_t run = 0;
    Nanos since{0};
  };
  /// Whom to ask now; none where no slot is free, or nothing waits.
  [[nodiscard]] std::optional<Claim> claim(Nanos now);
  /// Whether a task of the robot would be taken: it was asked for, or is late and there is a slot.
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

  [[nodiscard]] bool has_free_slot() const {
    return computing_ + std::ssize(asked_) < limits_.slots;
  }
  Robot& robot_of(const std::string& name, Nanos now);
  /// A run says how many tasks wait there.
  void hear(const std::string& name, std::uint64_t run, std::uint32_t waiting, Nanos now);
  /// Or ran out. @return  Whether it was asked.
  bool answered(const std::string& name, std::uint64_t run, Nanos now);

  DeskLimits limits_;
  std::map<std::string, Robot> robots_;
  std::vector<Claim> asked_;  ///< The oldest first.
  int computing_ = 0;
};

struct WorkerOptions {
  ConnectionOptions connection = {};
  std::string name = "worker";                          ///< Beside others'.
  std::string version = {};                             ///< Of pirt.
  DeskLimits limits = {};                               ///< With the slots.
  std::uint64_t call_bytes = std::uint64_t{512} << 20;  ///< Of a call's tensors.
  Nanos fetch = std::chrono::seconds(60);               ///< For reading, beside its bytes' time.
  Nanos hello = std::chrono::seconds(2);                ///< Between its signs of life, and tasks'.
  /// Called from the slot's thread, when it begins.
  std::function<std::unique_ptr<Computer>()> make_computer;
};

struct WorkerCounts {
  std::int64_t taken = 0;      ///< = those that ended, were cancelled, or are computed now.
  std::int64_t malformed = 0;  ///< Messages that were none, or that nobody had asked for.
  std::int64_t cancelled = 0;  ///< Nobody wanted them any more.
  std::array<std::int64_t, 8> ended_as = {};  ///< By ReplyKind.

  [[nodiscard]] std::int64_t ended(ReplyKind how) const {
    return ended_as[static_cast<std::size_t>(how)];
  }
};

/// Any thread may call it.
class WorkerLink {
 public:
  /// As Connection's. @param workloads  Are there as long as this is.
  WorkerLink(const WorkerOptions& options, std::span<const Workload* const> workloads);
  ~WorkerLink() { static_cast<void>(end()); }

  /// Nothing is taken any more. Waits for what is computed, as long as its computer lets it.
  WorkerCounts end();
  [[nodiscard]] WorkerCounts counts() const {
    const std::lock_guard lock(mutex_);
    return counts_;
  }
  [[nodiscard]] Connection& connection() const { return *connection_; }

 private:
  /// A task that has a slot.
  struct Job : Call {
    std::string refused = {};  ///< Why it is not to be computed.
    Nanos taken{0};
    std::atomic<bool> unwanted = false;
  };

  void serve(const std::stop_token& stop);
  void compute(const std::stop_token& stop, int slot);
  [[nodiscard]] ReplyMessage run(Computer& computer, Job& job);
  /// @throws NotDone if it is not there, or cannot be read.
  [[nodiscard]] Bytes fetch(const Job& job, std::string_view what, const std::string& name,
                            const Blob& blob);
  bool say(const Job& job, ReplyMessage reply);
  void on_task(const std::string& robot, ByteView frame);
  /// What somebody waits for may be there then. @param how  void(Nanos now)
  template <typename How>
  void change(const How& how) {
    const std::lock_guard lock(mutex_);
    how(clock_.now());
    changed_now_ = true;
    changed_.notify_all();
  }

  WorkerOptions options_;
  std::uint64_t instance_ = new_id();
  Admission admission_;
  Bytes hello_;  ///< A HelloMessage.
  MachineClock clock_;

  mutable std::mutex mutex_;  ///< Of what follows.
  std::condition_variable_any changed_;
  Desk desk_;
  bool changed_now_ = false;  ///< Since a claim was looked for.
  Nanos hello_at_{0};
  std::vector<std::shared_ptr<Job>> jobs_;    ///< All that have a slot;
  std::deque<std::shared_ptr<Job>> waiting_;  ///< of those, the ones that no thread has yet.
  WorkerCounts counts_;

  std::atomic<bool> stopping_ = false;
  std::vector<std::jthread> slots_;
  std::jthread server_;
  std::unique_ptr<Connection> connection_;  ///< Last: its handlers use the rest.
};

/// Runs a worker until it is told to stop. Makes the stream of robot "robot", where it may.
/// @param stop  Looked at several times a second.
/// @param say   Gets what it tells of itself, a line each.
/// @throws Error{kEnvironment} where the server can never serve; as WorkerLink.
void serve(const WorkerOptions& options, std::span<const Workload* const> workloads,
           const std::function<bool()>& stop, const std::function<void(const std::string&)>& say);

}  // namespace pirt::cloud
