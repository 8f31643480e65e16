// The robot's side: which task is given to which worker, again, or no more. A pure state machine.
//
// No thread, no clock, no connection: every call is an input with its time, and hands out what is
// to be said to workers, and what somebody is to be told. The same inputs give the same answers,
// whether a server or a simulation drives it. A task's end is told once. One caller at a time.
//
// A task waits here until a worker claims one. It waits again, a little later, where the worker
// gave it back, was not heard of any more, or failed: threw, died with it, or let it run over its
// time. Three of the last kind are enough.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "workloads/backends/nats/wire/tensors.h"
#include "workloads/model/remote.h"

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

/// A task, and who hears what becomes of it.
struct Submission {
  /// Whole, but for its numbers; its time counts from now.
  TaskMessage task = {};
  std::optional<Digest> known_by = {};  ///< As of Kind: whose name alone does not say what it is.
  // Called as Caller::Tell does; may be empty.
  std::function<void()> taken = {};    ///< By a worker; once.
  std::function<void()> missing = {};  ///< On the stream: what it says is there. Then ready().
  /// In any case, and once: a worker's reply, or nothing but the problem, in one line.
  std::function<void(ReplyMessage)> ended = {};
};

struct CallerCounts {
  std::int64_t submitted = 0;  ///< = those that ended, and live ones.
  std::int64_t done = 0;
  std::int64_t sent_again = 0;
  std::int64_t hedged = 0;  ///< Of those: a second worker, beside the first.
  std::int64_t late = 0;    ///< Replies to tasks that had ended: dropped.
  /// How often other workers, or other workloads of theirs, were announced, or some had fallen
  /// silent.
  std::uint64_t others = 0;
};

class Caller {
 public:
  /// A message, and the subject that it is for.
  using Say = std::function<void(std::string subject, Bytes message)>;
  /// What is to be called, there or once the Caller has returned.
  using Tell = std::function<void(std::function<void()>)>;

  /// @param robot  Whose program's @p run it is, a random number.
  Caller(std::string robot, std::uint64_t run, const CallerLimits& limits, Say say, Tell tell);

  void submit(Submission submission, Nanos now);
  /// Nothing more is heard of it but its end.
  void cancel(const TaskId& task);
  void cancel_all();
  /// What a worker missed is there now.
  void ready(const TaskId& task, Nanos now);

  void link_up(Nanos now);
  void link_down();
  void claimed(std::uint64_t worker, Nanos now);
  void replied(ReplyMessage reply, Nanos now);
  void heard(HelloMessage hello, Nanos now);
  void wake(Nanos now);
  /// When to call wake next; Nanos::max() = never.
  [[nodiscard]] Nanos next_wake() const;

  [[nodiscard]] const CallerCounts& counts() const { return counts_; }
  /// Round trip of a small task to a worker; bandwidth to the server.
  [[nodiscard]] LinkEstimate estimate() const;
  /// So many bytes have got there.
  void measure(Nanos took, std::size_t bytes);
  [[nodiscard]] std::size_t live() const { return entries_.size(); }
  /// Whether a task that is submitted now gets to a worker.
  [[nodiscard]] bool is_up(Nanos now) const;
  /// Nobody was heard.
  [[nodiscard]] bool is_alone() const { return workers_.empty(); }
  /// Why no worker that was heard computes it: nobody knows it, or it is something else there;
  /// empty if one does, or nobody was heard.
  [[nodiscard]] std::string why_not(const Kind& kind) const;

 private:
  /// A worker has it, or may have.
  struct Given {
    std::uint64_t worker = 0;
    std::uint32_t send = 0;
    bool confirmed = false;
    Nanos since{0}, until{0};  ///< Nothing was heard of it then: it is not there any more.
  };
  struct Entry {
    Submission submission = {};
    std::optional<Nanos> offered_at = {};  ///< Waits for a worker from then on.
    std::optional<Nanos> deadline = {}, hedge_at = {};
    std::vector<Given> given = {};
    Nanos given_at{0};  ///< To a worker, the last time, in so many bytes.
    std::size_t given_bytes = 0;
    std::uint32_t sends = 0, tries = 0;
    bool taken = false;
  };
  using Entries = std::map<TaskId, Entry>;
  struct Worker {
    HelloMessage said = {};
    Nanos at{0};
    bool is_here = false;  ///< It was heard since there is this link.
    [[nodiscard]] bool lives(Nanos now, Nanos within) const { return is_here && now < at + within; }
  };

  [[nodiscard]] static bool waits(const Entry& entry, Nanos now) {
    return entry.offered_at && *entry.offered_at <= now;
  }
  [[nodiscard]] std::uint32_t waiting(Nanos now) const;
  void offer(Nanos now);
  [[nodiscard]] bool is_for(const Submission& task, std::uint64_t worker) const;
  void give(Entry& entry, std::uint64_t worker, Nanos now);
  void failed(Entries::iterator at, const std::string& problem, Nanos now);
  void look(Entries::iterator at, Nanos now);
  void end(Entries::iterator at, ReplyMessage how);
  void tell(const std::function<void()>& what) const {
    if (what) tell_(what);
  }
  [[nodiscard]] std::optional<Nanos> hedged_after(const Digest& spec) const;
  [[nodiscard]] Nanos due(const Entry& entry) const;

  std::string robot_;
  std::uint64_t run_;
  CallerLimits limits_;
  Say say_;
  Tell tell_;
  std::minstd_rand random_;
  Entries entries_;
  bool linked_ = false;
  std::map<std::uint64_t, Worker> workers_;   ///< That are not silent, by instance.
  Nanos offered_{-1};                         ///< When tasks were offered last.
  std::map<Digest, std::deque<Nanos>> took_;  ///< The last calls of each spec.
  CallerCounts counts_;
  LinkEstimate estimate_;
};

}  // namespace pirt::cloud
