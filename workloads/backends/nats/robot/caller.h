// The robot's side: which task is given to which worker, again, or no more. A pure state machine.
//
// No thread, no clock, no connection: every call is an input with its time, and says through
// CallerEvents what is to be done. The same inputs give the same answers, whether a server or a
// simulation drives it. A task's end is told once. One caller at a time.
//
// A task waits here until a worker claims one. It waits again, a little later, where the worker
// gave it back, was not heard of any more, or failed: threw, died with it, or let it run over its
// time. Three of the last kind are enough.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

struct CallerLimits {
  std::uint32_t most_tries = 3;   ///< A task that failed as often is given up;
  std::uint32_t most_sends = 20;  ///< so is one that was given away as often for whatever reason.
  Nanos confirm = std::chrono::seconds(3);   ///< For a worker to say that it has a task.
  Nanos silence = std::chrono::seconds(10);  ///< Of a worker that has one: it is lost.
  Nanos worker = std::chrono::seconds(10);   ///< Since a worker was last heard: the unit is down.
  Nanos offer = std::chrono::seconds(1);     ///< Between offers while a task waits.
  Nanos again = std::chrono::milliseconds(200);  ///< At least, before a task is offered again.
  /// When a second worker is asked, too: after so long, or after the 95th of 100 such calls.
  std::optional<Nanos> hedge_after = {};
  bool hedge_p95 = false;
};

/// How a task ended at its caller.
enum class CallEndKind : std::uint8_t {
  kDone,
  kGivenUp,   ///< Its tries failed.
  kRefused,   ///< No worker would ever run it.
  kReturned,  ///< Its time for this was over: it is to be computed elsewhere.
  kCancelled,
};

/// A task on its way to a worker.
struct GivenTask {
  TaskId task = {};
  std::uint64_t worker = 0;
  std::uint32_t send = 1, waiting = 0;
  std::optional<Nanos> time_left = {};
};

/// What is to be done.
class CallerEvents {
 public:
  virtual ~CallerEvents() = default;
  virtual void offer(std::uint32_t waiting) = 0;
  virtual void give(const GivenTask& given) = 0;
  virtual void give_nothing(std::uint64_t worker) = 0;
  /// A worker found its parameters or inputs not on the stream: ready() says when they are.
  virtual void missing(const TaskId& task) = 0;
  /// Whoever has it may let go of it.
  virtual void withdraw(const TaskId& task) = 0;
  /// @param reply  Of one that is done; else null.
  virtual void end(const TaskId& task, CallEndKind how, const std::string& problem,
                   const ReplyMessage* reply) = 0;
};

struct CallerCounts {
  std::int64_t submitted = 0;                 ///< = those that ended, and live ones.
  std::array<std::int64_t, 5> ended_as = {};  ///< By CallEndKind.
  std::int64_t sent_again = 0;
  std::int64_t hedged = 0;  ///< Of those: a second worker, beside the first.
  std::int64_t late = 0;    ///< Replies to tasks that had ended: dropped.

  [[nodiscard]] std::int64_t ended(CallEndKind how) const {
    return ended_as[static_cast<std::size_t>(how)];
  }
};

class Caller {
 public:
  Caller(CallerEvents& events, const CallerLimits& limits, std::uint64_t seed)
      : events_(events), limits_(limits), random_(static_cast<std::uint32_t>(seed)) {}

  /// @param kind  What tasks that take as long have in common.
  void submit(const TaskId& task, const std::string& kind, std::optional<Nanos> deadline,
              Nanos now);
  /// Nothing more is heard of it but its end.
  void cancel(const TaskId& task);
  /// What a worker missed is there now.
  void ready(const TaskId& task, Nanos now);

  void link_up(Nanos now);
  void link_down();
  /// @param takes  Whether a task is for that worker.
  void claimed(std::uint64_t worker, const std::function<bool(const TaskId&)>& takes, Nanos now);
  void replied(const ReplyMessage& reply, Nanos now);
  void worker_heard(std::uint64_t worker, Nanos now);
  void wake(Nanos now);
  /// When to call wake next; Nanos::max() = never.
  [[nodiscard]] Nanos next_wake() const;

  [[nodiscard]] const CallerCounts& counts() const { return counts_; }
  [[nodiscard]] std::size_t live() const { return entries_.size(); }
  /// Whether a task that is submitted now gets to a worker.
  [[nodiscard]] bool is_up(Nanos now) const;

 private:
  /// A worker has it, or may have.
  struct Given {
    std::uint64_t worker = 0;
    std::uint32_t send = 0;
    bool confirmed = false;
    Nanos since{0}, until{0};  ///< Nothing was heard of it then: it is not there any more.
  };
  struct Entry {
    std::string kind = {};
    std::optional<Nanos> offered_at = {};  ///< Waits for a worker from then on.
    std::vector<Given> given = {};
    std::uint32_t sends = 0, tries = 0;
    std::optional<Nanos> deadline = {}, hedge_at = {};
  };
  using Entries = std::map<TaskId, Entry>;

  [[nodiscard]] static bool waits(const Entry& entry, Nanos now) {
    return entry.offered_at && *entry.offered_at <= now;
  }
  [[nodiscard]] std::uint32_t waiting(Nanos now) const;
  void offer(Nanos now);
  void give(const TaskId& task, Entry& entry, std::uint64_t worker, Nanos now);
  void failed(Entries::iterator at, const std::string& problem, Nanos now);
  void look(Entries::iterator at, Nanos now);
  void end(Entries::iterator at, CallEndKind how, const std::string& problem,
           const ReplyMessage* reply);
  [[nodiscard]] std::optional<Nanos> hedged_after(const std::string& kind) const;
  [[nodiscard]] Nanos due(const Entry& entry) const;

  CallerEvents& events_;
  CallerLimits limits_;
  std::minstd_rand random_;
  Entries entries_;
  bool linked_ = false;
  std::map<std::uint64_t, Nanos> workers_;         ///< When each was last heard.
  Nanos offered_{-1}, offer_at_ = Nanos::max();    ///< The last offer, and the next.
  std::map<std::string, std::deque<Nanos>> took_;  ///< The last calls of each kind.
  CallerCounts counts_;
};

}  // namespace pirt::cloud
