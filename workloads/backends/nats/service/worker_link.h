// The worker's end: asks robots for tasks as its Desk (desk.h) says, over a connection, and hands
// what was admitted to whoever computes.
//
// A thread claims, says that tasks are computed, and that the worker lives; one a slot computes.
// What is computed comes from the list of workloads that it was given: no code, no path, no size
// comes from the wire. Nothing is kept of a robot but what its tasks that are computed need.
// Commands start it with serve(). In a build without the backend that, administer(), permissions()
// and the functions of computer.h each say so.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "workloads/backends/nats/link/administration.h"
#include "workloads/backends/nats/service/computer.h"
#include "workloads/backends/nats/service/desk.h"

namespace pirt::cloud {

struct WorkerOptions {
  ConnectionOptions connection = {};
  std::string name = "worker";                          ///< Beside others'.
  std::string version = {};                             ///< Of pirt.
  DeskLimits limits = {};                               ///< With the slots.
  std::uint64_t call_bytes = std::uint64_t{512} << 20;  ///< Of a call's tensors.
  Nanos fetch = std::chrono::seconds(60);               ///< For reading what a call needs.
  Nanos hello = std::chrono::seconds(2);                ///< Between announcements,
  Nanos progress = std::chrono::seconds(2);             ///< and signs of life of a task.
  /// Called from the slot's thread, when it begins.
  std::function<std::unique_ptr<Computer>()> make_computer;
};

struct WorkerCounts {
  std::int64_t taken = 0;      ///< = those that ended, were cancelled, or are computed now.
  std::int64_t malformed = 0;  ///< Messages that were none, or that nobody had asked for.
  std::int64_t cancelled = 0;  ///< Nobody wanted them any more.
  std::array<std::int64_t, 7> ended_as = {};  ///< By ReplyKind.

  [[nodiscard]] std::int64_t ended(ReplyKind how) const {
    return ended_as[static_cast<std::size_t>(how)];
  }
};

/// Any thread may call it.
class WorkerLink {
 public:
  /// Returns at once, whether or not there is a server.
  /// @param workloads  Are there as long as this is.
  /// @throws As Connection.
  WorkerLink(const WorkerOptions& options, std::span<const Workload* const> workloads);
  /// Waits for what is computed, as long as its computer lets it.
  ~WorkerLink();
  WorkerLink(const WorkerLink&) = delete;
  WorkerLink& operator=(const WorkerLink&) = delete;

  [[nodiscard]] WorkerCounts counts() const;
  [[nodiscard]] Connection& connection() const { return *connection_; }

 private:
  /// A task that has a slot.
  struct Job {
    std::string robot;
    TaskMessage message;
    std::string refused = {};  ///< Why it is not to be computed.
    Nanos taken{0}, said{0};
    std::atomic<bool> unwanted = false;
  };
  using Jobs = std::list<std::shared_ptr<Job>>;

  void serve(const std::stop_token& stop);
  void compute(const std::stop_token& stop, int slot);
  [[nodiscard]] ReplyMessage run(Computer& computer, Job& job);
  /// @return  Why it is not there, or could not be read; none = @p bytes are what was stored.
  [[nodiscard]] std::optional<ReplyMessage> fetch(const Job& job, std::string_view what,
                                                  const std::string& name, const Blob& blob,
                                                  Bytes& bytes);
  void store_outputs(const Job& job, ReplyMessage& reply);
  void finish(const std::shared_ptr<Job>& job, ReplyMessage reply, bool gone);
  bool say(const Job& job, ReplyMessage reply);
  void on_task(const std::string& robot, const Incoming& message);
  /// Of a robot, in a few bytes.
  template <typename Said>
  [[nodiscard]] std::optional<Said> read(const std::string& robot, const Incoming& message);
  void drop(const std::string& robot, const std::string& problem);
  template <typename Change>
  void change(Change change);

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
  Jobs jobs_;                                 ///< All that have a slot;
  std::deque<std::shared_ptr<Job>> waiting_;  ///< of those, the ones that no thread has yet.
  WorkerCounts counts_;

  std::atomic<bool> stopping_ = false;
  std::vector<std::jthread> slots_;
  std::jthread server_;
  std::unique_ptr<Connection> connection_;  ///< Last: its handlers use the rest.
};

/// What a worker tells of itself while it runs.
struct ServiceEvents {
  std::function<bool()> stop;                   ///< Looked at several times a second.
  std::function<void(const std::string&)> say;  ///< One line.
};

/// Runs a worker until it is told to stop. Makes the stream of robot "robot", where it may.
/// @throws Error{kEnvironment} in a build without the backend, and where the server can never
/// serve; as WorkerLink.
void serve(const WorkerOptions& options, std::span<const Workload* const> workloads,
           const ServiceEvents& events);

}  // namespace pirt::cloud
