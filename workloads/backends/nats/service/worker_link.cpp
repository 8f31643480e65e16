#include "workloads/backends/nats/service/worker_link.h"

#include <fmt/core.h>

#include <algorithm>
#include <random>
#include <utility>

#include "workloads/backends/nats/link/blobs.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
namespace {

/// What a robot may say in a few bytes: more is none of these messages.
constexpr std::size_t kMostSmall = 256;

ConnectionOptions worker_connection(const WorkerOptions& options) {
  ConnectionOptions connection = options.connection;
  connection.name = "pirt worker " + options.name;
  return connection;
}

std::uint64_t new_instance() {
  std::random_device device;
  return (std::uint64_t{device()} << 32) | device();
}

}  // namespace

WorkerLink::WorkerLink(const WorkerOptions& options, std::span<const Workload* const> workloads)
    : options_(options),
      instance_(new_instance()),
      admission_(workloads, options.call_bytes),
      desk_(options.limits) {
  Connection::Events events;
  events.up = [this] {
    const std::lock_guard lock(mutex_);
    hello_at_ = Nanos(0);
    offered_ = true;
    changed_.notify_all();
  };
  events.problem = [this](const std::string& problem) {
    const std::lock_guard lock(mutex_);
    problem_ = problem;
  };
  connection_ = std::make_unique<Connection>(worker_connection(options_), std::move(events));
  Connection& connection = *connection_;
  const auto small = std::int64_t{8} << 20;
  connection.subscribe(
      subject("offer", "*"), [this](const Incoming& m) { on_offer(m); }, small);
  connection.subscribe(task_subject("*", instance_), [this](const Incoming& m) { on_task(m); });
  connection.subscribe(
      subject("cancel", "*"), [this](const Incoming& m) { on_cancel(m); }, small);
  for (int slot = 0; slot < options_.limits.slots; ++slot) {
    slots_.push_back(start_thread([this, slot](const std::stop_token& stop) {
      compute(stop, static_cast<std::size_t>(slot));
    }));
  }
  server_ = start_thread([this](const std::stop_token& stop) { serve(stop); });
}

WorkerLink::~WorkerLink() {
  stopping_ = true;
  server_ = {};  // Nothing is claimed any more.
  slots_.clear();
}

WorkerCounts WorkerLink::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::string WorkerLink::problem() const {
  const std::lock_guard lock(mutex_);
  return problem_;
}

void WorkerLink::count_malformed(const std::string& robot, const std::string& problem) {
  const std::lock_guard lock(mutex_);
  ++counts_.malformed;
  if (!problem.empty()) problem_ = "robot " + robot + ": " + problem;
}

void WorkerLink::say_hello() {
  connection_->publish(
      kHelloSubject, encode(HelloMessage{.instance = instance_,
                                         .worker = options_.name,
                                         .version = options_.version,
                                         .slots = static_cast<std::uint32_t>(options_.limits.slots),
                                         .workloads = admission_.known()}));
}

void WorkerLink::serve(const std::stop_token& stop) {
  name_thread("pirt-worker");
  while (!stop.stop_requested()) {
    std::vector<Desk::Claim> claims;
    std::vector<std::shared_ptr<Job>> running;
    bool greets = false;
    {
      std::unique_lock lock(mutex_);
      const Nanos now = clock_.now();
      greets = hello_at_ <= now;
      if (greets) hello_at_ = now + options_.hello;
      Nanos wake = hello_at_;
      offered_ = false;
      while (auto claim = desk_.claim(now)) claims.push_back(std::move(*claim));
      wake = std::min(wake, desk_.next_wake());
      for (const auto& job : jobs_) {
        if (job->said + options_.progress <= now) job->said = now, running.push_back(job);
        wake = std::min(wake, job->said + options_.progress);
      }
      if (claims.empty() && running.empty() && !greets && now < wake) {
        changed_.wait_for(lock, stop, wake - now, [this] { return offered_; });
        continue;
      }
    }
    for (const Desk::Claim& claim : claims) {
      connection_->publish(subject("claim", claim.robot),
                           encode(ClaimMessage{claim.run, instance_}));
    }
    for (const auto& job : running) say(*job, {.kind = ReplyKind::kRunning});
    if (greets && connection_->is_up()) say_hello();
  }
}

