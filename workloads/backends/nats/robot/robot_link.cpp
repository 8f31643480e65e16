#include "workloads/backends/nats/robot/robot_link.h"

#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/backends/nats/wire/tensors.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
namespace {

constexpr Nanos kAskAgain = std::chrono::seconds(1);
constexpr Nanos kLongestWait = std::chrono::hours(1);
constexpr std::size_t kMostHeard = 1024;      ///< Workers.
constexpr std::size_t kMostHello = 64 << 10;  ///< Of it 1024 are kept.
constexpr std::size_t kMostReply = std::numeric_limits<std::size_t>::max();  ///< With its outputs.
/// A message that no measurement of the bandwidth follows from.
constexpr std::size_t kSmall = 64 << 10;
/// Of what is measured, in what is known from before.
constexpr double kNew = 0.25;

/// As what @p known_by says, where the name alone does not.
bool knows(const HelloMessage& worker, const std::string& workload,
           const std::optional<Digest>& known_by) {
  return std::ranges::any_of(worker.workloads, [&](const HelloMessage::Known& known) {
    return known.workload == workload && (!known_by || known.spec == *known_by);
  });
}

}  // namespace

template <typename Step>
void RobotLink::with_caller(Step step) {
  std::vector<std::function<void()>> told;
  {
    const std::lock_guard lock(mutex_);
    step(clock_.now());
    told.swap(told_);
  }
  changed_.notify_all();
  say_all();
  for (const auto& each : told) each();
}

/// In order, by whoever comes first, and without the lock: a server that does not read holds up
/// who publishes, and nobody who asks whether there is a link.
void RobotLink::say_all() {
  std::unique_lock lock(mutex_);
  if (std::exchange(saying_, true)) return;
  while (!said_.empty()) {
    const auto [to, frame] = std::move(said_.front());
    said_.pop_front();
    lock.unlock();
    connection_->publish(to, frame);
    lock.lock();
  }
  saying_ = false;
}

template <typename Said>
void RobotLink::subscribe(const std::string& subject, std::size_t most_bytes,
                          void (RobotLink::*handler)(const Said&)) {
  connection_->subscribe(subject, [=, this](const Incoming& message) {
    if (message.data.size() > most_bytes) return connection_->note("a worker says too much");
    const auto said = decode_as<Said>(message.data);
    if (said.value) return (this->*handler)(*said.value);
    connection_->note("a worker says what cannot be read: " + said.problem);
  });
}

RobotLink::RobotLink(const RobotOptions& options)
    : options_(options), caller_(*this, options.limits, run_) {
  check_robot_name(options_.robot);
  options_.connection.name = "pirt robot " + options_.robot;
  options_.connection.inbox = "_INBOX_" + options_.robot;
  Connection::Events events;
  events.up = [this] { with_caller([this](Nanos now) { ask_at_ = now; }); };
  events.down = [this] {
    with_caller([this](Nanos) {
      ask_at_ = Nanos::max();
      caller_.link_down();
    });
  };
  connection_ = std::make_unique<Connection>(options_.connection, std::move(events));
  subscribe(subject("claim", options_.robot), kMostHello, &RobotLink::claimed);
  subscribe(subject("answer", options_.robot), kMostReply, &RobotLink::replied);
  subscribe(kHelloSubject, kMostHello, &RobotLink::heard_hello);
  server_ = start_thread([this](const std::stop_token& stop) { serve(stop); });
}

RobotLink::~RobotLink() {
  server_ = {};
  {
    const std::lock_guard lock(mutex_);
    while (!running_.empty()) caller_.cancel(running_.begin()->first);
    told_.clear();
  }
  say_all();
}

