// What a robot's link says and hears, on the thread that serves.
#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "workloads/backends/nats/link/blobs.h"
#include "workloads/backends/nats/robot/robot_link.h"
#include "workloads/backends/nats/wire/subjects.h"

namespace pirt::cloud {
namespace {

/// A message that no measurement of the bandwidth follows from.
constexpr std::size_t kSmall = 64 << 10;
/// Of what is measured, in what is known from before.
constexpr double kNew = 0.25;

std::string in_prefix(const std::string& robot, const TaskId& task) {
  return chunks_subject("in", robot, task.hex());
}

}  // namespace

void RobotLink::apply(CallerActions actions) {
  {  // Before anybody hears of an end.
    const std::lock_guard lock(mutex_);
    counts_ = caller_->counts();
  }
  for (CallerAction& action : actions) {
    if (const auto* const what = std::get_if<Publish>(&action)) {
      publish(*what);
    } else if (const auto* const gone = std::get_if<Withdraw>(&action)) {
      withdraw(gone->task, gone->sequence, {});
    } else if (const auto* const asked = std::get_if<SendParameters>(&action)) {
      send_parameters(asked->task);
    } else if (const auto* const end = std::get_if<TellEnd>(&action)) {
      tell_end(*end);
    } else {
      const auto is = std::get<TellAvailability>(action).availability;
      const std::lock_guard lock(mutex_);
      availability_ = is;
      changed_.notify_all();
    }
  }
}

void RobotLink::publish(const Publish& what) {
  const auto running = running_.find(what.task);
  Bytes body = outbox_->body(what.task);
  TaskMessage message{.task = what.task, .send = what.send, .time_left = what.time_left};
  if (body.size() <= connection_->chunk_bytes()) {
    message.body = std::move(body);
    send_message(what.task, what.send, message);
    return;
  }
  if (running != running_.end()) {
    if (running->second.moving == what.send) return;  // It takes its time.
    running->second.moving = what.send;
    running->second.large = true;
  }
  send_blobs(what.task, what.send, what.time_left, std::make_shared<const Bytes>(std::move(body)));
}

void RobotLink::send_message(const TaskId& task, std::uint32_t send, const TaskMessage& message) {
  const Bytes frame = encode(message);
  const std::string number = std::to_string(++next_sent_);
  sent_[number] = {task, send, mailbox_.now(), frame.size()};
  const auto forgotten = [](const auto& entry, Nanos now) {
    return entry.second.at + std::chrono::minutes(2) < now;
  };
  std::erase_if(sent_,
                [&, now = mailbox_.now()](const auto& entry) { return forgotten(entry, now); });
  connection_->publish(task_subject(options_.robot), frame, connection_->inbox() + ".ack." + number,
                       fmt::format("{}.{}.{}", options_.robot, task.hex(), send));
}

/// The chunks first: who finds the task finds all of it.
void RobotLink::send_blobs(const TaskId& task, std::uint32_t send, std::optional<Nanos> time_left,
                           std::shared_ptr<const Bytes> body) {
  const auto chunk = static_cast<std::uint32_t>(connection_->chunk_bytes());
  moves_.post([this, task, send, time_left, chunk, body = std::move(body)] {
    const Nanos begin = mailbox_.now();
    const std::string problem =
        put_blob(*connection_, in_prefix(options_.robot, task), *body, chunk, [this] {
          return stopping_.load();
        }).problem;
    const Sent all{task, send, begin, body->size()};
    const TaskMessage message{.task = task,
                              .send = send,
                              .time_left = time_left,
                              .body = Blob{digest_of(*body), body->size(), chunk}};
    mailbox_.post([this, task, send, message, problem, all, end = mailbox_.now()] {
      if (const auto at = running_.find(task); at != running_.end()) at->second.moving = 0;
      if (problem.empty()) {
        measure(all, end);
        return send_message(task, send, message);
      }
      const std::lock_guard lock(mutex_);
      problem_ = problem;
    });
  });
}

/// And what else a worker misses: the chunks of a task that was sent long ago.
void RobotLink::send_parameters(const TaskId& task) {
  const auto at = running_.find(task);
  if (at == running_.end()) return;
  const Running& running = at->second;
  if (running.large) {
    auto body = running.submission.body;
    const auto chunk = static_cast<std::uint32_t>(connection_->chunk_bytes());
    moves_.post([this, task, chunk, body = std::move(body)] {
      static_cast<void>(put_blob(*connection_, in_prefix(options_.robot, task), *body, chunk,
                                 [this] { return stopping_.load(); }));
    });
  }
  if (!running.submission.parameters) return;
  Parameters parameters = *running.submission.parameters;
  const auto [moved, is_new] = parameters_.try_emplace(parameters.blob.digest);
  if (!is_new && moved->second.moving) return;  // Every worker asks until they are there.
  moved->second.moving = true;
  moves_.post([this, parameters = std::move(parameters), first = moved->second.stored] {
    const Put put = put_blob(
        *connection_, chunks_subject("par", options_.robot, parameters.blob.digest.hex()),
        *parameters.bytes, parameters.blob.chunk_bytes, [this] { return stopping_.load(); }, first);
    mailbox_.post([this, digest = parameters.blob.digest, put] {
      if (put.problem.empty()) {
        parameters_.erase(digest);  // Who asks again has lost them.
        return;
      }
      parameters_[digest] = {.moving = false, .stored = put.stored};
      const std::lock_guard lock(mutex_);
      problem_ = put.problem;
    });
  });
}

void RobotLink::withdraw(const TaskId& task, std::uint64_t sequence, std::vector<Blob> blobs) {
  const Bytes frame =
      encode(WithdrawMessage{.task = task, .sequence = sequence, .blobs = std::move(blobs)});
  connection_->publish(withdraw_subject(options_.robot), frame, connection_->inbox() + ".ack.0");
}

void RobotLink::tell_end(const TellEnd& end) {
  const auto at = running_.find(end.task);
  if (at == running_.end()) return;
  const Running running = std::move(at->second);
  running_.erase(at);
  if (closing_ || !running.submission.ended) return;
  TaskEnd told{.how = end.how, .problem = end.problem};
  if (end.reply) {
    told.worker = end.reply->worker;
    told.execute = end.reply->execute;
    told.held = end.reply->held;
    if (const auto* const bytes = std::get_if<Bytes>(&end.reply->outputs)) told.outputs = *bytes;
  }
  told.stored = running.stored;
  told.arrived = running.arrived;
  told.total = mailbox_.now() - running.submitted;
  running.submission.ended(std::move(told));
}

void RobotLink::acknowledged(const std::string& number, const Stored& stored) {
  const auto at = sent_.find(number);
  if (at == sent_.end()) return;
  const Sent sent = at->second;
  sent_.erase(at);
  const Nanos now = mailbox_.now();
  if (!stored.ok) {
    {
      const std::lock_guard lock(mutex_);
      problem_ = stored.problem;
    }
    with_caller([&](Nanos at_now, CallerActions& out) {
      caller_->rejected(sent.task, sent.send, at_now, out);
    });
    return;
  }
  measure(sent, now);
  if (const auto running = running_.find(sent.task);
      running != running_.end() && running->second.stored == Nanos::zero()) {
    running->second.stored = now - running->second.submitted;
    if (running->second.submission.stored) running->second.submission.stored();
  }
  with_caller([&](Nanos at_now, CallerActions& out) {
    caller_->confirmed(sent.task, sent.send, stored.sequence, at_now, out);
  });
}

void RobotLink::measure(const Sent& sent, Nanos now) {
  const Nanos took = now - sent.at;
  const std::lock_guard lock(mutex_);
  if (sent.bytes < kSmall) {
    const Nanos known = estimate_.round_trip.value_or(took);
    estimate_.round_trip = known + scaled(took - known, kNew);
    return;
  }
  const Nanos moving = took - estimate_.round_trip.value_or(Nanos::zero());
  if (moving <= Nanos::zero()) return;
  const double rate = static_cast<double>(sent.bytes) / to_s(moving);
  const double known = estimate_.bytes_per_s.value_or(rate);
  estimate_.bytes_per_s = known + kNew * (rate - known);
}

void RobotLink::on_reply(const Incoming& message, bool stored) {
  auto decoded = decode(message.data);
  auto* const reply = decoded.value ? std::get_if<ReplyMessage>(&*decoded.value) : nullptr;
  if (reply == nullptr || (!stored && reply->kind != ReplyKind::kRunning)) {
    {
      const std::lock_guard lock(mutex_);
      ++malformed_;
    }
    if (stored && !message.reply.empty()) connection_->publish(message.reply, "+TERM");
    return;
  }
  mailbox_.post([this, reply = std::move(*reply), ack = message.reply]() mutable {
    replied(std::move(reply), ack);
  });
}

void RobotLink::replied(ReplyMessage reply, const std::string& ack) {
  if (std::holds_alternative<Bytes>(reply.outputs)) return take(std::move(reply), ack);
  const auto running = running_.find(reply.task);
  if (running == running_.end()) {  // Late: nobody reads it.
    withdraw(reply.task, 0, {std::get<Blob>(reply.outputs)});
    return take(std::move(reply), ack);
  }
  if (running->second.arrived == Nanos::zero()) {
    running->second.arrived = mailbox_.now() - running->second.submitted;
    if (running->second.submission.arrived) running->second.submission.arrived(reply);
  }
  moves_.post([this, reply = std::move(reply), ack]() mutable {
    fetch_outputs(std::move(reply), std::move(ack));
  });
}

/// Before the Caller hears of the reply: what is not whole is no reply.
void RobotLink::fetch_outputs(ReplyMessage reply, std::string ack) {
  const Blob blob = std::get<Blob>(reply.outputs);
  const std::string prefix = chunks_subject("out", options_.robot, reply.task.hex());
  Fetched fetched;
  while (fetched.how == Fetched::How::kNoAnswer && !stopping_) {
    fetched = fetch_blob(*connection_, prefix, blob, [this] { return stopping_.load(); });
    if (fetched.how == Fetched::How::kNoAnswer) {
      static_cast<void>(connection_->wait_until_up(std::chrono::milliseconds(100)));
    }
  }
  if (stopping_) return;
  mailbox_.post([this, reply = std::move(reply), ack = std::move(ack), blob,
                 fetched = std::move(fetched)]() mutable {
    if (fetched.how != Fetched::How::kWhole) {
      // Removed meanwhile, or damaged: it is asked for again as a try that failed.
      reply.kind = ReplyKind::kFailedTry;
      reply.problem = "its outputs were not on the server";
      reply.outputs = Bytes{};
      return take(std::move(reply), ack);
    }
    reply.outputs = std::move(fetched.bytes);
    const TaskId task = reply.task;
    take(std::move(reply), ack);
    withdraw(task, 0, {blob});
  });
}

void RobotLink::take(ReplyMessage reply, const std::string& ack) {
  // A worker that lacks the parameters has replied, too.
  if (const auto running = running_.find(reply.task); running != running_.end() &&
                                                      reply.kind == ReplyKind::kDone &&
                                                      running->second.arrived == Nanos::zero()) {
    running->second.arrived = mailbox_.now() - running->second.submitted;
    if (running->second.submission.arrived) running->second.submission.arrived(reply);
  }
  with_caller([&](Nanos now, CallerActions& out) { caller_->replied(reply, now, out); });
  // Once its end has been told: the stream may forget it.
  if (!ack.empty()) connection_->publish(ack, "+ACK");
}

void RobotLink::on_hello(const Incoming& message) {
  auto decoded = decode(message.data);
  auto* const hello = decoded.value ? std::get_if<AnnouncementMessage>(&*decoded.value) : nullptr;
  if (hello == nullptr) {
    const std::lock_guard lock(mutex_);
    ++malformed_;
    problem_ = "a worker announced itself in what is no announcement: " + decoded.problem;
    return;
  }
  {
    constexpr std::size_t kMostWorkers = 1024;
    const Nanos now = mailbox_.now();
    const std::lock_guard lock(mutex_);
    if (workers_.size() >= kMostWorkers) workers_.clear();
    const auto silent = std::erase_if(workers_, [&](const auto& entry) {
      return entry.second.at + options_.limits.worker < now && entry.first != hello->worker;
    });
    const auto [known, is_new] = workers_.try_emplace(hello->worker);
    if (is_new || silent > 0 || known->second.announced.workloads != hello->workloads) ++heard_;
    known->second = {std::move(*hello), now};
  }
  mailbox_.post([this] {
    with_caller([this](Nanos now, CallerActions& out) { caller_->worker_heard(now, out); });
  });
}

}  // namespace pirt::cloud
