// The worker's end of the queue: drives an Attendant (attendant.h) over a connection, and hands
// what was admitted to whoever computes.
//
// A thread owns the Attendant; one a slot computes. What is computed comes from the list of
// workloads that it was given: no code, no path, no size comes from the wire.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "workloads/backends/nats/link/connection.h"
#include "workloads/backends/nats/link/mailbox.h"
#include "workloads/backends/nats/worker/admission.h"
#include "workloads/backends/nats/worker/attendant.h"
#include "workloads/backends/nats/worker/stream_age.h"

namespace pirt::cloud {

using SharedTensors = std::shared_ptr<const std::vector<Tensor>>;

/// Computes, one call after the other; each slot has its own.
class Computer {
 public:
  virtual ~Computer() = default;
  /// @param parameters  As the workload has them; null if it has none.
  /// @param content     Names them: the same content, the same digest.
  /// @return  As Workload::outputs.
  /// @throws std::exception if it did not work: a try that failed.
  [[nodiscard]] virtual std::vector<Tensor> compute(const Workload& workload,
                                                    const SharedTensors& parameters,
                                                    const Digest& content,
                                                    std::span<const Tensor> inputs,
                                                    Nanos& took) = 0;
};

struct WorkerOptions {
  ConnectionOptions connection = {};
  std::string name = "worker";                           ///< Beside others'.
  std::string version = {};                              ///< Of pirt.
  AttendantLimits limits = {};                           ///< With the slots.
  std::uint64_t cache_bytes = std::uint64_t{512} << 20;  ///< Of parameters.
  Nanos hello = std::chrono::seconds(2);                 ///< Between announcements.
  /// Called from the slot's thread, when it begins.
  std::function<std::unique_ptr<Computer>()> make_computer;
};

struct WorkerCounts {
  AttendantCounts tasks = {};
  std::int64_t malformed = 0;  ///< Messages that were none.
  std::int64_t refused = 0, failed = 0, withdrawn = 0, missed_parameters = 0;
  std::int64_t expired = 0;  ///< Not computed: nobody would have taken the result.
};

/// Any thread may call it.
class WorkerLink {
 public:
  /// Returns at once, whether or not there is a server.
  /// @param workloads  Are there as long as this is.
  /// @throws As Connection.
  WorkerLink(const WorkerOptions& options, std::span<const Workload* const> workloads);
  /// Waits for what is computed; that goes back to the stream.
  ~WorkerLink();
  WorkerLink(const WorkerLink&) = delete;
  WorkerLink& operator=(const WorkerLink&) = delete;

  [[nodiscard]] WorkerCounts counts() const;
  /// What the server said last, or why a slot has no computer; empty = nothing.
  [[nodiscard]] std::string problem() const;
  [[nodiscard]] Connection& connection() { return *connection_; }

 private:
  struct Job {
    TaskKey key;
    TaskMessage message;
    Nanos taken{0};
    Nanos aged{0};  ///< On the stream until then, at least.
  };
  /// Parameters by their content; the ones that were used longest ago go first.
  struct Cache {
    struct Entry {
      Digest digest;
      SharedTensors tensors;
      std::uint64_t bytes = 0;
    };
    std::list<Entry> entries;
    std::uint64_t bytes = 0;
  };
  struct Made {
    std::optional<ReplyMessage> reply;  ///< Absent = it waits on the stream.
    bool missing = false;               ///< For what the robot has to send.
  };

  void serve();
  void compute(std::size_t slot);
  [[nodiscard]] Made make(Computer& computer, const Job& job);
  [[nodiscard]] SharedTensors parameters(const Workload& workload, const std::string& robot,
                                         const Blob& blob, std::string& problem);
  [[nodiscard]] Payload outputs(const TaskKey& key, Bytes bytes);
  void apply(AttendantActions actions);
  void pull();
  void on_pulled(const Incoming& message, const std::string& pull);
  void on_task(const std::string& robot, const std::string& reply, TaskMessage message);
  void on_seen(const Incoming& message);
  void on_withdraw(const std::string& robot, const std::string& reply,
                   const WithdrawMessage& message);
  void forget(const TaskKey& key);
  void say_hello();
  void count_malformed();
  template <typename Step>
  void with_attendant(Step step);

  WorkerOptions options_;
  Admission admission_;
  Attendant attendant_;  ///< As what follows: of the thread that serves.
  struct Delivered {
    TaskKey key;
    std::string reply;  ///< Where it is acknowledged.
  };
  const Job* arriving_ = nullptr;  ///< What was delivered just now.
  std::map<Delivery, Delivered> deliveries_;
  std::set<TaskKey> held_;
  std::map<TaskKey, std::string> published_;  ///< The number that its reply went out with.
  std::map<std::string, std::pair<TaskKey, std::uint32_t>> replies_;  ///< By number.
  std::set<TaskKey> large_;             ///< Whose chunks lie on the server.
  std::map<std::string, Nanos> pulls_;  ///< Under way, until when.
  std::set<TaskKey> gone_;              ///< Withdrawn before they came,
  std::deque<TaskKey> oldest_gone_;     ///< in order.
  StreamAge ages_;
  Delivery next_delivery_ = 0;
  std::uint64_t next_number_ = 0;
  Nanos hello_at_{0};

  mutable std::mutex mutex_;  ///< Of what follows.
  std::condition_variable changed_;
  std::deque<Job> waiting_;
  Cache cache_;
  WorkerCounts counts_;
  std::string problem_;

  Mailbox mailbox_;
  std::atomic<bool> stopping_ = false;
  std::vector<std::jthread> slots_;
  std::jthread server_;
  std::unique_ptr<Connection> connection_;  ///< Last: its handlers use the rest.
};

template <typename Step>
void WorkerLink::with_attendant(Step step) {
  AttendantActions actions;
  step(mailbox_.now(), actions);
  apply(std::move(actions));
}

}  // namespace pirt::cloud