void RobotLink::serve(const std::stop_token& stop) {
  name_thread("pirt-robot");
  while (!stop.stop_requested()) {
    try {
      bool asks = false;
      with_caller([&](Nanos now) {
        asks = ask_at_ <= now;
        if (asks) ask_at_ = now + kAskAgain;
        if (caller_.next_wake() <= now) caller_.wake(now);
      });
      if (asks) ask_for_stream();
      std::unique_lock lock(mutex_);
      const Nanos until = std::min(caller_.next_wake(), ask_at_), now = clock_.now();
      const Nanos left =
          std::clamp<Nanos>(until - std::min(until, now), Nanos::zero(), kLongestWait);
      changed_.wait_for(lock, stop, left,
                        [&] { return std::min(caller_.next_wake(), ask_at_) < until; });
    } catch (const std::exception& error) {  // Such as no memory: it goes on.
      connection_->note(error.what());
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
}

/// Without a stream of its own nothing large would ever get to a worker.
void RobotLink::ask_for_stream() {
  const auto answer =
      connection_->request("$JS.API.STREAM.INFO." + blob_stream(options_.robot), "", kAskAgain);
  if (!answer.came) {
    if (!connection_->is_up()) return;
    const std::lock_guard lock(mutex_);
    no_stream_ = fmt::format(
        "it does not say whether robot '{}' has a stream; may this user be that robot (pirt "
        "cloud-admin permissions)?",
        options_.robot);
    return;
  }
  StreamAnswer stream = read_answer(answer);
  if (stream.error == kNoStream) {
    stream.why = fmt::format("no stream for robot '{}'; run `pirt cloud-admin setup --robots {}`",
                             options_.robot, options_.robot);
  }
  if (connection_->chunk_bytes() == 0) stream.why = connection_->why_no_chunks();
  with_caller([&](Nanos now) {
    no_stream_ = stream.why;
    if (!no_stream_.empty() || !connection_->is_up()) return;  // It is asked again.
    stream_bytes_ = stream.json.at("config").value("max_bytes", std::int64_t{0});
    ask_at_ = Nanos::max();
    caller_.link_up(now);
  });
}

void RobotLink::submit(const TaskId& task, Submission submission) {
  with_caller([&](Nanos now) {
    const auto deadline =
        submission.time_left ? std::optional(later_by(now, *submission.time_left)) : std::nullopt;
    const std::string kind = submission.task.spec.hex();
    running_.try_emplace(task, Running{std::move(submission), now});
    caller_.submit(task, kind, deadline, now);
  });
}

void RobotLink::cancel(const TaskId& task) {
  with_caller([&](Nanos) { caller_.cancel(task); });
}

void RobotLink::ready(const TaskId& task) {
  with_caller([&](Nanos now) { caller_.ready(task, now); });
}

void RobotLink::offer(std::uint32_t waiting) {
  said_.emplace_back(subject("offer", options_.robot), encode(OfferMessage{run_, waiting}));
}

void RobotLink::give_nothing(std::uint64_t worker) {
  said_.emplace_back(task_subject(options_.robot, worker), encode(OfferMessage{run_, 0}));
}

void RobotLink::give(const GivenTask& given) {
  const auto at = running_.find(given.task);
  if (at == running_.end()) return;
  Running& running = at->second;
  TaskMessage& message = running.submission.task;
  message.task = given.task;
  message.send = given.send;
  message.waiting = given.waiting;
  message.time_left = given.time_left;
  Bytes frame = encode(message);
  running.given = clock_.now();
  running.sent_bytes = frame.size();
  said_.emplace_back(task_subject(options_.robot, given.worker), std::move(frame));
}

void RobotLink::missing(const TaskId& task) {
  const auto at = running_.find(task);
  if (at != running_.end() && at->second.submission.missing) {
    told_.push_back(at->second.submission.missing);
  }
}

void RobotLink::withdraw(const TaskId& task) {
  said_.emplace_back(subject("cancel", options_.robot), encode(CancelMessage{task}));
}

void RobotLink::end(const TaskId& task, CallEndKind how, const std::string& problem,
                    const ReplyMessage* reply) {
  const auto at = running_.find(task);
  if (at == running_.end()) return;
  const Running running = std::move(at->second);
  running_.erase(at);
  TaskEnd told{.how = how, .problem = problem};
  if (reply != nullptr) {
    told.worker = reply->worker;
    told.send = reply->send;
    told.execute = reply->execute;
    told.outputs = reply->outputs;
  }
  told.total = clock_.now() - running.submitted;
  if (!running.submission.ended) return;
  told_.push_back([ended = running.submission.ended, told = std::move(told)] { ended(told); });
}

void RobotLink::replied(const ReplyMessage& reply) {
  Nanos took{0};
  std::size_t bytes = 0;
  with_caller([&](Nanos now) {
    const auto at = running_.find(reply.task);
    if (at != running_.end() && !std::exchange(at->second.taken, true)) {
      Running& running = at->second;
      took = now - running.given;
      bytes = running.sent_bytes;
      if (running.submission.taken) told_.push_back(running.submission.taken);
    }
    caller_.replied(reply, now);
  });
  if (bytes > 0) measure(took, bytes);
}

void RobotLink::heard_hello(const HelloMessage& hello) {
  with_caller([&](Nanos now) {
    if (workers_.size() >= kMostHeard) workers_.clear();
    const auto silent = std::erase_if(workers_, [&](const auto& entry) {
      return entry.second.at + options_.limits.worker < now && entry.first != hello.instance;
    });
    const auto [known, is_new] = workers_.try_emplace(hello.instance);
    if (is_new || silent > 0 || known->second.said.workloads != hello.workloads) ++heard_;
    known->second = {hello, now};
    caller_.worker_heard(hello.instance, now);
  });
}

/// A task goes to a worker that knows its workload, if there is one.
void RobotLink::claimed(const ClaimMessage& claim) {
  if (claim.run != run_) return;  // Of another program of this robot's name.
  const auto takes = [&](const TaskId& task) {
    const auto running = running_.find(task);
    if (running == running_.end()) return false;
    const Submission& submission = running->second.submission;
    const auto its = [&](const Worker& worker) {
      return knows(worker.said, submission.task.workload, submission.known_by);
    };
    const auto asks = workers_.find(claim.worker);
    if (asks != workers_.end() && its(asks->second)) return true;
    return std::ranges::none_of(workers_, [&](const auto& each) { return its(each.second); });
  };
  with_caller([&](Nanos now) { caller_.claimed(claim.worker, takes, now); });
}

void RobotLink::measure(Nanos took, std::size_t bytes) {
  const std::lock_guard lock(mutex_);
  if (bytes < kSmall) {
    const Nanos known = estimate_.round_trip.value_or(took);
    estimate_.round_trip = known + scaled(took - known, kNew);
    return;
  }
  const Nanos moving = took - estimate_.round_trip.value_or(Nanos::zero());
  if (moving <= Nanos::zero()) return;
  const double rate = static_cast<double>(bytes) / to_s(moving);
  const double known = estimate_.bytes_per_s.value_or(rate);
  estimate_.bytes_per_s = known + kNew * (rate - known);
}

bool RobotLink::is_up() const {
  const std::lock_guard lock(mutex_);
  return caller_.is_up(clock_.now());
}

bool RobotLink::wait_until_up(Nanos most) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, most, [this] { return caller_.is_up(clock_.now()); });
}

