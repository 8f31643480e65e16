// The robot's side: which task is sent when, again, or no more. A pure state machine.
//
// No thread, no clock, no connection: every call is an input with its time, and appends what is to
// be done. The same inputs give the same answers, whether a server or a simulation drives it. A
// task is in the outbox from before it is first sent until its end has been told, and its end is
// told once. One caller at a time.
//
// Why a task is sent again: the server has not confirmed it (under the same message id, which the
// server may know already); a try failed, or nothing was heard for long (under the next `send`, so
// that no window of the server's swallows it; workers and this side tell by the task's id).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "workloads/backends/nats/robot/outbox.h"
#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

struct CallerLimits {
  std::uint32_t most_tries = 3;              ///< A task whose kernel failed as often is given up.
  Nanos confirm = std::chrono::seconds(5);   ///< For the server to say that it has a task.
  Nanos silence = std::chrono::seconds(60);  ///< Without a reply or a sign of life; then doubled,
  Nanos longest_silence = std::chrono::minutes(10);  ///< to no more than this.
  Nanos worker = std::chrono::seconds(10);  ///< Since a worker was last heard: the unit is down.
  Nanos full = std::chrono::seconds(1);     ///< Between attempts where the stream is full.
};

/// How a task ended at its caller.
enum class CallEndKind : std::uint8_t {
  kDone,
  kGivenUp,   ///< Its tries failed.
  kRefused,   ///< No worker would ever run it.
  kReturned,  ///< Its time for this was over: it is to be computed elsewhere.
  kCancelled,
};

/// What is to be done, in order.
struct Publish {
  TaskId task;
  std::uint32_t send = 1;
  std::optional<Nanos> time_left;
};
struct Withdraw {
  TaskId task;
  std::uint64_t sequence = 0;  ///< On the stream; 0 = the server never confirmed it.
};
struct SendParameters {
  TaskId task;
};
struct TellEnd {
  TaskId task;
  CallEndKind how = CallEndKind::kDone;
  std::string problem;                ///< In one line; empty if done.
  std::optional<ReplyMessage> reply;  ///< Of one that is done.
};
enum class Availability : std::uint8_t { kUp, kDraining, kDown };
struct TellAvailability {
  Availability availability = Availability::kDown;
};
using CallerAction = std::variant<Publish, Withdraw, SendParameters, TellEnd, TellAvailability>;
using CallerActions = std::vector<CallerAction>;

struct CallerCounts {
  std::int64_t submitted =
      0;  ///< Taken; = done + given_up + refused + returned + cancelled + live.
  std::int64_t outbox_full = 0, stream_full = 0;  ///< Submissions and sendings turned away.
  std::int64_t done = 0, given_up = 0, refused = 0, returned = 0, cancelled = 0;
  std::int64_t sent_again = 0;  ///< Under the next number.
  std::int64_t late = 0;        ///< Replies to tasks that had ended: dropped.
};

class Caller {
 public:
  /// Tasks of an earlier run that are in the outbox: those without a key are withdrawn, those with
  /// one are sent again and wait for somebody to submit the key.
  Caller(Outbox& outbox, const CallerLimits& limits, Nanos now, CallerActions& out);

  enum class Submission : std::uint8_t {
    kTaken,
    kOutboxFull,
    kOtherBody,  ///< The key stands for another task, which has not ended.
    kTwice,      ///< Somebody waits for that task already.
  };
  /// @param key         Of a task that survives the program; empty = none. The id follows from it
  /// and the body.
  /// @param first_send  Of one with a key, above that of any earlier submission of it: workers may
  /// remember those.
  /// @param give_back   When it is to be computed elsewhere at the latest; absent = never.
  Submission submit(const TaskId& task, const std::string& key, ByteView body,
                    std::optional<Nanos> deadline, std::optional<Nanos> give_back, Nanos now,
                    CallerActions& out, std::uint32_t first_send = 1);
  /// Nothing more is heard of it but its end.
  void cancel(const TaskId& task, Nanos now, CallerActions& out);

  void link_up(Nanos now, CallerActions& out);
  void link_down(Nanos now, CallerActions& out);
  /// The server has it on its stream.
  void confirmed(const TaskId& task, std::uint32_t send, std::uint64_t sequence, Nanos now,
                 CallerActions& out);
  /// The server did not take it.
  void rejected(const TaskId& task, std::uint32_t send, Nanos now, CallerActions& out);
  void replied(const ReplyMessage& reply, Nanos now, CallerActions& out);
  void worker_heard(Nanos now, CallerActions& out);
  void wake(Nanos now, CallerActions& out);
  /// When to call wake next; Nanos::max() = never.
  [[nodiscard]] Nanos next_wake() const;

  [[nodiscard]] const CallerCounts& counts() const { return counts_; }
  [[nodiscard]] std::size_t live() const { return entries_.size(); }
  [[nodiscard]] Availability availability() const { return availability_; }

 private:
  enum class Stage : std::uint8_t {
    kWaiting,  ///< To be sent once there is a link.
    kSending,  ///< Until the server confirms.
    kWithServer,
    kHeld,      ///< The stream was full.
    kAnswered,  ///< Nobody has asked for the reply yet.
  };
  struct Entry {
    std::string key = {};
    bool waited_for = true;
    Stage stage = Stage::kWaiting;
    std::uint32_t sends = 1, tries = 0;
    std::uint64_t sequence = 0;
    std::optional<Nanos> deadline = {}, give_back = {};
    Nanos next{0};     ///< When its stage is looked at again.
    Nanos silence{0};  ///< What it is given next.
  };
  using Entries = std::map<TaskId, Entry>;

  void take_reply(const ReplyMessage& reply, Nanos now, CallerActions& out);
  void send(const TaskId& task, Entry& entry, Nanos now, CallerActions& out);
  void send_again(const TaskId& task, Entry& entry, Nanos now, CallerActions& out);
  void failed_try(Entries::iterator at, const ReplyMessage& reply, Nanos now, CallerActions& out);
  void end(Entries::iterator at, CallEndKind how, std::string problem,
           std::optional<ReplyMessage> reply, CallerActions& out);
  void withdraw(const TaskId& task, const Entry& entry, CallerActions& out) const;
  void look(Entries::iterator at, Nanos now, CallerActions& out);
  void hear(Entry& entry, Nanos now) const;
  void settle(Nanos now, CallerActions& out);
  [[nodiscard]] Nanos due(const Entry& entry) const;

  Outbox& outbox_;
  CallerLimits limits_;
  Entries entries_;
  bool linked_ = false;
  bool outbox_was_full_ = false;
  std::optional<Nanos> stream_full_until_;
  std::optional<Nanos> worker_heard_;
  Availability availability_ = Availability::kDown;
  CallerCounts counts_;
};

}  // namespace pirt::cloud
