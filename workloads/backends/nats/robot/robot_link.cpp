#include "workloads/backends/nats/robot/robot_link.h"

#include <fmt/core.h>

#include <algorithm>
#include <random>
#include <utility>

#include "workloads/backends/nats/wire/own_sizes.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/json.h"

namespace pirt::cloud {
namespace {

constexpr Nanos kAskAgain = std::chrono::seconds(1);

std::uint64_t new_run() {
  std::random_device device;
  return (std::uint64_t{device()} << 32) | device();
}

/// Follows from the key and what is asked for.
TaskId id_of(const std::string& key, ByteView body) {
  const Digest digest = Digester().add(key).add(body).value();
  TaskId id;
  for (std::size_t i = 0; i < 8; ++i) {
    id.run = id.run << 8 | digest.bytes[i];
    id.number = id.number << 8 | digest.bytes[8 + i];
  }
  return id;
}

/// Grows from one run of the program to the next.
std::uint32_t first_send_now() {
  const auto since = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint32_t>(
      std::chrono::duration_cast<std::chrono::seconds>(since).count());
}

std::unique_ptr<Outbox> make_outbox(const RobotOptions& options) {
  if (!is_robot_name(options.robot)) {
    throw_bad_input("robot '" + options.robot +
                    "' cannot be called that; a name is made of letters, digits, '_' and '-'");
  }
  return options.outbox.empty() ? make_memory_outbox(options.outbox_bytes)
                                : open_outbox(options.outbox, options.robot, options.outbox_bytes);
}

ConnectionOptions own_connection(const RobotOptions& options) {
  ConnectionOptions connection = options.connection;
  connection.name = "pirt robot " + options.robot;
  connection.inbox = "_INBOX_" + options.robot;
  return connection;
}

}  // namespace

RobotLink::RobotLink(const RobotOptions& options)
    : options_(options), outbox_(make_outbox(options)), run_(new_run()) {
  CallerActions first;
  caller_ = std::make_unique<Caller>(*outbox_, options_.limits, mailbox_.now(), first);
  Connection::Events events;
  events.up = [this] { mailbox_.post([this] { ask_for_replies(); }); };
  events.down = [this] {
    mailbox_.post([this] {
      ask_again_at_ = Nanos::max();
      with_caller([this](Nanos now, CallerActions& out) { caller_->link_down(now, out); });
    });
  };
  events.problem = [this](const std::string& problem) {
    const std::lock_guard lock(mutex_);
    problem_ = problem;
  };
  connection_ = std::make_unique<Connection>(own_connection(options_), std::move(events));
  Connection& connection = *connection_;
  connection.subscribe(connection.inbox() + ".ack.*", [this](const Incoming& message) {
    mailbox_.post(
        [this, number = robot_of(message.subject),
         stored = read_stored(message.status, message.data)] { acknowledged(number, stored); });
  });
  connection.subscribe(connection.inbox() + ".replies", [this](const Incoming& message) {
    const auto answer = try_parse_json(text_of(message.data));
    const bool knows = answer && answer->contains("config");
    mailbox_.post([this, knows] { replies_come(knows); });
  });
  connection.subscribe(deliver_subject(options_.robot),
                       [this](const Incoming& message) { on_reply(message, true); });
  connection.subscribe(running_subject(options_.robot),
                       [this](const Incoming& message) { on_reply(message, false); });
  connection.subscribe(kHelloSubject, [this](const Incoming& message) { on_hello(message); });
  try {
    server_ = start_thread([this, first = std::move(first)]() mutable {
      apply(std::move(first));
      serve();
    });
    mover_ = start_thread([this] { move(); });
  } catch (...) {
    mailbox_.close();
    throw;
  }
}

RobotLink::~RobotLink() {
  stopping_ = true;
  moves_.close();
  mover_.join();
  mailbox_.post([this] {
    closing_ = true;
    std::vector<TaskId> without_key;
    for (const auto& [task, running] : running_) {
      if (running.submission.key.empty()) without_key.push_back(task);
    }
    for (const TaskId& task : without_key) {
      with_caller([&](Nanos now, CallerActions& out) { caller_->cancel(task, now, out); });
    }
    mailbox_.close();
  });
  server_.join();
}

/// Without a consumer of its own no reply would ever come.
void RobotLink::ask_for_replies() {
  ask_again_at_ = mailbox_.now() + kAskAgain;
  connection_->publish(
      fmt::format("$JS.API.CONSUMER.INFO.{}.{}", kReplyStream, robot_consumer(options_.robot)), "",
      connection_->inbox() + ".replies");
}

void RobotLink::replies_come(bool server_knows_robot) {
  {
    const std::lock_guard lock(mutex_);
    unknown_ = !server_knows_robot;
  }
  if (!server_knows_robot || !connection_->is_up()) return;  // It is asked again.
  ask_again_at_ = Nanos::max();
  with_caller([this](Nanos now, CallerActions& out) { caller_->link_up(now, out); });
}

TaskId RobotLink::submit(Submission submission) {
  TaskId task;
  if (submission.key.empty()) {
    const std::lock_guard lock(mutex_);
    task = {run_, ++number_};
  } else {
    task = id_of(submission.key, *submission.body);
  }
  const Nanos submitted = mailbox_.now();
  mailbox_.post([this, task, submitted, submission = std::move(submission)]() mutable {
    const auto after = [&](std::optional<Nanos> duration) {
      return duration ? std::optional(submitted + *duration) : std::nullopt;
    };
    const auto deadline = after(submission.time_left),
               give_back = after(submission.give_back_after);
    const std::string key = submission.key;
    const auto body = submission.body;
    const auto ended = submission.ended;
    const bool is_new =
        running_.try_emplace(task, Running{std::move(submission), submitted}).second;
    Caller::Submission taken = Caller::Submission::kTwice;
    if (is_new) {
      with_caller([&](Nanos now, CallerActions& out) {
        taken = caller_->submit(task, key, *body, deadline, give_back, now, out,
                                key.empty() ? 1 : first_send_now());
        if (taken != Caller::Submission::kTaken) running_.erase(task);
      });
    }
    const auto refuse = [&](const std::string& why) {
      if (ended) ended({.how = CallEndKind::kRefused, .problem = why});
    };
    switch (taken) {
      case Caller::Submission::kTaken:
        return;
      case Caller::Submission::kOutboxFull:
        return refuse(fmt::format(
            "the outbox has no room for {} bytes more (of {}); give it more (outbox_mb:)",
            body->size(), options_.outbox_bytes));
      case Caller::Submission::kOtherBody:
        return refuse("key '" + key + "' stands for another task, which has not ended");
      case Caller::Submission::kTwice:
        return refuse("key '" + key + "' is waited for already");
    }
  });
  return task;
}

void RobotLink::cancel(const TaskId& task) {
  mailbox_.post([this, task] {
    with_caller([&](Nanos now, CallerActions& out) { caller_->cancel(task, now, out); });
  });
}

Availability RobotLink::availability() const {
  const std::lock_guard lock(mutex_);
  return availability_;
}

bool RobotLink::wait_until_up(Nanos most) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, most, [this] { return availability_ == Availability::kUp; });
}

