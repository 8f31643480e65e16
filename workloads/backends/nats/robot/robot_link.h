// The robot's end. A Caller decides which task is given to which worker, again, or no more; a
// RobotLink drives it over a connection. What is larger than a message whoever submits it puts on
// the robot's stream, and reads from there (link/stream.h).
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "workloads/backends/nats/link/stream.h"
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

/// What has become of a task.
struct Progress {
  bool taken = false;    ///< By a worker.
  bool missing = false;  ///< On the stream: what it says is there. Then ready().
  /// In any case, and once: a worker's reply, or nothing but the problem, in one line.
  std::optional<ReplyMessage> end = {};
};

struct CallerCounts {
  std::int64_t done = 0;
  std::int64_t sent_again = 0;
  std::int64_t hedged = 0;   ///< Of those: a second worker, beside the first.
  std::uint64_t others = 0;  ///< How often what workers announced was another, or one fell silent.
};

/// A pure state machine: every call is an input with its time, and hands out what is to be said to
/// workers. The same inputs give the same answers. One caller at a time, and nobody looks at a
/// task's progress meanwhile.
class Caller {
 public:
  /// A message, and the subject that it is for.
  using Say = std::function<void(std::string subject, Bytes message)>;

  /// @param robot  Whose program's @p run it is, a random number.
  Caller(std::string robot, std::uint64_t run, const CallerLimits& limits, Say say)
      : robot_(std::move(robot)),
        run_(run),
        limits_(limits),
        say_(std::move(say)),
        random_(static_cast<std::uint32_t>(run)) {}

  /// @param task  Whole, but for its numbers; its time counts from now.
  std::shared_ptr<Progress> submit(TaskMessage task, Nanos now);
  /// Nothing more is heard of it but its end.
  void cancel(const TaskId& task);
  /// What workers missed is there now.
  void ready(const TaskId& task, Nanos now);

  void link_up(Nanos now);
  void link_down();
  void claimed(ClaimMessage claim, Nanos now);
  void replied(ReplyMessage reply, Nanos now);
  void heard(HelloMessage hello, Nanos now);
  void wake(Nanos now);
  /// When to call wake next; Nanos::max() = never.
  [[nodiscard]] Nanos next_wake() const;

  [[nodiscard]] const CallerCounts& counts() const { return counts_; }
  /// Round trip of a small task to a worker; bandwidth to the server.
  [[nodiscard]] const LinkEstimate& estimate() const { return estimate_; }
  /// So many bytes have got there.
  void measure(Nanos took, std::size_t bytes);
  /// Whether a task that is submitted now gets to a worker.
  [[nodiscard]] bool is_up(Nanos now) const;
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
    TaskMessage task = {};
    std::shared_ptr<Progress> progress = std::make_shared<Progress>();
    std::set<std::uint64_t> refused = {};  ///< By these workers.
    std::optional<Nanos> offered_at = {};  ///< Waits for a worker from then on.
    std::optional<Nanos> deadline = {}, hedge_at = {};
    std::vector<Given> given = {};
    std::size_t given_bytes = 0;  ///< To a worker, the last time.
    std::uint32_t sends = 0, tries = 0;
  };
  using Entries = std::map<TaskId, Entry>;
  struct Worker {
    HelloMessage said = {};
    Nanos at{0};
    bool is_here = false;  ///< It was heard since there is this link.
    [[nodiscard]] bool lives(Nanos now, Nanos within) const { return is_here && now < at + within; }
  };
  using Workers = std::map<std::uint64_t, Worker>;  ///< By instance.

  [[nodiscard]] static bool waits(const Entry& entry, Nanos now) {
    return entry.offered_at && *entry.offered_at <= now;
  }
  [[nodiscard]] std::uint32_t waiting(Nanos now) const;
  void offer(Nanos now);
  void give(Entry& entry, std::uint64_t worker, Nanos now);
  [[nodiscard]] static bool suits(const Entry& entry, const Workers::value_type& worker);
  void failed(Entries::iterator at, const std::string& problem, Nanos now, bool missing = false);
  void end(Entries::iterator at, ReplyMessage how);
  void restart_waits(Nanos now);
  [[nodiscard]] std::optional<Nanos> hedged_after(const Digest& spec) const;
  [[nodiscard]] Nanos due(const Entry& entry) const;

  std::string robot_;
  std::uint64_t run_;
  CallerLimits limits_;
  Say say_;
  std::minstd_rand random_;
  Entries entries_;
  bool linked_ = false;
  Workers workers_;                           ///< That are not silent.
  Nanos offered_{-1};                         ///< When tasks were offered last.
  std::map<Digest, std::deque<Nanos>> took_;  ///< The last calls of each spec.
  CallerCounts counts_;
  LinkEstimate estimate_;
};