std::string RobotLink::why_down() const {
  const std::string server = "server " + public_url(options_.connection.server);
  if (!connection_->is_up()) return "no connection to " + server + ": " + connection_->why_down();
  const std::string problem = connection_->problem();
  const std::lock_guard lock(mutex_);
  if (caller_.is_up(clock_.now())) return "";
  if (!no_stream_.empty()) return server + ": " + no_stream_;
  if (!problem.empty() && workers_.empty()) {
    return "nothing was heard of a worker at " + server + " (" + problem + ")";
  }
  return "no worker is at " + server + "; start one (pirt cloud-worker --server " +
         public_url(options_.connection.server) + ")";
}

std::string RobotLink::why_too_large(const std::string& what, std::uint64_t bytes) const {
  const std::lock_guard lock(mutex_);
  if (stream_bytes_ <= 0 || std::cmp_less_equal(bytes, stream_bytes_)) return "";
  return fmt::format(
      "{} has {} MB to send, and robot {} may have {} MB on the server; give it more (pirt "
      "cloud-admin setup --robot-mb)",
      what, bytes >> 20, options_.robot, stream_bytes_ >> 20);
}

LinkEstimate RobotLink::estimate() const {
  const std::lock_guard lock(mutex_);
  LinkEstimate estimate = estimate_;
  estimate.late_replies = caller_.counts().late;
  return estimate;
}

CallerCounts RobotLink::counts() const {
  const std::lock_guard lock(mutex_);
  return caller_.counts();
}

std::string RobotLink::why_not(const Workload& workload) const {
  const Kind kind = kind_of(workload);
  const std::lock_guard lock(mutex_);
  std::string why;
  for (const auto& [instance, worker] : workers_) {
    const std::string who =
        fmt::format("worker {} (pirt {})", worker.said.worker, worker.said.version);
    if (knows(worker.said, kind.name, kind.known_by)) return "";
    why = knows(worker.said, kind.name, {})
              ? fmt::format("{} has another {}: {}", who, kind.name, kind.differs)
              : fmt::format("{} does not know {}{}", who, kind.name,
                            kind.missing.empty()
                                ? ", or has no room for it (pirt cloud-worker --cache-mb)"
                                : kind.missing);
  }
  return why;
}

}  // namespace pirt::cloud
