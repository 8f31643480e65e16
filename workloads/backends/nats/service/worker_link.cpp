#include "workloads/backends/nats/service/worker_link.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "workloads/backends/nats/link/blobs.h"
#include "workloads/backends/nats/wire/subjects.h"
#include "workloads/base/error.h"
#include "workloads/base/system/thread.h"

namespace pirt::cloud {
/// What somebody waits for may be there then.
template <typename Change>
void WorkerLink::change(Change change) {
  {
    const std::lock_guard lock(mutex_);
    change(clock_.now());
    changed_now_ = true;
  }
  changed_.notify_all();
}

/// @param robot  As a subject says it: it may be anything.
void WorkerLink::drop(const std::string& robot, const std::string& problem) {
  const std::lock_guard lock(mutex_);
  ++counts_.malformed;
  connection_->note("robot " + robot + ": " + problem);
}

template <typename Said>
std::optional<Said> WorkerLink::read(const std::string& robot, const Incoming& message) {
  constexpr std::size_t kMostSmall = 256;
  Decoded<Said> said{std::nullopt, "a message that is too long"};
  if (is_robot_name(robot) && message.data.size() <= kMostSmall) {
    said = decode_as<Said>(message.data);
  }
  if (!said.value) drop(robot, said.problem);
  return std::move(said.value);
}

WorkerLink::WorkerLink(const WorkerOptions& options, std::span<const Workload* const> workloads)
    : options_(options),
      admission_(workloads, options.call_bytes),
      hello_(encode(HelloMessage{.instance = instance_,
                                 .worker = options.name,
                                 .version = options.version,
                                 .slots = static_cast<std::uint32_t>(options.limits.slots),
                                 .workloads = admission_.known()})),
      desk_(options.limits) {
  options_.connection.name = "pirt worker " + options_.name;
  connection_ = std::make_unique<Connection>(options_.connection, [this](bool is_up) {
    if (is_up) change([this](Nanos now) { hello_at_ = now; });
  });
  constexpr std::int64_t kSmall = std::int64_t{8} << 20, kLarge = std::int64_t{64} << 20;
  const auto subscribe = [this](const std::string& to, std::int64_t most_bytes, auto handler) {
    connection_->subscribe(
        to, [handler](const Incoming& m) { handler(robot_of(m.subject), m); }, most_bytes);
  };
  const auto on_offer = [this](const std::string& robot, const Incoming& message) {
    if (const auto offer = read<OfferMessage>(robot, message)) {
      change([&](Nanos now) { desk_.offered(robot, offer->run, offer->waiting, now); });
    }
  };
  subscribe(subject("offer", "*"), kSmall, on_offer);
  subscribe(task_subject("*", instance_), kLarge,
            [this, on_offer](const std::string& robot, const Incoming& message) {
              const bool none = decode_as<OfferMessage>(message.data.first(std::min<std::size_t>(
                                                            message.data.size(), 256)))
                                    .value.has_value();
              return none ? on_offer(robot, message) : on_task(robot, message);
            });
  subscribe(subject("cancel", "*"), kSmall,
            [this](const std::string& robot, const Incoming& message) {
              const auto cancel = read<CancelMessage>(robot, message);
              const std::lock_guard lock(mutex_);
              for (const auto& job : jobs_) {
                if (!cancel || job->robot != robot) continue;
                if (job->message.task == cancel->task) job->unwanted = true;
              }
            });
  for (int slot = 0; slot < options_.limits.slots; ++slot) {
    slots_.push_back(
        start_thread([this, slot](const std::stop_token& stop) { compute(stop, slot); }));
  }
  server_ = start_thread([this](const std::stop_token& stop) { serve(stop); });
}

WorkerLink::~WorkerLink() {
  stopping_ = true;
  server_ = {};  // Nothing is claimed any more.
  for (std::jthread& slot : slots_) slot.request_stop();
  slots_.clear();
}

WorkerCounts WorkerLink::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void WorkerLink::serve(const std::stop_token& stop) {
  name_thread("pirt-worker");
  while (!stop.stop_requested()) {
    std::vector<Desk::Claim> claims;
    Jobs running;
    std::unique_lock lock(mutex_);
    const Nanos now = clock_.now();
    const bool greets = hello_at_ <= now;
    if (greets) hello_at_ = now + options_.hello;
    changed_now_ = false;
    while (auto claim = desk_.claim(now)) claims.push_back(std::move(*claim));
    Nanos wake = std::min(hello_at_, desk_.next_wake());
    for (const auto& job : jobs_) {
      if (job->said + options_.progress <= now) job->said = now, running.push_back(job);
      wake = std::min(wake, job->said + options_.progress);
    }
    if (claims.empty() && running.empty() && !greets) {
      changed_.wait_for(lock, stop, wake - now, [this] { return changed_now_; });
      continue;
    }
    lock.unlock();
    try {
      for (const Desk::Claim& claim : claims) {
        connection_->publish(subject("claim", claim.robot),
                             encode(ClaimMessage{claim.run, instance_}));
      }
      for (const auto& job : running) say(*job, {.kind = ReplyKind::kRunning});
      if (greets && connection_->is_up()) connection_->publish(kHelloSubject, hello_);
    } catch (const std::exception& error) {  // Such as no memory: it goes on.
      connection_->note(error.what());
    }
  }
}

/// The subject is the server's, which vouches for the robot. What nobody asked for is not even
/// read.
void WorkerLink::on_task(const std::string& robot, const Incoming& message) {
  bool expected = is_robot_name(robot);
  {
    const std::lock_guard lock(mutex_);
    expected = expected && desk_.expects(robot);
    counts_.malformed += expected ? 0 : 1;
  }
  if (!expected) return;
  auto task = decode_as<TaskMessage>(message.data);
  if (!task.value) return drop(robot, task.problem);
  auto job = std::make_shared<Job>();
  job->robot = robot;
  job->message = std::move(*task.value);
  bool taken = false;
  change([&](Nanos now) {
    const TaskMessage& said = job->message;
    taken = !stopping_ && desk_.take(robot, said.task.run, said.waiting, now);
    // Else its robot gives it to somebody else, since nobody says that it has it.
    counts_.malformed += taken ? 0 : 1;
    if (!taken) return;
    job->taken = job->said = now;
    job->refused = desk_.why_refused(robot, now);
    ++counts_.taken;
    jobs_.push_back(job);
    waiting_.push_back(job);
  });
  if (taken) say(*job, {.kind = ReplyKind::kRunning});
}

void WorkerLink::compute(const std::stop_token& stop, int slot) {
  name_thread(fmt::format("pirt-slot-{}", slot));
  std::unique_ptr<Computer> computer;
  while (true) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return !waiting_.empty(); })) return;
    const std::shared_ptr<Job> job = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    ReplyMessage reply;
    bool gone = false;
    try {
      if (computer == nullptr) computer = options_.make_computer();
      reply = run(*computer, *job);
    } catch (const std::exception& error) {
      reply = {.kind = ReplyKind::kFailedTry, .problem = error.what()};
      gone = dynamic_cast<const ProcessGone*>(&error) != nullptr;
    }
    finish(job, std::move(reply), gone);
  }
}

