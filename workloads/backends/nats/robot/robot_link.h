// The robot's end: drives a Caller (caller.h) over a connection.
//
// Nothing here decides when a task is given to a worker, again, or up. What is larger than a
// message whoever submits it puts on the robot's stream, and reads from there (link/blobs.h).
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "workloads/backends/nats/link/administration.h"
#include "workloads/backends/nats/robot/caller.h"

namespace pirt::cloud {

struct RobotOptions {
  ConnectionOptions connection = {};
  std::string robot = "robot";  ///< As the administrator knows it.
  CallerLimits limits = {};
};

/// Any thread may call it.
class RobotLink {
 public:
  /// Returns at once, whether or not there is a server.
  /// @throws As Connection; Error{kBadInput} for a name that no robot may have.
  explicit RobotLink(const RobotOptions& options);
  /// Tasks are cancelled, as far as there is a link; their `ended` is not called.
  ~RobotLink();
  RobotLink(const RobotLink&) = delete;
  RobotLink& operator=(const RobotLink&) = delete;

  /// The name of the next task that is submitted: blobs have it.
  [[nodiscard]] TaskId next_task() { return {run_, ++number_}; }
  /// @param task  Of next_task, once.
  void submit(const TaskId& task, Submission submission);
  void cancel(const TaskId& task);
  /// What was missing is there.
  void ready(const TaskId& task);

  [[nodiscard]] bool is_up() const {
    return locked([this] { return caller_.is_up(clock_.now()); });
  }
  /// Until it is up, or @p most is over. @return  Whether it is.
  [[nodiscard]] bool wait_until_up(Nanos most);
  /// Why it is not up, in one line with the remedy; empty if it is.
  [[nodiscard]] std::string why_down() const;
  /// Why so many bytes of @p what cannot be on this robot's stream; empty if they can.
  [[nodiscard]] std::string why_too_large(const std::string& what, std::uint64_t bytes) const;
  /// As Caller has them.
  [[nodiscard]] LinkEstimate estimate() const {
    return locked([this] { return caller_.estimate(); });
  }
  void measure(Nanos took, std::size_t bytes) {
    locked([&] { caller_.measure(took, bytes); });
  }
  [[nodiscard]] CallerCounts counts() const {
    return locked([this] { return caller_.counts(); });
  }
  /// As Caller::why_not.
  [[nodiscard]] std::string why_not(const Workload& workload) const {
    return locked([this, kind = kind_of(workload)] { return caller_.why_not(kind); });
  }
  [[nodiscard]] Connection& connection() { return *connection_; }
  [[nodiscard]] const std::string& robot() const { return options_.robot; }

 private:
  template <typename Ask>
  std::invoke_result_t<Ask> locked(Ask ask) const {
    const std::lock_guard lock(mutex_);
    return ask();
  }
  /// What others have to hear is said to them, and told, once the lock is gone.
  template <typename Step>
  void with_caller(Step step);
  void say_all();
  void serve(const std::stop_token& stop);
  void ask_for_stream();
  /// @param step  void(Said, Nanos), with the lock.
  template <typename Said, typename Step>
  void subscribe(const std::string& subject, std::size_t most_bytes, Step step);

  RobotOptions options_;
  std::uint64_t run_ = new_id();
  std::atomic<std::uint64_t> number_ = 0;
  MachineClock clock_;

  mutable std::mutex mutex_;  ///< Of what follows.
  std::condition_variable_any changed_;
  Caller caller_;
  std::vector<std::function<void()>> told_;         ///< What somebody has to hear.
  std::deque<std::pair<std::string, Bytes>> said_;  ///< Subjects and messages, not yet published.
  bool saying_ = false;                             ///< Some thread publishes them.
  Nanos ask_at_ = Nanos::max();                     ///< For the robot's stream.
  std::int64_t stream_bytes_ = 0;  ///< That its stream may have; below 1 = any number.
  std::string no_stream_;          ///< Why there is none, with the remedy; empty = there is.

  std::jthread server_;
  std::unique_ptr<Connection> connection_;  ///< Last: its handlers use the rest.
};

}  // namespace pirt::cloud