std::string RobotLink::why_down() const {
  const std::string server = "server " + public_url(options_.connection.server);
  const bool linked = connection_->is_up();
  const std::lock_guard lock(mutex_);
  const std::string said = problem_.empty() ? "" : " (it said: " + problem_ + ")";
  if (!linked) {
    return "no connection to " + server + said +
           "; start one (nats-server -js), or name another (server:)";
  }
  if (unknown_) {
    return fmt::format(
        "{} has no replies for robot '{}'; start it with -js, and run `pirt cloud-admin setup "
        "--robots {}`",
        server, options_.robot, options_.robot);
  }
  switch (availability_) {
    case Availability::kUp:
      return "";
    case Availability::kDraining:
      return server + " or the outbox is full" + said;
    case Availability::kDown:
      break;
  }
  if (!problem_.empty() && workers_.empty()) {
    return "nothing was heard of a worker at " + server + said;
  }
  return "no worker is at " + server + "; start one (pirt cloud-worker --server " +
         public_url(options_.connection.server) + ")";
}

LinkEstimate RobotLink::estimate() const {
  const std::lock_guard lock(mutex_);
  LinkEstimate estimate = estimate_;
  estimate.late_replies = counts_.late;
  return estimate;
}

CallerCounts RobotLink::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::int64_t RobotLink::malformed() const {
  const std::lock_guard lock(mutex_);
  return malformed_;
}

std::string RobotLink::why_not(const Workload& workload) const {
  const Kind kind = kind_of(workload);
  const std::lock_guard lock(mutex_);
  std::string why;
  for (const auto& [name, worker] : workers_) {
    const std::string who = fmt::format("worker {} (pirt {})", name, worker.announced.version);
    why = fmt::format("{} does not know {}{}", who, kind.name, kind.missing);
    for (const auto& known : worker.announced.workloads) {
      if (known.workload != kind.name) continue;
      if (!kind.known_by || known.spec == *kind.known_by) return "";
      why = fmt::format("{} has another {}: {}", who, kind.name, kind.differs);
    }
  }
  return why;
}

void RobotLink::serve() {
  name_thread("pirt-robot");
  Mailbox::Letter letter;
  while (mailbox_.next(std::min(caller_->next_wake(), ask_again_at_), letter)) {
    if (letter) letter();
    if (ask_again_at_ <= mailbox_.now()) ask_for_replies();
    if (caller_->next_wake() <= mailbox_.now()) {
      with_caller([this](Nanos now, CallerActions& out) { caller_->wake(now, out); });
    }
  }
}

void RobotLink::move() {
  name_thread("pirt-mover");
  Mailbox::Letter letter;
  while (moves_.next(Nanos::max(), letter)) {
    if (letter && !stopping_) letter();
  }
}

}  // namespace pirt::cloud
