// The worker's side: what a delivered message means. A pure state machine.
//
// No thread, no clock, no connection, as Caller. A message of the stream is acknowledged only when
// the reply to it is stored, so that a worker that dies leaves it to another; while a task is
// computed, the server and the robot are told so. Tasks are told apart by robot and id: one that
// comes again is not computed again while its reply is remembered. At most `slots` messages are
// held; the rest is left in the stream. One caller at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "workloads/backends/nats/wire/wire.h"

namespace pirt::cloud {

struct AttendantLimits {
  int slots = 1;
  Nanos progress = std::chrono::seconds(10);  ///< How often it is said that a task is computed.
  Nanos confirm = std::chrono::seconds(5);    ///< For the server to say that it has a reply.
  std::uint64_t remembered_bytes = std::uint64_t{64} << 20;  ///< Of replies,
  std::size_t remembered = 4096;                             ///< and how many.
};

/// A message as the stream delivered it: what is acknowledged.
using Delivery = std::uint64_t;

struct TaskKey {
  std::string robot;
  TaskId task;
  friend auto operator<=>(const TaskKey&, const TaskKey&) = default;
};

struct Compute {
  TaskKey task;
};
struct PublishReply {
  TaskKey task;
  std::uint32_t send = 1;
  std::shared_ptr<const ReplyMessage> reply;
};
struct Acknowledge {
  Delivery delivery = 0;
};
/// Back to the stream, to be delivered again after a while.
struct LeaveForLater {
  Delivery delivery = 0;
};
/// The server is told that a delivery is worked on.
struct SayProgress {
  Delivery delivery = 0;
};
/// And the robot.
struct SayRunning {
  TaskKey task;
  std::uint32_t send = 1;
};
using AttendantAction =
    std::variant<Compute, PublishReply, Acknowledge, LeaveForLater, SayProgress, SayRunning>;
using AttendantActions = std::vector<AttendantAction>;

struct AttendantCounts {
  std::int64_t delivered = 0, run = 0, replied = 0;
  std::int64_t same_again = 0;  ///< Deliveries of a task that runs, or whose reply is remembered.
};

class Attendant {
 public:
  explicit Attendant(const AttendantLimits& limits) : limits_(limits) {}

  /// How many more messages may be fetched.
  [[nodiscard]] int free_slots() const { return limits_.slots - static_cast<int>(tasks_.size()); }
  void delivered(const TaskKey& task, std::uint32_t send, Delivery delivery, Nanos now,
                 AttendantActions& out);
  /// What the computation made of it.
  void finished(const TaskKey& task, ReplyMessage reply, Nanos now, AttendantActions& out);
  /// It cannot be computed yet (its parameters are not there): back to the stream.
  void postponed(const TaskKey& task, AttendantActions& out);
  /// The stream of replies has it.
  void stored(const TaskKey& task, std::uint32_t send, Nanos now, AttendantActions& out);
  void wake(Nanos now, AttendantActions& out);
  /// When to call wake next; Nanos::max() = never.
  [[nodiscard]] Nanos next_wake() const;

  [[nodiscard]] const AttendantCounts& counts() const { return counts_; }

 private:
  struct Task {
    std::uint32_t send = 1;  ///< The newest that came.
    std::vector<Delivery> deliveries;
    std::shared_ptr<const ReplyMessage> reply;  ///< Null while it is computed.
    Nanos next{0};                              ///< When to say something again.
    Nanos progress{0};
  };
  struct Remembered {
    std::uint32_t send = 1;
    std::shared_ptr<const ReplyMessage> reply;
  };

  void publish(const TaskKey& key, Task& task, Nanos now, AttendantActions& out);
  void remember(const TaskKey& key, const Task& task);

  AttendantLimits limits_;
  std::map<TaskKey, Task> tasks_;
  std::map<TaskKey, Remembered> remembered_;
  std::deque<TaskKey> oldest_;  ///< Of remembered_, in order.
  std::uint64_t remembered_bytes_ = 0;
  AttendantCounts counts_;
};

}  // namespace pirt::cloud