ReplyMessage WorkerLink::run(Computer& computer, Job& job) {
  TaskMessage& task = job.message;
  const auto is_over = [&] {
    return task.time_left && *task.time_left <= clock_.now() - job.taken;
  };
  if (stopping_) return {.kind = ReplyKind::kLater, .problem = "the worker ends"};
  if (!job.refused.empty()) return {.kind = ReplyKind::kRefused, .problem = job.refused};
  auto workload = admission_.admit(task);
  if (!workload.value) return {.kind = ReplyKind::kRefused, .problem = workload.problem};
  if (is_over() || job.unwanted) return {.kind = ReplyKind::kExpired};
  if (const auto blob = std::exchange(task.inputs.blob, {})) {
    if (auto why = fetch(job, "in", task.task.hex(), *blob, task.inputs.bytes)) {
      return *std::move(why);
    }
    if (is_over()) return {.kind = ReplyKind::kExpired};  // Reading it took its time.
  }
  Call call{
      .robot = job.robot, .task = task, .workload = std::move(*workload.value), .stop = [this] {
        return stopping_.load();
      }};
  ReplyMessage reply = computer.compute(call);
  if (reply.kind == ReplyKind::kMissing && task.parameters) {  // It has not kept them.
    Bytes bytes;
    if (auto why = fetch(job, "par", task.parameters->digest.hex(), *task.parameters, bytes)) {
      return *std::move(why);
    }
    call.parameters = bytes;
    reply = computer.compute(call);
  }
  if (reply.kind == ReplyKind::kDone && !job.unwanted) store_outputs(job, reply);
  return reply;
}

std::optional<ReplyMessage> WorkerLink::fetch(const Job& job, std::string_view what,
                                              const std::string& name, const Blob& blob,
                                              Bytes& bytes) {
  auto answer = fetch_blob(*connection_, blob_subject(job.robot, what, name), blob,
                           [&, until = clock_.now() + options_.fetch] {
                             return stopping_ || job.unwanted || clock_.now() >= until;
                           });
  if (answer.came && answer.status == 0) {
    bytes = std::move(answer.data);
    return std::nullopt;
  }
  return ReplyMessage{
      .kind = answer.came ? ReplyKind::kMissing : ReplyKind::kLater,
      .problem = fmt::format("{} {}", what == "par" ? "its parameters" : "its inputs",
                             answer.came ? "are not on the server" : "could not be read there")};
}

/// Within the reply where they fit.
void WorkerLink::store_outputs(const Job& job, ReplyMessage& reply) {
  const Bytes& bytes = reply.outputs.bytes;
  if (bytes.size() <= connection_->chunk_bytes()) return;
  const Blob blob{digest_of(bytes), bytes.size(), connection_->blob_chunk_bytes()};
  const std::string name = fmt::format("{}-{}", job.message.task.hex(), job.message.send);
  const std::string problem = put_blob(*connection_, blob_subject(job.robot, "out", name), blob,
                                       bytes, [&] { return stopping_ || job.unwanted; });
  reply.outputs = {{}, blob};
  if (!problem.empty()) {
    reply = {.kind = ReplyKind::kLater, .problem = "its outputs could not be stored: " + problem};
  }
}

bool WorkerLink::say(const Job& job, ReplyMessage reply) {
  reply.task = job.message.task;
  reply.send = job.message.send;
  reply.worker = options_.name;
  return connection_->publish(subject("answer", job.robot), encode(reply));
}

/// The slot is free for the next task before its robot hears of the end, and may submit one.
void WorkerLink::finish(const std::shared_ptr<Job>& job, ReplyMessage reply, bool gone) {
  const bool unwanted = job->unwanted;
  change([&](Nanos now) {
    desk_.finished(job->robot, now - job->taken, gone, now);
    jobs_.remove(job);
    ++(unwanted ? counts_.cancelled : counts_.ended_as[static_cast<std::size_t>(reply.kind)]);
  });
  try {
    if (unwanted || say(*job, reply) || stopping_) return;
    // Once more when there is a link again.
    for (int looks = 0; looks < 100 && !stopping_; ++looks) {
      if (connection_->wait_until_up(std::chrono::milliseconds(100))) {
        say(*job, std::move(reply));
        return;
      }
    }
  } catch (const std::exception& error) {
    connection_->note(error.what());
  }
}

}  // namespace pirt::cloud
