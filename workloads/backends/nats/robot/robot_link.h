// The robot's end of the queue: drives a Caller (caller.h) over a connection.
//
// A thread owns the Caller and the outbox; another moves what is larger than a message. Nothing
// here decides when a task is sent, again, or given up.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "workloads/backends/nats/link/connection.h"
#include "workloads/backends/nats/link/mailbox.h"
#include "workloads/backends/nats/robot/caller.h"
#include "workloads/backends/nats/wire/tensors.h"
#include "workloads/model/remote.h"

namespace pirt::cloud {

struct RobotOptions {
  ConnectionOptions connection = {};
  std::string robot = "robot";        ///< As the administrator knows it.
  std::filesystem::path outbox = {};  ///< A file; empty = in memory.
  std::uint64_t outbox_bytes = std::uint64_t{64} << 20;
  CallerLimits limits = {};
};

/// Parameters, for whenever a worker asks for them.
struct Parameters {
  Blob blob;
  std::shared_ptr<const Bytes> bytes;
};

/// How a task ended, with durations of this clock or of the worker's, never differences of both.
struct TaskEnd {
  CallEndKind how = CallEndKind::kDone;
  std::string problem = {};  ///< In one line; empty if done.
  std::string worker = {};
  Bytes outputs = {};         ///< Of one that is done: encode_tensors.
  Nanos execute{0}, held{0};  ///< By the worker's clock.
  Nanos stored{0};   ///< From submitting to the server's word that it has it; 0 = it never said.
  Nanos arrived{0};  ///< From submitting to the reply's arrival.
  Nanos total{0};    ///< From submitting to here.
};

struct Submission {
  std::string key = {};                    ///< Of a task that survives the program; empty = none.
  std::shared_ptr<const Bytes> body = {};  ///< A TaskBody.
  std::optional<Parameters> parameters = {};
  /// From now: to the deadline, and to when it is to be computed elsewhere at the latest.
  std::optional<Nanos> time_left = {}, give_back_after = {};
  /// From a thread of the link's, once each, in this order; may be empty. `ended` comes in any
  /// case, `stored` and `arrived` may not.
  std::function<void()> stored = {};
  std::function<void(const ReplyMessage&)> arrived = {};
  std::function<void(TaskEnd)> ended = {};
};

/// Any thread may call it.
class RobotLink {
 public:
  /// Returns at once, whether or not there is a server.
  /// @throws As Connection and open_outbox; Error{kBadInput} for a name that no robot may have.
  explicit RobotLink(const RobotOptions& options);
  /// Tasks that have no key are withdrawn, as far as there is a link; their `ended` is not called.
  ~RobotLink();
  RobotLink(const RobotLink&) = delete;
  RobotLink& operator=(const RobotLink&) = delete;

  /// `ended` says if it was not taken, too (kRefused: a full outbox, another body of the key).
  TaskId submit(Submission submission);
  void cancel(const TaskId& task);

  [[nodiscard]] Availability availability() const;
  /// Until it is up, or @p most is over. @return  Whether it is.
  [[nodiscard]] bool wait_until_up(Nanos most);
  /// Why it is not up, in one line with the remedy; empty if it is.
  [[nodiscard]] std::string why_down() const;
  /// Round trip of a message that is stored; bandwidth to the server.
  [[nodiscard]] LinkEstimate estimate() const;
  [[nodiscard]] CallerCounts counts() const;
  /// Messages that were none.
  [[nodiscard]] std::int64_t malformed() const;
  /// Why no worker that was heard computes it: nobody knows it, or it is something else there;
  /// empty if one does, or nobody was heard.
  [[nodiscard]] std::string why_not(const Workload& workload) const;
  /// How often other workers, or other workloads of theirs, were announced, or some had fallen
  /// silent.
  [[nodiscard]] std::uint64_t heard() const { return heard_; }

 private:
  struct Running {
    Submission submission;
    Nanos submitted{0}, stored{0}, arrived{0};
    std::uint32_t moving = 0;  ///< The send whose blobs are on their way; 0 = none.
    bool large = false;        ///< Its body was sent as a blob once.
  };
  struct Sent {
    TaskId task;
    std::uint32_t send = 1;
    Nanos at{0};
    std::size_t bytes = 0;
  };

  void serve();
  void ask_for_replies();
  void replies_come(bool server_knows_robot);
  void move();
  void apply(CallerActions actions);
  void publish(const Publish& what);
  void send_message(const TaskId& task, std::uint32_t send, const TaskMessage& message);
  void send_blobs(const TaskId& task, std::uint32_t send, std::optional<Nanos> time_left,
                  std::shared_ptr<const Bytes> body);
  void send_parameters(const TaskId& task);
  void withdraw(const TaskId& task, std::uint64_t sequence, std::vector<Blob> blobs);
  void tell_end(const TellEnd& end);
  void acknowledged(const std::string& number, const Stored& stored);
  void replied(ReplyMessage reply, const std::string& ack);
  void fetch_outputs(ReplyMessage reply, std::string ack);
  void take(ReplyMessage reply, const std::string& ack);
  void measure(const Sent& sent, Nanos now);
  void on_reply(const Incoming& message, bool stored);
  void on_hello(const Incoming& message);
  template <typename Step>
  void with_caller(Step step);

  RobotOptions options_;
  std::unique_ptr<Outbox> outbox_;
  std::unique_ptr<Caller> caller_;  ///< As what follows: of the thread that serves.
  std::map<TaskId, Running> running_;
  std::map<std::string, Sent> sent_;
  struct Moved {
    bool moving = false;
    std::uint32_t stored = 0;  ///< Where it goes on.
  };
  std::map<Digest, Moved> parameters_;  ///< That are on their way, or were and did not get there.
  std::uint64_t next_sent_ = 0;
  bool closing_ = false;
  Nanos ask_again_at_ = Nanos::max();  ///< For whether the server has replies for this robot.

  mutable std::mutex mutex_;  ///< Of what others read.
  std::condition_variable changed_;
  Availability availability_ = Availability::kDown;
  LinkEstimate estimate_;
  CallerCounts counts_;
  std::int64_t malformed_ = 0;
  std::string problem_;
  bool unknown_ = false;  ///< The server has no replies for this robot.
  struct Worker {
    AnnouncementMessage announced;
    Nanos at{0};
  };
  std::map<std::string, Worker> workers_;  ///< That are not silent.
  std::atomic<std::uint64_t> heard_ = 0;
  std::uint64_t run_ = 0, number_ = 0;

  Mailbox mailbox_, moves_;
  std::atomic<bool> stopping_ = false;
  std::jthread server_, mover_;
  std::unique_ptr<Connection> connection_;  ///< Last: its handlers use the rest.
};

template <typename Step>
void RobotLink::with_caller(Step step) {
  CallerActions actions;
  step(mailbox_.now(), actions);
  apply(std::move(actions));
}

}  // namespace pirt::cloud