void WorkerLink::on_offer(const Incoming& message) {
  const std::string robot = robot_of(message.subject);
  if (message.data.size() > kMostSmall || !is_robot_name(robot)) return count_malformed(robot, "");
  const auto offer = decode_as<OfferMessage>(message.data);
  if (!offer.value) return count_malformed(robot, offer.problem);
  {
    const std::lock_guard lock(mutex_);
    desk_.offered(robot, offer.value->run, offer.value->waiting, clock_.now());
    offered_ = true;
  }
  changed_.notify_all();
}

/// The subject is the server's, which vouches for the robot. What nobody asked for is not even
/// read.
void WorkerLink::on_task(const Incoming& message) {
  if (message.data.size() <= kMostSmall) {
    if (decode_as<OfferMessage>(message.data).value) return on_offer(message);
  }
  auto job = std::make_shared<Job>();
  job->robot = robot_of(message.subject);
  {
    const std::lock_guard lock(mutex_);
    if (!desk_.expects(job->robot) || !is_robot_name(job->robot)) {
      ++counts_.malformed;
      return;
    }
  }
  auto task = decode_as<TaskMessage>(message.data);
  if (!task.value) return count_malformed(job->robot, task.problem);
  job->message = std::move(*task.value);
  job->taken = job->said = clock_.now();
  {
    const std::lock_guard lock(mutex_);
    const TaskMessage& said = job->message;
    if (stopping_ || !desk_.take(job->robot, said.task.run, said.waiting, job->taken)) {
      ++counts_.malformed;
      return;  // Its robot gives it to somebody else, since nobody says that it has it.
    }
    job->refused = desk_.why_refused(job->robot, job->taken);
    ++counts_.taken;
    jobs_.push_back(job);
    waiting_.push_back(job);
    offered_ = true;
  }
  say(*job, {.kind = ReplyKind::kRunning});
  waiting_changed_.notify_one();
  changed_.notify_all();
}

void WorkerLink::on_cancel(const Incoming& message) {
  const std::string robot = robot_of(message.subject);
  if (message.data.size() > kMostSmall) return count_malformed(robot, "");
  const auto cancel = decode_as<CancelMessage>(message.data);
  if (!cancel.value) return count_malformed(robot, cancel.problem);
  const std::lock_guard lock(mutex_);
  for (const auto& job : jobs_) {
    if (job->robot == robot && job->message.task == cancel.value->task) job->unwanted = true;
  }
}

void WorkerLink::compute(const std::stop_token& stop, std::size_t slot) {
  name_thread(fmt::format("pirt-slot-{}", slot));
  std::unique_ptr<Computer> computer;
  while (true) {
    std::unique_lock lock(mutex_);
    if (!waiting_changed_.wait(lock, stop, [this] { return !waiting_.empty(); })) return;
    const std::shared_ptr<Job> job = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    ReplyMessage reply;
    bool gone = false;
    try {
      if (computer == nullptr) computer = options_.make_computer();
      run(*computer, *job, reply);
    } catch (const std::exception& error) {
      reply.kind = ReplyKind::kFailedTry;
      reply.problem = one_line(error.what());
      gone = computer != nullptr && computer->is_gone();
    }
    finish(job, std::move(reply), gone);
  }
}

