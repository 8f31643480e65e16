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
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "workloads/backends/nats/link/administration.h"
#include "workloads/backends/nats/robot/caller.h"
#include "workloads/backends/nats/wire/tensors.h"
#include "workloads/model/remote.h"

namespace pirt::cloud {

struct RobotOptions {
  ConnectionOptions connection = {};
  std::string robot = "robot";  ///< As the administrator knows it.
  CallerLimits limits = {};
};

/// How a task ended, with durations of this clock or of the worker's, never differences of both.
struct TaskEnd {
  CallEndKind how = CallEndKind::kDone;
  std::string problem = {};  ///< In one line; empty if done.
  std::string worker = {};
  std::uint32_t send = 0;  ///< That it is the reply to.
  Payload outputs = {};    ///< Of one that is done: encode_tensors.
  Nanos execute{0};        ///< By the worker's clock.
  Nanos total{0};          ///< From submitting to here.
};

struct Submission {
  TaskMessage task = {};                ///< Whole, but for its numbers and times.
  std::optional<Nanos> time_left = {};  ///< From now; then nobody wants it any more.
  std::optional<Digest> known_by = {};  ///< As of Kind: whose name alone does not say what it is.
  /// From a thread of the link's; may be empty. `ended` comes in any case, and once.
  std::function<void()> taken = {};    ///< By a worker; once.
  std::function<void()> missing = {};  ///< On the stream: what it says is there. Then ready().
  std::function<void(TaskEnd)> ended = {};
};

/// Any thread may call it.
class RobotLink : private CallerEvents {
 public:
  /// Returns at once, whether or not there is a server.
  /// @throws As Connection; Error{kBadInput} for a name that no robot may have.
  explicit RobotLink(const RobotOptions& options);
  /// Tasks are cancelled, as far as there is a link; their `ended` is not called.
  ~RobotLink() override;
  RobotLink(const RobotLink&) = delete;
  RobotLink& operator=(const RobotLink&) = delete;

  /// The name of the next task that is submitted: blobs have it.
  [[nodiscard]] TaskId next_task() { return {run_, ++number_}; }
  /// @param task  Of next_task, once.
  void submit(const TaskId& task, Submission submission);
  void cancel(const TaskId& task);
  /// What was missing is there.
  void ready(const TaskId& task);

  [[nodiscard]] bool is_up() const;
  /// Until it is up, or @p most is over. @return  Whether it is.
  [[nodiscard]] bool wait_until_up(Nanos most);
  /// Why it is not up, in one line with the remedy; empty if it is.
  [[nodiscard]] std::string why_down() const;
  /// Why so many bytes of @p what cannot be on this robot's stream; empty if they can.
  [[nodiscard]] std::string why_too_large(const std::string& what, std::uint64_t bytes) const;
  /// Round trip of a small task to a worker; bandwidth to the server.
  [[nodiscard]] LinkEstimate estimate() const;
  void measure(Nanos took, std::size_t bytes);
  [[nodiscard]] CallerCounts counts() const;
  /// Why no worker that was heard computes it: nobody knows it, or it is something else there;
  /// empty if one does, or nobody was heard.
  [[nodiscard]] std::string why_not(const Workload& workload) const;
  /// How often other workers, or other workloads of theirs, were announced, or some had fallen
  /// silent.
  [[nodiscard]] std::uint64_t heard() const { return heard_; }
  [[nodiscard]] Connection& connection() { return *connection_; }
  [[nodiscard]] const std::string& robot() const { return options_.robot; }

 private:
  struct Running {
    Submission submission;
    Nanos submitted{0}, given{0};
    std::size_t sent_bytes = 0;  ///< That it was given to a worker with.
    bool taken = false;
  };
  struct Worker {
    HelloMessage said;
    Nanos at{0};
  };

  // Of CallerEvents: what others have to hear is told, and said to them, once the lock is gone.
  void offer(std::uint32_t waiting) override;
  void give(const GivenTask& given) override;
  void give_nothing(std::uint64_t worker) override;
  void missing(const TaskId& task) override;
  void withdraw(const TaskId& task) override;
  void end(const TaskId& task, CallEndKind how, const std::string& problem,
           const ReplyMessage* reply) override;

  template <typename Step>
  void with_caller(Step step);
  void say_all();
  void serve(const std::stop_token& stop);
  void ask_for_stream();
  void claimed(const ClaimMessage& claim);
  void replied(const ReplyMessage& reply);
  void heard_hello(const HelloMessage& hello);
  template <typename Said>
  void subscribe(const std::string& subject, std::size_t most_bytes,
                 void (RobotLink::*handler)(const Said&));

  RobotOptions options_;
  std::uint64_t run_ = new_id();
  std::atomic<std::uint64_t> number_ = 0;
  MachineClock clock_;

  mutable std::mutex mutex_;  ///< Of what follows.
  std::condition_variable_any changed_;
  Caller caller_;
  std::map<TaskId, Running> running_;
  std::vector<std::function<void()>> told_;         ///< What somebody has to hear.
  std::deque<std::pair<std::string, Bytes>> said_;  ///< Subjects and messages, not yet published.
  bool saying_ = false;                             ///< Some thread publishes them.
  Nanos ask_at_ = Nanos::max();                     ///< For the robot's stream.
  LinkEstimate estimate_;
  std::int64_t stream_bytes_ = 0;  ///< That its stream may have; below 1 = any number.
  std::string no_stream_;          ///< Why there is none, with the remedy; empty = there is.
  std::map<std::uint64_t, Worker> workers_;  ///< That are not silent, by instance.
  std::atomic<std::uint64_t> heard_ = 0;

  std::jthread server_;
  std::unique_ptr<Connection> connection_;  ///< Last: its handlers use the rest.
};

}  // namespace pirt::cloud
