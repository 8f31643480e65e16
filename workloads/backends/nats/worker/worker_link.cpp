#include "workloads/backends/nats/worker/worker_link.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "workloads/backends/nats/link/blobs.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"
#include "workloads/base/text/json.h"

namespace pirt::cloud {
namespace {

/// How long the server keeps a request for work.
constexpr Nanos kPull = std::chrono::seconds(5);
/// After which one is taken for lost, with whatever would have said so.
constexpr Nanos kPullLost = std::chrono::seconds(7);
constexpr Nanos kLater = std::chrono::seconds(1);
constexpr std::size_t kMostGone = 4096;
const std::string kWithdrawals = "withdrawals";

ConnectionOptions own_connection(const WorkerOptions& options) {
  ConnectionOptions connection = options.connection;
  connection.name = "pirt worker " + options.name;
  return connection;
}

}  // namespace

WorkerLink::WorkerLink(const WorkerOptions& options, std::span<const Workload* const> workloads)
    : options_(options), admission_(workloads), attendant_(options.limits) {
  Connection::Events events;
  events.up = [this] {
    mailbox_.post([this] {
      pulls_.clear();
      hello_at_ = Nanos(0);
      with_attendant([this](Nanos now, AttendantActions& out) { attendant_.link_up(now, out); });
    });
  };
  events.problem = [this](const std::string& problem) {
    const std::lock_guard lock(mutex_);
    problem_ = problem;
  };
  connection_ = std::make_unique<Connection>(own_connection(options_), std::move(events));
  Connection& connection = *connection_;
  connection.subscribe(connection.inbox() + ".ack.*", [this](const Incoming& message) {
    mailbox_.post([this, number = robot_of(message.subject),
                   stored = read_stored(message.status, message.data)] {
      const auto at = replies_.find(number);
      if (at == replies_.end()) return;
      const auto [sent_key, sent_as] = at->second;
      replies_.erase(at);
      if (!stored.ok) {  // It goes out again after a while.
        const std::lock_guard lock(mutex_);
        problem_ = stored.problem;
        return;
      }
      with_attendant([&, &key = sent_key, send = sent_as](Nanos now, AttendantActions& out) {
        attendant_.stored(key, send, now, out);
      });
    });
  });
  for (int slot = 0; slot < options_.limits.slots; ++slot) {
    const std::string pull = std::to_string(slot);
    connection.subscribe(connection.inbox() + ".pull." + pull,
                         [this, pull](const Incoming& message) { on_pulled(message, pull); });
  }
  connection.subscribe(connection.inbox() + ".pull." + kWithdrawals,
                       [this](const Incoming& message) { on_pulled(message, kWithdrawals); });
  connection.subscribe(connection.inbox() + ".seen.*",
                       [this](const Incoming& message) { on_seen(message); });
  connection.subscribe(gone_subject("*"), [this](const Incoming& message) {
    auto decoded = decode(message.data);
    const auto* const gone =
        decoded.value ? std::get_if<WithdrawMessage>(&*decoded.value) : nullptr;
    if (gone == nullptr) return count_malformed();
    mailbox_.post([this, key = TaskKey{robot_of(message.subject), gone->task}] { forget(key); });
  });
  try {
    for (int slot = 0; slot < options_.limits.slots; ++slot) {
      slots_.push_back(start_thread([this, slot] { compute(static_cast<std::size_t>(slot)); }));
    }
    server_ = start_thread([this] { serve(); });
  } catch (...) {
    stopping_ = true;
    changed_.notify_all();
    mailbox_.close();
    throw;
  }
}

WorkerLink::~WorkerLink() {
  stopping_ = true;
  {
    const std::lock_guard lock(mutex_);
    waiting_.clear();
  }
  changed_.notify_all();
  for (auto& slot : slots_) slot.join();
  mailbox_.post([this] {
    for (const TaskKey& key : std::set<TaskKey>(held_)) {
      with_attendant([&](Nanos, AttendantActions& out) { attendant_.postponed(key, out); });
    }
    mailbox_.close();
  });
  server_.join();
}

WorkerCounts WorkerLink::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::string WorkerLink::problem() const {
  const std::lock_guard lock(mutex_);
  return problem_;
}

void WorkerLink::count_malformed() {
  const std::lock_guard lock(mutex_);
  ++counts_.malformed;
}

void WorkerLink::serve() {
  name_thread("pirt-worker");
  Mailbox::Letter letter;
  const auto wakes = [this] {
    Nanos until = std::min(attendant_.next_wake(), hello_at_);
    for (const auto& [number, lost_at] : pulls_) until = std::min(until, lost_at);
    return until;
  };
  while (mailbox_.next(wakes(), letter)) {
    if (letter) letter();
    const Nanos now = mailbox_.now();
    if (attendant_.next_wake() <= now) {
      with_attendant([this](Nanos at, AttendantActions& out) { attendant_.wake(at, out); });
    }
    if (hello_at_ <= now) say_hello();
    pull();
  }
}

void WorkerLink::say_hello() {
  hello_at_ = mailbox_.now() + options_.hello;
  if (!connection_->is_up()) return;
  AnnouncementMessage hello{.worker = options_.name,
                            .version = options_.version,
                            .slots = static_cast<std::uint32_t>(options_.limits.slots),
                            .workloads = admission_.known()};
  connection_->publish(kHelloSubject, encode(hello));
}

/// As many requests are under way as slots are free, and one for what is withdrawn.
void WorkerLink::pull() {
  if (!connection_->is_up() || stopping_) return;
  const Nanos now = mailbox_.now();
  std::erase_if(pulls_, [now](const auto& entry) { return entry.second <= now; });
  const auto ask = [&](const char* stream, int batch, const std::string& pull) {
    pulls_[pull] = now + kPullLost;
    connection_->publish(fmt::format("$JS.API.CONSUMER.MSG.NEXT.{}.{}", stream, kWorkers),
                         json_text(Json::object({{"batch", batch}, {"expires", kPull.count()}})),
                         connection_->inbox() + ".pull." + pull);
  };
  if (!pulls_.contains(kWithdrawals)) ask(kWithdrawStream, 1, kWithdrawals);
  int free = attendant_.free_slots() - static_cast<int>(pulls_.size()) + 1;
  for (int slot = 0; slot < options_.limits.slots && free > 0; ++slot) {
    if (pulls_.contains(std::to_string(slot))) continue;
    ask(kTaskStream, 1, std::to_string(slot));
    --free;
  }
}

/// @param pull  The request that it answers. The subject is the stream's, which the server vouches
/// for.
void WorkerLink::on_pulled(const Incoming& message, const std::string& pull) {
  constexpr int kNothing = 404, kOver = 408;
  if (message.status != 0) {
    // After any other it is not asked at once again: there is no such stream, or it is full.
    if (message.status != kNothing && message.status != kOver) return;
    return mailbox_.post([this, pull] { pulls_.erase(pull); });
  }
  if (message.reply.empty()) return count_malformed();  // Nobody's but a stream's has one.
  auto decoded = decode(message.data);
  const std::string robot = robot_of(message.subject);
  auto* const task = decoded.value ? std::get_if<TaskMessage>(&*decoded.value) : nullptr;
  auto* const gone = decoded.value ? std::get_if<WithdrawMessage>(&*decoded.value) : nullptr;
  const bool right = pull == kWithdrawals ? gone != nullptr : task != nullptr;
  if (!right || !is_robot_name(robot)) {
    count_malformed();
    connection_->publish(message.reply, "+TERM");
    return mailbox_.post([this, pull] { pulls_.erase(pull); });
  }
  if (gone != nullptr) {
    return mailbox_.post([this, pull, robot, reply = message.reply, what = std::move(*gone)] {
      pulls_.erase(pull);
      on_withdraw(robot, reply, what);
    });
  }
  mailbox_.post([this, pull, robot, reply = message.reply, what = std::move(*task)]() mutable {
    pulls_.erase(pull);
    on_task(robot, reply, std::move(what));
  });
}

void WorkerLink::on_task(const std::string& robot, const std::string& reply, TaskMessage message) {
  const Nanos aged = ages_.at_least(reply, mailbox_.now());
  const TaskKey key{robot, message.task};
  if (gone_.contains(key)) {
    connection_->publish(reply, "+ACK");
    return;
  }
  if (attendant_.free_slots() <= 0 && !held_.contains(key)) {  // More came than was asked for.
    connection_->publish(reply, "-NAK");
    return;
  }
  const Delivery delivery = ++next_delivery_;
  deliveries_[delivery] = {key, reply};
  held_.insert(key);
  if (std::holds_alternative<Blob>(message.body)) large_.insert(key);
  const Nanos taken = mailbox_.now();
  const Job job{key, std::move(message), taken, aged};
  arriving_ = &job;
  with_attendant([&](Nanos now, AttendantActions& out) {
    attendant_.delivered(key, job.message.send, delivery, now, out);
  });
  arriving_ = nullptr;
}

/// What a robot says of its own tasks; those of others are not touched.
void WorkerLink::on_withdraw(const std::string& robot, const std::string& reply,
                             const WithdrawMessage& message) {
  const TaskKey key{robot, message.task};
  const std::string name = message.task.hex();
  if (!message.blobs.empty()) {
    remove_blob(*connection_, chunks_subject("out", robot, name));
  } else {
    // All workers: whoever has it, or gets it, drops it.
    connection_->publish(gone_subject(robot), encode(message));
    if (message.sequence > 0) {
      connection_->publish(fmt::format("$JS.API.STREAM.MSG.GET.{}", kTaskStream),
                           json_text(Json::object({{"seq", message.sequence}})),
                           connection_->inbox() + ".seen." + robot);
    }
    remove_blob(*connection_, chunks_subject("in", robot, name));
    remove_blob(*connection_, chunks_subject("out", robot, name));
    const std::lock_guard lock(mutex_);
    ++counts_.withdrawn;
  }
  connection_->publish(reply, "+ACK");
}

/// A message that a robot wants off the stream: if it is its own.
void WorkerLink::on_seen(const Incoming& message) {
  const auto answer = try_parse_json(text_of(message.data));
  if (!answer || !answer->contains("message")) return;  // It is gone already.
  const Json& found = answer->at("message");
  if (!found.is_object() || !found.contains("subject") || !found.contains("seq")) return;
  if (found.at("subject") != Json(task_subject(robot_of(message.subject))))
    return count_malformed();
  connection_->publish(fmt::format("$JS.API.STREAM.MSG.DELETE.{}", kTaskStream),
                       json_text(Json::object({{"seq", found.at("seq")}, {"no_erase", true}})),
                       connection_->inbox() + ".deleted");
}

void WorkerLink::forget(const TaskKey& key) {
  if (!gone_.insert(key).second) return;
  oldest_gone_.push_back(key);
  if (oldest_gone_.size() > kMostGone) {
    gone_.erase(oldest_gone_.front());
    oldest_gone_.pop_front();
  }
}

void WorkerLink::apply(AttendantActions actions) {
  {  // Before anybody hears of a reply.
    const std::lock_guard lock(mutex_);
    counts_.tasks = attendant_.counts();
  }
  const auto answer = [this](Delivery delivery, std::string_view what, bool over) {
    const auto at = deliveries_.find(delivery);
    if (at == deliveries_.end()) return;
    connection_->publish(at->second.reply, what);
    if (!over) return;
    held_.erase(at->second.key);
    deliveries_.erase(at);
  };
  for (AttendantAction& action : actions) {
    if (std::holds_alternative<Compute>(action)) {
      const std::lock_guard lock(mutex_);
      waiting_.push_back(*arriving_);
      changed_.notify_one();
    } else if (const auto* const publish = std::get_if<PublishReply>(&action)) {
      ReplyMessage reply = *publish->reply;
      reply.send = publish->send;
      reply.worker = options_.name;
      const std::string number = std::to_string(++next_number_);
      if (const auto before = published_.find(publish->task); before != published_.end()) {
        replies_.erase(before->second);
      }
      published_[publish->task] = number;
      replies_[number] = {publish->task, publish->send};
      connection_->publish(reply_subject(publish->task.robot), encode(reply),
                           connection_->inbox() + ".ack." + number,
                           fmt::format("{}.{}.{}.reply", publish->task.robot,
                                       publish->task.task.hex(), publish->send));
    } else if (const auto* const done = std::get_if<Acknowledge>(&action)) {
      if (const auto at = deliveries_.find(done->delivery); at != deliveries_.end()) {
        const TaskKey key = at->second.key;
        if (large_.erase(key) > 0) {
          remove_blob(*connection_, chunks_subject("in", key.robot, key.task.hex()));
        }
        published_.erase(key);
      }
      answer(done->delivery, "+ACK", true);
    } else if (const auto* const later = std::get_if<LeaveForLater>(&action)) {
      answer(later->delivery, fmt::format("-NAK {{\"delay\": {}}}", kLater.count()), true);
    } else if (const auto* const progress = std::get_if<SayProgress>(&action)) {
      answer(progress->delivery, "+WPI", false);
    } else {
      const auto& running = std::get<SayRunning>(action);
      connection_->publish(running_subject(running.task.robot),
                           encode(ReplyMessage{.task = running.task.task,
                                               .send = running.send,
                                               .kind = ReplyKind::kRunning,
                                               .worker = options_.name}));
    }
  }
}

}  // namespace pirt::cloud