void WorkerLink::run(Computer& computer, const Job& job, ReplyMessage& reply) {
  const TaskMessage& task = job.message;
  const auto end = [&](ReplyKind kind, std::string problem) {
    reply.kind = kind;
    reply.problem = std::move(problem);
  };
  const auto is_over = [&] {
    return task.time_left && *task.time_left <= clock_.now() - job.taken;
  };
  if (stopping_) return end(ReplyKind::kLater, "the worker ends");
  if (!job.refused.empty()) return end(ReplyKind::kRefused, job.refused);
  auto workload = admission_.admit(task);
  if (!workload.value) return end(ReplyKind::kRefused, one_line(workload.problem));
  if (is_over() || job.unwanted) return end(ReplyKind::kExpired, "");
  std::optional<TaskMessage> whole;
  if (const auto* const blob = std::get_if<Blob>(&task.inputs)) {
    Bytes bytes;
    if (!fetch(job, "in", task.task.hex(), *blob, bytes, reply)) return;
    whole = task;
    whole->inputs = std::move(bytes);
    if (is_over()) return end(ReplyKind::kExpired, "");  // Reading it took its time.
  }
  const auto parameters = [&](ReplyMessage& why) -> std::optional<Bytes> {
    Bytes bytes;
    const Blob& blob = *task.parameters;
    if (!fetch(job, "par", blob.digest.hex(), blob, bytes, why)) return std::nullopt;
    return bytes;
  };
  computer.compute({job.robot, whole ? *whole : task, std::move(*workload.value), parameters,
                    [this] { return stopping_.load(); }},
                   reply);
  if (reply.kind == ReplyKind::kDone && !job.unwanted) store_outputs(job, reply);
}

bool WorkerLink::fetch(const Job& job, std::string_view what, const std::string& name,
                       const Blob& blob, Bytes& bytes, ReplyMessage& reply) {
  auto found = fetch_blob(*connection_, job.robot, blob_subject(job.robot, what, name), blob,
                          [&] { return stopping_ || job.unwanted; });
  if (found.how == Fetched::How::kWhole) {
    bytes = std::move(found.bytes);
    return true;
  }
  const bool missing = found.how == Fetched::How::kMissing;
  reply.kind = missing ? ReplyKind::kMissing : ReplyKind::kLater;
  reply.problem = fmt::format("{} {}", what == "par" ? "its parameters" : "its inputs",
                              missing ? "are not on the server" : "could not be read there");
  return false;
}

/// Within the reply where they fit.
void WorkerLink::store_outputs(const Job& job, ReplyMessage& reply) {
  const Bytes bytes = std::move(std::get<Bytes>(reply.outputs));
  const auto chunk = connection_->chunk_bytes();
  if (bytes.size() <= chunk) {
    reply.outputs = bytes;
    return;
  }
  const std::string name = fmt::format("{}-{}", job.message.task.hex(), job.message.send);
  const std::string problem = put_blob(*connection_, blob_subject(job.robot, "out", name), bytes,
                                       chunk, [&] { return stopping_ || job.unwanted; });
  reply.outputs = Blob{digest_of(bytes), bytes.size(), chunk};
  if (problem.empty()) return;
  reply.kind = ReplyKind::kLater;
  reply.problem = "its outputs could not be stored: " + problem;
  reply.outputs = Bytes{};
}

void WorkerLink::say(const Job& job, ReplyMessage reply) {
  reply.task = job.message.task;
  reply.send = job.message.send;
  reply.worker = options_.name;
  reply.held = clock_.now() - job.taken;
  connection_->publish(subject("answer", job.robot), encode(reply));
}

/// The slot is free for the next task before its robot hears of the end, and may submit one.
void WorkerLink::finish(const std::shared_ptr<Job>& job, ReplyMessage reply, bool gone) {
  const bool unwanted = job->unwanted;
  {
    const std::lock_guard lock(mutex_);
    const Nanos now = clock_.now();
    desk_.finished(job->robot, now - job->taken, gone, now);
    jobs_.remove(job);
    std::int64_t* const count = unwanted                              ? &counts_.cancelled
                                : reply.kind == ReplyKind::kDone      ? &counts_.done
                                : reply.kind == ReplyKind::kFailedTry ? &counts_.failed
                                : reply.kind == ReplyKind::kRefused   ? &counts_.refused
                                : reply.kind == ReplyKind::kMissing   ? &counts_.missed
                                : reply.kind == ReplyKind::kExpired   ? &counts_.expired
                                                                      : &counts_.returned;
    ++*count;
    offered_ = true;
  }
  changed_.notify_all();
  if (!unwanted) say(*job, std::move(reply));
}

}  // namespace pirt::cloud