struct RobotOptions {
  ConnectionOptions connection = {};
  std::string robot = "robot";  ///< As the administrator knows it.
  CallerLimits limits = {};
};

/// Any thread may call it.
class RobotLink {
 public:
  /// As Connection's. @throws Error{kBadInput} for a name that no robot may have, too.
  explicit RobotLink(const RobotOptions& options);
  /// Who has submitted a task has seen its end, or has cancelled it.
  ~RobotLink() { server_ = {}; }

  /// The name of the next task that is submitted: blobs have it.
  [[nodiscard]] TaskId next_task() { return {run_, ++number_}; }
  /// What the caller says to a question of its own, such as &Caller::counts.
  template <typename Question, typename... With>
  [[nodiscard]] auto ask(Question question, const With&... with) const {
    const std::lock_guard lock(mutex_);
    return (caller_.*question)(with...);
  }
  /// An input to the caller. What it has to say is published without the lock, in order: a server
  /// that does not read holds up who has something to say, and nobody who asks.
  /// @param input  void(Caller&, Nanos now)
  template <typename Input>
  void step(const Input& input) {
    std::unique_lock lock(mutex_);
    const std::size_t before = said_.size();  // Whoever said that publishes it.
    input(caller_, clock_.now());
    const bool says = said_.size() > before;
    lock.unlock();
    changed_.notify_all();
    if (!says) return;
    const std::lock_guard saying(saying_);
    lock.lock();
    const auto said = std::exchange(said_, {});
    lock.unlock();
    for (const auto& [to, frame] : said) connection_->publish(to, frame);
  }
  /// Until something holds, which is looked at after each step, or @p most is over: what was
  /// submitted changes within steps alone. @return  Whether it does.
  template <typename Holds>
  bool wait(Nanos most, const Holds& holds) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, most, holds);
  }

  [[nodiscard]] bool is_up() const { return ask(&Caller::is_up, clock_.now()); }
  /// Until it is up, or @p most is over. @return  Whether it is.
  [[nodiscard]] bool wait_until_up(Nanos most) {
    return wait(most, [this] { return caller_.is_up(clock_.now()); });
  }
  /// Why it is not up, in one line with the remedy; empty if it is.
  [[nodiscard]] std::string why_down() const;
  /// Why so many bytes of @p what cannot be on this robot's stream; empty if they can.
  [[nodiscard]] std::string why_too_large(const std::string& what, std::uint64_t bytes) const;
  /// Within a wait: room beside other calls on the stream, where what is new pushes out what is
  /// old. Alone each has it. @return  Whether it is @p taken, until give_room.
  bool take_room(std::uint64_t bytes, std::uint64_t& taken) {
    const bool has = bytes == 0 || room_taken_ == 0 || fits(room_taken_ + bytes);
    if (has) room_taken_ += taken = bytes;
    return has;
  }
  void give_room(std::uint64_t bytes) {
    step([&](Caller&, Nanos) { room_taken_ -= bytes; });
  }
  /// The robot's stream may be gone, or be another one.
  void look_for_stream() {
    step([this](Caller&, Nanos now) { ask_at_ = std::min(ask_at_, now); });
  }
  [[nodiscard]] Connection& connection() { return *connection_; }
  [[nodiscard]] const std::string& robot() const { return options_.robot; }

 private:
  void serve(const std::stop_token& stop);
  void ask_for_stream();
  [[nodiscard]] bool fits(std::uint64_t bytes) const {
    return stream_bytes_ <= 0 || std::cmp_less_equal(bytes, stream_bytes_);
  }

  RobotOptions options_;
  std::uint64_t run_ = new_id();
  std::atomic<std::uint64_t> number_ = 0;
  MachineClock clock_;

  std::mutex saying_;         ///< Taken before the other one.
  mutable std::mutex mutex_;  ///< Of what follows.
  std::condition_variable_any changed_;
  Caller caller_;
  std::vector<std::pair<std::string, Bytes>> said_;  ///< Subjects and messages, within a step.
  Nanos ask_at_ = Nanos::max();                      ///< For the robot's stream.
  std::int64_t stream_bytes_ = 0;  ///< That its stream may have; below 1 = any number.
  std::uint64_t room_taken_ = 0;   ///< Of those.
  std::string no_stream_;          ///< Why there is none, with the remedy; empty = there is.

  std::jthread server_;
  std::unique_ptr<Connection> connection_;  ///< Last: its handlers use the rest.
};

}  // namespace pirt::cloud
